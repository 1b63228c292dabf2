"""The closed loop with a robot of light, in virtual time: a phone films a screen, and leads."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import cycle
from math import radians

import numpy as np

from hardware.robot_file import RobotFile
from hardware.sim.glass_film import film, glass_before
from hardware.sim.hand import Hand
from hardware.sim.phone import BodyHistory
from pipeline.camera.lens import Camera
from pipeline.config import TeleopConfig
from pipeline.frames import Array
from pipeline.glass.display_lag import SWEEP_SHARE, DisplayLag, swept
from pipeline.glass.robot_of_light import STEP_S, Lights, RobotOfLight
from pipeline.glass.window import Glass
from pipeline.signals import BodyImu, Image, PhoneImu
from pipeline.teleop import Output
from pipeline.vision.detection import Detection
from server.phone.frame_pipeline import FramePipeline
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from server.view.glass_watch import GlassWatch
from server.virtual_phone.phone_script import VirtualOperator

INCHES_24 = Glass(0.53, 0.30)
FRAMES_HZ = 60.0
"""Of the display, and of the server's words to it."""
WAY_S = 0.010
"""From the server to the page."""


@dataclass(frozen=True, slots=True)
class Display:
    """A screen on a table."""

    glass: Glass = INCHES_24
    lag_s: float = 0.040
    """From drawing to light."""
    tilt_rad: float = radians(10.0)
    """Of its upper edge, away from who looks."""
    believed_lag_s: float | None = None
    """Taken for its lag without measuring; None: it is measured."""
    grey: int = 70
    """Of the fiducials in a picture, of 255; 0: there are none."""
    frames_s: tuple[float, ...] = (1.0 / FRAMES_HZ,)
    """From each frame to the next, in turn, again and again."""


class ScreenSimulation(VirtualTimeSimulation):
    """One flight of a robot that is only light."""

    def __init__(
        self,
        robot_file: RobotFile,
        config: TeleopConfig,
        scene: SimulationOptions,
        display: Display,
        operator: VirtualOperator | None = None,
        hand: Hand | None = None,
    ) -> None:
        """Everything at rest at time 0, the robot not shown yet."""
        super().__init__(robot_file, config, scene, operator, hand)
        leds_in_b = robot_file.robot.leds_in_b
        self._robot, self._gates = robot_file.robot, config.gates
        self._display, self._rest_in_f = display, leds_in_b.mean(axis=0)
        self.phone.films = self._film
        self._shown: deque[tuple[float, Array]] = deque(maxlen=64)
        """(Time of its light [s], dots (n, 2) [m]) of the frames lately drawn."""
        self.robot_of_light = RobotOfLight(leds_in_b, display.glass)
        self._begin_camera(self._frame_pipeline.camera, is_guessed=not scene.knows_camera)
        if display.believed_lag_s is not None:
            self.robot_of_light.dated_lag = DisplayLag(display.believed_lag_s, 0.0)
        self._sent: deque[tuple[float, Lights]] = deque(maxlen=16)
        self._t_lights = self._t_frame = 0.0
        self._frames_s = cycle(display.frames_s)
        self.phases: set[str] = set()
        """Shown so far."""
        self.drawn_before_s: list[float] = []
        """How long before each picture its light had been drawn."""

    @property
    def shows(self) -> Lights:
        """What the page was told last."""
        return self._sent[-1][1]

    def advance(self) -> Output:
        """One control period of everything, and the frames of the glass that are due."""
        while self._t_lights <= self.t:
            self._sent.append((self._t_lights + WAY_S, self._lights(self._t_lights)))
            self._t_lights += 1.0 / FRAMES_HZ
        while self._t_frame <= self.t:
            self._shown.append((self._t_frame + self._display.lag_s, self._drawn()))
            self._t_frame += next(self._frames_s)
        return super().advance()

    def _lights(self, t: float) -> Lights:
        def ahead(seconds: float) -> list[tuple[float, Array, Array]]:
            body = self.follower.body
            now = [(self.t, body.wxyz_fb, body.p_bf_in_f)]
            return now + [(self.t + dt, wxyz, p) for dt, wxyz, p in body.ahead(seconds)]

        lights = self.robot_of_light.step(max(t, self.t), ahead)
        self.phases.add(lights.phase)
        return lights

    def _drawn(self) -> Array:
        """What the page makes of the newest that it was told, at this frame."""
        t, lag = self._t_frame, self.robot_of_light.lag
        come = [lights for since, lights in self._sent if since <= t]
        if not come or come[-1].phase == "search":
            return np.zeros((0, 2))
        if come[-1].phase == "sweep":
            right = SWEEP_SHARE * self._display.glass.width_m * float(swept(np.array(t)))
            return np.array([[right, 0.0]])
        lights = come[-1]
        assert lights.places is not None
        assert lag is not None
        k = (t + lag.value - lights.t) / STEP_S
        i = int(np.clip(np.floor(k), 0, len(lights.places) - 2))
        places: Array = lights.places[i] + (k - i) * (lights.places[i + 1] - lights.places[i])
        return places

    def _add_imu(self, *samples: PhoneImu | BodyImu) -> None:
        super()._add_imu(*samples)
        for sample in samples:
            if isinstance(sample, PhoneImu):
                self.robot_of_light.add_phone_imu(sample)

    def _begin_camera(self, camera: Camera, *, is_guessed: bool) -> None:
        self._watch, self.camera_in_use = GlassWatch(camera, self._display.glass), camera
        self.robot_of_light.begin_camera(camera, is_guessed=is_guessed)

    def _look_further(self, detection: Detection) -> None:
        """Look for the glass; with a lens that is measured, begin to look again, as the server."""
        luma = self._frame_pipeline.luma
        if luma is None or detection.comes_again:
            return
        look = self._watch.look(luma, detection)
        self.robot_of_light.add_corners(look.corners)
        lens = self.robot_of_light.lens_of(self.camera_in_use)
        if lens is not None:
            camera = lens.camera(self.camera_in_use.width, self.camera_in_use.height)
            self._frame_pipeline = FramePipeline(camera, self._robot, self._gates)
            self._begin_camera(camera, is_guessed=False)
            return
        if look.seen is not None:
            self.robot_of_light.add_seen(look.seen, look.lights_in_c, self.t)
        if self.robot_of_light.is_shown:
            self._frame_pipeline.front_end.films_glass(self.robot_of_light.time_offset)

    def _film(self, camera: Camera, t: float, _: BodyHistory, rng: np.random.Generator) -> Image:
        """A picture of the glass taken at `t` [s]."""
        glass, dots = self._display.glass, np.zeros((0, 2))
        lit = [frame for frame in self._shown if frame[0] <= t]
        if lit:
            since, dots = lit[-1]
            self.drawn_before_s.append(t - since + self._display.lag_s)
        display = self._display
        glass_at = glass_before(self.phone.hand, t, self._rest_in_f, display.tilt_rad)
        return film(camera, glass_at, glass, dots[glass.has(dots)], rng, display.grey)
