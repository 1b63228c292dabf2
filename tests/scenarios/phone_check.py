"""A virtual phone before a virtual screen, checked as a live server checks one, in virtual time."""

from __future__ import annotations

from math import inf

import numpy as np

from hardware.robot_file import load_robot
from pipeline.camera.lens import Camera
from pipeline.config import TeleopConfig
from pipeline.frames import Array
from pipeline.signals import BodyImu, PhoneImu
from pipeline.vision.detection import Detection
from server.control.process import teleop_config
from server.diagnostics import camera_health
from server.diagnostics.link_log import LinkLog
from server.diagnostics.phone_check.phone_watch import ClockFacts, PhoneFacts, PhoneWatch, look_of
from server.diagnostics.phone_check.report import CheckAnswer, answer_of
from server.phone.frame_pipeline import FramePipeline
from server.phone.sensor_check import SensorCheck
from server.protocol.wire_records import Motion, Picture, Ping, Pong, Record
from server.simulation.screen import Display, ScreenSimulation
from server.simulation.virtual_time import SimulationOptions

SCREEN = load_robot("screen")
CONFIG = teleop_config(SCREEN, "phone", TeleopConfig().virtual_camera, "relative")


class CheckedScreen(ScreenSimulation):
    """Which tells a `PhoneWatch` what a phone's session does."""

    def __init__(
        self,
        scene: SimulationOptions,
        *,
        lose_every: int = 0,
        dot_noise_m: float = 0.0,
        stored: Camera | None = None,
    ) -> None:
        """Each so many pictures one is lost, dots are shown so far beside their places, and the
        calibration that the server has is another camera's."""
        self._heard = LinkLog(0.0, kept_s=inf)
        self._checked = PhoneWatch(self._heard)
        self._sensors = SensorCheck()
        self._lose_every, self._sent_pictures = lose_every, 0
        self._dot_noise_m, self._rng = dot_noise_m, np.random.default_rng((scene.seed, 17))
        super().__init__(SCREEN, CONFIG, scene, Display())
        if stored is not None:
            self._frame_pipeline = FramePipeline(stored, SCREEN.robot, CONFIG.gates)
            self._begin_camera(stored, is_guessed=False)

    def answer(self) -> CheckAnswer:
        """What its page is told."""
        pipeline = self._frame_pipeline
        facts = PhoneFacts(
            device="A virtual phone",
            since=0.0,
            clock=ClockFacts.of(self._ingest.clock),
            axes=self._sensors.axes,
            camera=pipeline.camera,
            is_calibrated=self.scene.knows_camera,
            health=camera_health.health(pipeline.front_end),
            complaints=tuple(filter(None, [pipeline.front_end.complaint])),
            glass=self.robot_of_light.seen,
        )
        return answer_of(self._checked.series(self.t, inf, facts))

    def _drawn(self) -> Array:
        dots = super()._drawn()
        beside: Array = self._dot_noise_m * self._rng.normal(size=dots.shape)
        return dots + beside if len(dots) > 1 else dots  # the sweep is a clock

    def _send_later(self, record: Record) -> None:
        if isinstance(record.body, Ping):
            self._heard.asked(1e-6 * record.t_us)
        super()._send_later(record)

    def _take(self, record: Record) -> None:
        if isinstance(record.body, Picture):
            self._sent_pictures += 1
            if self._lose_every and self._sent_pictures % self._lose_every == 0:
                return
        super()._take(record)
        if isinstance(record.body, Pong):
            self._heard.came("answers", 1e-6 * record.body.server_time_us, self.t)
        if isinstance(record.body, Motion) and self._ingest.clock.ready:
            t = self._ingest.clock.local(1e-6 * record.t_us)
            self._sensors.add_imu(t, record.body)

    def _add_imu(self, *samples: PhoneImu | BodyImu) -> None:
        super()._add_imu(*samples)
        for sample in samples:
            if isinstance(sample, PhoneImu):
                self._heard.came("motion", sample.t, self.t)
                self._checked.add_motion(sample)

    def _see(self) -> None:
        for frame in self._frames:
            self._heard.came("pictures", frame.t, frame.t_received)
            self._checked.add_picture(frame.t, frame.t_received, frame.picture)
        super()._see()
        self._checked.count(self._frame_pipeline.undecodable)

    def _look_further(self, detection: Detection) -> None:
        camera = self._frame_pipeline.camera
        if not detection.comes_again:
            self._checked.add_look(look_of(detection, camera, SCREEN.robot.leds_in_b))
            self._sensors.add_detection(detection)
        super()._look_further(detection)
