"""The place of one screen, and the thread that says what it shows, beside the event loop."""

from __future__ import annotations

import logging
import threading
from collections import deque
from dataclasses import dataclass
from math import isfinite

import numpy as np

from hardware.follower import FollowerError
from hardware.sim.truth import MAX_AHEAD_S, TruthClient
from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.frames import Array
from pipeline.glass import window
from pipeline.glass.display_lag import SWEEP_SHARE
from pipeline.glass.robot_of_light import (
    STEP_S,
    GlassSeen,
    Lights,
    RobotOfLight,
    least_height,
)
from pipeline.signals import Image, PhoneImu, StampOffset
from pipeline.vision.detection import Detection
from server.common.clock import now
from server.phone.screen_door import Show
from server.protocol.screen_messages import ScreenLights, ScreenSize
from server.view.glass_watch import GlassLook, GlassWatch

log = logging.getLogger("lightleash")

PERIOD_S = 1.0 / 60.0
DOT_M = 0.003
"""Diameter of a light seen from `DOT_FROM_M`: 4 pixels of a phone; it grows with the distance."""
DOT_FROM_M = 0.6
WHY_S = 3.0
"""So long a guess stays why there is no glass in the pictures."""
MAX_NEWS = 256
"""Motion samples and looks that wait, the oldest forgotten: two seconds."""


@dataclass(frozen=True, slots=True, eq=False)
class NewCamera:
    """Another camera films the glass from now on."""

    camera: Camera
    is_guessed: bool
    """Its lens is to be measured."""


class Screen:
    """See `ScreenDoor`. Belongs to the event loop, but for `add_detection`."""

    def __init__(self, truth_port: int, leds_in_b: Array) -> None:
        """Nobody is there; the simulated robot tells its truth on `truth_port`."""
        self._truth_port, self._leds_in_b = truth_port, leds_in_b
        self._show: Show | None = None
        self._thread: LightsThread | None = None

    @property
    def is_open(self) -> bool:
        """Whether a screen is there."""
        return self._show is not None

    @property
    def least_height_m(self) -> float:
        """Of a screen that this robot fits."""
        return least_height(self._leds_in_b)

    @property
    def why(self) -> str:
        """What is wrong with what the phone sees of it, in words, or ""."""
        return self._thread.why if self._thread is not None else ""

    @property
    def seen(self) -> GlassSeen | None:
        """What the phone's camera has shown of it; None: nothing yet, or there is none."""
        return self._thread.seen if self._thread is not None else None

    def enter(self, show: Show) -> bool:
        """Take the place; False while another screen has it."""
        if self._show is not None:
            return False
        self._show = show
        return True

    def measure(self, show: Show, glass: ScreenSize) -> None:
        """The glass of who has the place: begin anew."""
        if self._show != show:
            return
        self._end()
        size = window.Glass(1e-3 * glass.width_mm, 1e-3 * glass.height_mm)
        self._thread = LightsThread(self._truth_port, self._leds_in_b, size, show)
        self._thread.start()

    def leave(self, show: Show) -> None:
        """Free the place, if `show` has it."""
        if self._show == show:
            self._show = None
            self._end()

    def add_imu(self, sample: PhoneImu) -> None:
        """The phone has moved."""
        if self._thread is not None:
            self._thread.add(sample)

    def lens_of(self, camera: Camera) -> SimpleLens | None:
        """What a camera that was guessed truly has, once it is measured."""
        return self._thread.lens_of(camera) if self._thread is not None else None

    @property
    def is_shown(self) -> bool:
        """Whether the robot that the phone's camera films is drawn there."""
        return self._thread is not None and self._thread.is_shown

    @property
    def time_offset(self) -> StampOffset | None:
        """Of the stamps of who films it, by the glass; None while it is not sure."""
        return self._thread.time_offset if self._thread is not None else None

    def add_detection(
        self, camera: Camera, is_guessed: bool, luma: Image, detection: Detection
    ) -> None:
        """The phone has seen something; in the vision thread."""
        thread = self._thread
        if thread is not None:
            thread.add(thread.look(camera, is_guessed, luma, detection))

    def _end(self) -> None:
        if self._thread is not None:
            self._thread.stop()
            self._thread = None


class LightsThread:
    """Says 60 times a second what one glass shows, for the phone that was told of."""

    def __init__(self, truth_port: int, leds_in_b: Array, glass: window.Glass, show: Show) -> None:
        """`start` begins."""
        self._truth = TruthClient(truth_port)
        self._robot, self._glass, self._show = RobotOfLight(leds_in_b, glass), glass, show
        self._news: deque[PhoneImu | GlassLook | NewCamera] = deque(maxlen=MAX_NEWS)
        self._camera: Camera | None = None
        self._watch: GlassWatch | None = None
        self._guess, self._t_guess = "", -np.inf
        self.why = ""
        self.time_offset: StampOffset | None = None
        self.is_shown = False
        """See `Screen`; as of the last step."""
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="screen", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End; what is shown then reaches nobody."""
        self._stopped.set()

    def close(self) -> None:
        """Give the socket back; who starts the thread need not."""
        self._truth.close()

    def lens_of(self, camera: Camera) -> SimpleLens | None:
        """What a camera that was guessed truly has, once it is measured."""
        return self._robot.lens_of(camera)

    @property
    def seen(self) -> GlassSeen | None:
        """What the camera that was told of last has shown."""
        return self._robot.seen

    def add(self, news: PhoneImu | GlassLook | NewCamera) -> None:
        """Motion, or a look at the glass; any thread may say it."""
        self._news.append(news)

    def look(
        self, camera: Camera, is_guessed: bool, luma: Image, detection: Detection
    ) -> GlassLook:
        """Look for the glass; in the vision thread."""
        if self._watch is None or camera is not self._camera:
            self._camera, self._watch = camera, GlassWatch(camera, self._glass)
            self.add(NewCamera(camera, is_guessed))
        return self._watch.look(luma, detection)

    def _run(self) -> None:
        due = now()
        try:
            while not self._stopped.is_set():
                try:
                    lights = self.step(now())
                except FollowerError as error:  # the robot's process begins anew
                    log.info("screen: %s", error)
                    lights = self._message(Lights("search", "The robot is away."))
                self._show(lights)
                due = max(due + PERIOD_S, now())
                self._stopped.wait(due - now())
        finally:
            self.close()

    def step(self, t: float) -> ScreenLights:
        """What to show from `t` [s] on.

        Raises:
            FollowerError: the simulated robot does not answer.
        """
        while self._news:
            self._take(self._news.popleft(), t)
        shown = self._robot.step(t, self._ahead)
        self.why, self.time_offset = shown.why, self._robot.time_offset
        self.is_shown = self._robot.is_shown
        if shown.phase == "search" and t - self._t_guess < WHY_S:
            self.why = self._guess
        return self._message(shown)

    def _take(self, news: PhoneImu | GlassLook | NewCamera, t: float) -> None:
        if isinstance(news, PhoneImu):
            self._robot.add_phone_imu(news)
            return
        if isinstance(news, NewCamera):
            self._robot.begin_camera(news.camera, is_guessed=news.is_guessed)
            return
        self._robot.add_corners(news.corners)
        if news.seen is not None:
            self._robot.add_seen(news.seen, news.lights_in_c, t)
        elif news.why:
            self._guess, self._t_guess = news.why, t

    def _ahead(self, seconds: float) -> list[tuple[float, Array, Array]]:
        truth = self._truth.latest(min(seconds, MAX_AHEAD_S))
        return list(zip(truth.t.tolist(), truth.wxyz_fb, truth.p_bf_in_f, strict=True))

    def _message(self, shown: Lights) -> ScreenLights:
        eye, lag = self._robot.eye, self._robot.lag
        distance = -float(eye.p_in_g[0]) if eye is not None else DOT_FROM_M
        places = () if shown.places is None else shown.places
        rows = [np.round(1e3 * row.ravel(), 3).tolist() for row in places]
        return ScreenLights(
            phase=shown.phase,
            why=self.why or shown.why,
            lag_ms=1e3 * lag.value if lag is not None else None,
            t_ms=1e3 * shown.t,
            step_ms=1e3 * STEP_S,
            places_mm=[[x if isfinite(x) else None for x in row] for row in rows],
            dot_mm=1e3 * DOT_M * max(distance, DOT_FROM_M) / DOT_FROM_M,
            sweep_mm=1e3 * SWEEP_SHARE * self._glass.width_m,
        )
