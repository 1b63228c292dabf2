"""A scene set up: everything that shines, projected at every row's own time and drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from hardware.sim.body.shape import BodyShape
from hardware.sim.body.silhouette import BEYOND, Silhouette
from hardware.sim.body.ways import ImageTrajectories, ways_of
from hardware.sim.scenes.crlb import is_merged, place_information
from hardware.sim.scenes.kernels import Light
from hardware.sim.scenes.motion import Moving, PhoneAndRobotMotion
from hardware.sim.scenes.optics import Lamp, Pane
from hardware.sim.scenes.room import Bar, Mirror, Room, RoomLights
from hardware.sim.scenes.sensor import Sensor
from pipeline.camera.lens import Camera
from pipeline.frames import Array, rpy_from_R
from pipeline.signals import Image

Flags = npt.NDArray[np.bool_]
EVERYWHERE = (-1e4, 1e4)  # beyond any picture [px]
SceneMotion = PhoneAndRobotMotion[Moving]
WHOLE = 0.99
"""Share of an LED's light that its robot's body must let through for it to be visible."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnFrame:
    """A picture and where its LEDs are; see `video.RenderedFrame`."""

    luma: Image
    pixels: Array
    visible: Flags
    merged: Flags
    information: Array


@dataclass(frozen=True, slots=True, eq=False)
class ProjectedScene:
    """What is before a camera at one time."""

    ways: ImageTrajectories
    body: Silhouette | None
    lamps: list[Lamp]
    owners: list[int]
    """Which LED each lamp is; −1: none."""
    panes: list[Pane]
    room: Light
    grey: Image
    """The room's grey levels."""


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
    body: BodyShape | None

    def draw(
        self,
        sensor: Sensor,
        camera: Camera,
        moving: SceneMotion,
        t: float,
        shift: tuple[int, int],
        bound: bool,
    ) -> DrawnFrame:
        """The picture whose middle row is exposed around `t` [s], and what is true of it."""
        projected = self._projected(sensor, camera, moving, t)
        luma = self._rendered(sensor, projected, shift)
        n, lamps, panes = len(self.leds_in_b), projected.lamps, projected.panes
        visible, merged = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        information = np.zeros((n, 2, 2))
        for lamp, led in zip(lamps, projected.owners, strict=True):
            if led < 0:
                continue
            shown = sensor.share_shown(lamp, projected.body) if projected.body is not None else 1.0
            visible[led] = shown > WHOLE and _in_sight(lamp, panes, sensor)
            if visible[led]:
                merged[led] = is_merged(sensor, projected.room, lamps, panes, lamp)
                if bound:
                    information[led] = place_information(sensor, lamp)
        return DrawnFrame(luma, projected.ways.rows[:n, :2], visible, merged, information)

    def luma(
        self, sensor: Sensor, camera: Camera, moving: SceneMotion, t: float, shift: tuple[int, int]
    ) -> Image:
        """The picture alone."""
        return self._rendered(sensor, self._projected(sensor, camera, moving, t), shift)

    def _projected(
        self, sensor: Sensor, camera: Camera, moving: SceneMotion, t: float
    ) -> ProjectedScene:
        exposure_s = sensor.optics.exposure_s
        ways = ways_of(lambda s: self._points(moving, t + s)[1], camera, exposure_s)
        body = self._silhouette(sensor, camera, moving, t)
        lamps, owners = self._lamps(sensor, camera, ways, t, body)
        room, grey = self._room(camera, moving, t)
        return ProjectedScene(ways, body, lamps, owners, self._panes(sensor, ways), room, grey)

    def _rendered(self, sensor: Sensor, projected: ProjectedScene, shift: tuple[int, int]) -> Image:
        return sensor.picture(
            projected.room, projected.grey, projected.lamps, projected.panes, shift, projected.body
        )

    def _points(self, moving: SceneMotion, t: float) -> tuple[Array, Array]:
        """Points in f (m, 3) and in c: LEDs, mirrored ones, a twin's, lamps, windows, the bar."""
        (R_fc, p_cf_in_f), (R_fb, p_bf_in_f) = moving.phone_pose(t), moving.robot.pose(t)
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

    def _silhouette(
        self, sensor: Sensor, camera: Camera, moving: SceneMotion, t: float
    ) -> Silhouette | None:
        body = self.body
        if body is None:
            return None

        def places_in_c(s: float) -> Array:
            R_cb, p_bc_in_c = moving.relative(t + s)
            up_in_b = moving.robot.pose(t + s)[0][2]
            return p_bc_in_c + body.places(up_in_b) @ R_cb.T

        ways = ways_of(places_in_c, camera, sensor.optics.exposure_s, BEYOND)
        return Silhouette(body, camera, ways, sensor.shutter)

    def _lamps(
        self,
        sensor: Sensor,
        camera: Camera,
        ways: ImageTrajectories,
        t: float,
        body: Silhouette | None,
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
        if body is not None:
            lamps = [
                replace(lamp, behind=body.before(lamp.way[:2], depth, sensor.box(lamp)))
                for lamp, depth in zip(lamps, ways.depth[drawn], strict=True)
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
                motion_blur = float(np.hypot(*rows[0, 2:4])) * o.exposure_s / np.sqrt(12.0)
                softness = float(np.hypot(2.0 * o.blur_px, motion_blur))
                u, v = np.sort(rows[:, 0]), np.sort(rows[:, 1])
                panes.append(Pane((u[0], u[1]), (v[0], v[1]), float(light), softness, False))
        if self.bar is not None and np.isfinite(ways.depth[-2:]).all():
            u = np.sort(ways.rows[-2:, 0])
            motion_blur = abs(float(ways.rows[-1, 2])) * o.exposure_s / np.sqrt(12.0)
            softness = float(np.hypot(2.0 * o.blur_px, motion_blur))
            panes.append(Pane((u[0], u[1]), EVERYWHERE, self.bar.light, softness, True))
        return panes

    def _room(
        self, camera: Camera, moving: SceneMotion, t: float
    ) -> tuple[npt.NDArray[np.float32], Image]:
        """The background as a camera sees it that has turned since the start."""
        turned = rpy_from_R(self.R_fc_start.T @ moving.phone_pose(t)[0])
        return self.room.view(-camera.focal_px * turned[2], camera.focal_px * turned[1])


def _in_sight(lamp: Lamp, panes: list[Pane], sensor: Sensor) -> bool:
    """Whether all of a light is in the picture and before nothing opaque."""
    motion_blur = 0.5 * np.abs(lamp.way[2:4]) * sensor.optics.exposure_s
    reach = lamp.radius_px + 2.5 * sensor.optics.blur_px + motion_blur
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
