"""A scene set up: everything that shines, projected at every row's own time and drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hardware.sim.scenes.crlb import is_merged, place_information
from hardware.sim.scenes.motion import PhoneAndRobotMotion
from hardware.sim.scenes.optics import Lamp, Pane, Sensor
from hardware.sim.scenes.room import Bar, Mirror, Room, RoomLights
from pipeline.camera.lens import Camera
from pipeline.frames import Array, rpy_from_R
from pipeline.signals import Image

Flags = npt.NDArray[np.bool_]
NODES = 5
"""Times at which places are exact; between them a polynomial, right to 1e-3 px."""
ROW_ITERATIONS = 4
BEYOND = 1.25
"""Half fields to each side outside of which nothing is drawn."""
EVERYWHERE = (-1e4, 1e4)  # beyond any picture [px]


@dataclass(frozen=True, slots=True, eq=False)
class DrawnFrame:
    """A picture and where its LEDs are; see `video.RenderedFrame`."""

    luma: Image
    pixels: Array
    visible: Flags
    merged: Flags
    information: Array


@dataclass(frozen=True, slots=True, eq=False)
class ImageTrajectories:
    """How points move over the picture around the times at which their rows are exposed."""

    rows: Array
    """(n, 6) place [px], velocity [px/s], acceleration [px/s²]."""
    depth: Array
    """(n,) ahead of the camera [m]; NaN: out of sight."""


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """Everything that a video shows."""

    leds_in_b: Array
    led_radius_m: float
    led_lights: Array
    """(n,) of their surfaces."""
    shown: Flags
    """(n,) not covered."""
    dark_from: float
    """When [s] the robot's own LEDs go out."""
    twin_lights: Array
    """(n,) of another robot's LEDs; (0,) if there is none."""
    lights: RoomLights
    mirror: Mirror | None
    bar: Bar | None
    room: Room
    R_fc_start: Array

    def draw(
        self,
        sensor: Sensor,
        camera: Camera,
        moving: PhoneAndRobotMotion,
        t: float,
        shift: tuple[int, int],
        bound: bool,
    ) -> DrawnFrame:
        """The picture whose middle row is exposed around `t` [s]."""
        ways = self._ways(sensor, camera, moving, t)
        n = len(self.leds_in_b)
        lamps, owners = self._lamps(camera, ways, t)
        panes = self._panes(sensor, ways)
        room, grey = self._room(camera, moving, t)
        luma = sensor.picture(room, grey, lamps, panes, shift)
        visible, merged = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        information = np.zeros((n, 2, 2))
        for lamp, led in zip(lamps, owners, strict=True):
            if led < 0:
                continue
            visible[led] = _in_sight(lamp, panes, sensor)
            if visible[led]:
                merged[led] = is_merged(sensor, room, lamps, panes, lamp)
                if bound:
                    information[led] = place_information(sensor, lamp)
        return DrawnFrame(luma, ways.rows[:n, :2], visible, merged, information)

    def _points(self, moving: PhoneAndRobotMotion, t: float) -> tuple[Array, Array]:
        """Points in f (m, 3) and in c: LEDs, mirrored ones, a twin's, lamps, windows, the bar."""
        (R_fc, p_cf_in_f), (R_fb, p_bf_in_f) = moving.hand.pose(t), moving.robot.pose(t)
        leds = p_bf_in_f + self.leds_in_b @ R_fb.T
        points = [leds]
        if self.mirror is not None:
            points.append(self.mirror.images(leds))
        if moving.twin is not None:
            R_ft, p_tf_in_f = moving.twin.pose(t)
            points.append(p_tf_in_f + self.leds_in_b @ R_ft.T)
        points += [self.lights.places_in_f, self.lights.windows_in_f.reshape(-1, 3)]
        if self.bar is not None:
            points.append(self.bar.edges(t))
        in_f = np.concatenate(points)
        return in_f, (in_f - p_cf_in_f) @ R_fc

    def _ways(
        self, sensor: Sensor, camera: Camera, moving: PhoneAndRobotMotion, t: float
    ) -> ImageTrajectories:
        span = 0.5 * (abs(camera.readout_s) + sensor.optics.exposure_s) + 1e-4
        nodes = np.linspace(-1.0, 1.0, NODES)
        points = np.array([self._points(moving, t + span * s)[1] for s in nodes])
        depth = points[NODES // 2, :, 0]
        seen = _ahead(points, camera)
        safe = np.where(seen[:, None], points, np.array([1.0, 0.0, 0.0]))
        pixels = camera.pixels(safe.reshape(-1, 3)).reshape(NODES, -1)
        powers: Array = np.linalg.inv(np.vander(nodes, increasing=True)).astype(np.float64) @ pixels
        powers = (powers / span ** np.arange(NODES)[:, None]).reshape(NODES, -1, 2)
        rows = _at_their_rows(powers, camera)
        return ImageTrajectories(rows, np.where(seen, depth, np.nan))

    def _lamps(
        self, camera: Camera, ways: ImageTrajectories, t: float
    ) -> tuple[list[Lamp], list[int]]:
        """Round lights at `t` [s], and which LED each is; −1: none."""
        n, k = len(self.leds_in_b), len(self.lights.radii_m)
        radii, shown = np.repeat(self.led_radius_m, n), self.shown & (t < self.dark_from)
        lights, owners = self.led_lights, np.where(shown, np.arange(n), -2)
        if self.mirror is not None:
            radii = np.tile(radii, 2)
            lights = np.concatenate((lights, self.mirror.share * lights))
            owners = np.concatenate((owners, np.where(shown, -1, -2)))
        radii = np.concatenate((radii, np.repeat(self.led_radius_m, len(self.twin_lights))))
        lights = np.concatenate((lights, self.twin_lights))
        owners = np.concatenate((owners, np.full(len(self.twin_lights), -1)))
        radii = np.concatenate((radii, self.lights.radii_m))
        lights = np.concatenate((lights, self.lights.lights))
        owners = np.concatenate((owners, np.full(k, -1)))
        drawn = [j for j in range(len(radii)) if owners[j] > -2 and np.isfinite(ways.depth[j])]
        lamps = [
            Lamp(ways.rows[j], camera.focal_px * radii[j] / ways.depth[j], float(lights[j]))
            for j in drawn
        ]
        return lamps, [int(owners[j]) for j in drawn]

    def _panes(self, sensor: Sensor, ways: ImageTrajectories) -> list[Pane]:
        o = sensor.optics
        robots = len(self.leds_in_b) * (2 if self.mirror else 1) + len(self.twin_lights)
        first = robots + len(self.lights.radii_m)
        panes: list[Pane] = []
        for k, light in enumerate(self.lights.window_lights):
            rows, depth = ways.rows[first + 2 * k :][:2], ways.depth[first + 2 * k :][:2]
            if np.isfinite(depth).all():
                smear = float(np.hypot(*rows[0, 2:4])) * o.exposure_s / np.sqrt(12.0)
                softness = float(np.hypot(2.0 * o.blur_px, smear))
                u, v = np.sort(rows[:, 0]), np.sort(rows[:, 1])
                panes.append(Pane((u[0], u[1]), (v[0], v[1]), float(light), softness, False))
        if self.bar is not None and np.isfinite(ways.depth[-2:]).all():
            u = np.sort(ways.rows[-2:, 0])
            smear = abs(float(ways.rows[-1, 2])) * o.exposure_s / np.sqrt(12.0)
            softness = float(np.hypot(2.0 * o.blur_px, smear))
            panes.append(Pane((u[0], u[1]), EVERYWHERE, self.bar.light, softness, True))
        return panes

    def _room(
        self, camera: Camera, moving: PhoneAndRobotMotion, t: float
    ) -> tuple[npt.NDArray[np.float32], Image]:
        """The background as a camera sees it that has turned since the start."""
        turned = rpy_from_R(self.R_fc_start.T @ moving.hand.pose(t)[0])
        return self.room.view(-camera.focal_px * turned[2], camera.focal_px * turned[1])


def _ahead(points: Array, camera: Camera) -> Flags:
    """(m,) whether points (k, m, 3) in c are near the field of view at all times."""
    x = points[:, :, 0]
    reach = BEYOND * np.array(camera.half_field)
    inside = np.abs(points[:, :, 1:]) < np.maximum(x, 0.0)[:, :, None] * reach
    return np.asarray((inside.all(axis=2) & (x > 0.1)).all(axis=0))


def _at_their_rows(powers: Array, camera: Camera) -> Array:
    """(n, 6) place, velocity, acceleration when a place's row is exposed.

    `powers` (k, n, 2): coefficients over time [s] from the middle row's exposure.
    """
    orders = np.arange(len(powers))
    t = np.zeros(powers.shape[1])
    for _ in range(ROW_ITERATIONS if camera.readout_s != 0.0 else 0):
        v = (powers[:, :, 1] * t ** orders[:, None]).sum(axis=0)
        t = camera.row_delays(np.clip(v, 0.0, camera.height - 1.0))
    rows = np.zeros((len(t), 6))
    scale = np.ones(len(powers))
    for order in range(3):
        rest = powers[order:] * scale[order:, None, None]
        rows[:, 2 * order : 2 * order + 2] = (
            rest * t[None, :, None] ** np.arange(len(rest))[:, None, None]
        ).sum(axis=0)
        scale = scale * np.maximum(orders - order, 0)
    return rows


def _in_sight(lamp: Lamp, panes: list[Pane], sensor: Sensor) -> bool:
    """Whether all of a light is in the picture and before nothing opaque."""
    smear = 0.5 * np.abs(lamp.way[2:4]) * sensor.optics.exposure_s
    reach = lamp.radius_px + 2.5 * sensor.optics.blur_px + smear
    u, v = float(lamp.way[0]), float(lamp.way[1])
    if not (reach[0] <= u <= sensor.width - 1 - reach[0]):
        return False
    if not (reach[1] <= v <= sensor.height - 1 - reach[1]):
        return False
    for pane in panes:
        far = reach[0] + 2.5 * pane.softness_px
        if pane.opaque and pane.u[0] - far < u < pane.u[1] + far:
            return False
    return True
