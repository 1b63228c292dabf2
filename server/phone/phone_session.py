"""Phone session: one operator's phone, its clock, stream and vision, and what it still lacks."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Sequence
from functools import partial
from math import inf
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hardware.camera_file import CameraFileError
from hardware.codec import Decoder
from pipeline.camera.extrinsics import IDENTITY
from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.estimation.sensor_doubts import PHONES
from pipeline.robot import Robot
from pipeline.signals import PhoneImu, TouchState
from pipeline.vision.detection import Detection
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from server.control.ipc import ControlStatus, body_imus, expected_of
from server.control.ipc_inputs import Input
from server.diagnostics import camera_health
from server.diagnostics.link_log import LinkLog
from server.diagnostics.meter import Meter
from server.diagnostics.phone_check.phone_watch import (
    ClockFacts,
    PhoneFacts,
    PhoneSeries,
    PhoneWatch,
    look_of,
)
from server.media.decoding import MakeDecoder
from server.media.image_format import ImageFormat
from server.phone.calibration_session import CalibrationSession
from server.phone.frame_pipeline import FramePipeline
from server.phone.ingest import EncodedFrame, Ingest
from server.phone.screen_door import ScreenDoor
from server.phone.sensor_check import SensorCheck
from server.phone.sight import SIGHT_S, sight
from server.phone.vision_thread import VisionThread
from server.protocol.calibration_messages import Calibrate, Calibration
from server.protocol.messages import VIRTUAL_DEVICE, Hello
from server.protocol.sight_messages import Sight
from server.protocol.video_path_messages import PathChoice
from server.protocol.wire import WireError
from server.protocol.wire_records import Motion, Picture, Pong, Record

STALE_S = 1.0
"""A stream silent for longer keeps the robot from being armed."""


class PhoneSession:
    """Session of one phone, from hello to goodbye."""

    def __init__(
        self,
        hello: Hello,
        robot: Robot,
        cameras: list[Path],
        to_control: Callable[[Input], object],
        clock: Callable[[], float],
        on_taken: Callable[[int], None],
        on_key_wanted: Callable[[], None],
        profiles: Path | None = None,
        make_decoder: MakeDecoder = Decoder,
        screen: ScreenDoor | None = None,
    ) -> None:
        """`to_control` may be called from the vision thread too; calibrations go to `profiles`.

        `make_decoder` says where pictures are decoded, by itself here; `screen` is what it may film
        in place of a robot.
        """
        self.id = secrets.token_urlsafe(12)
        self.device, self.hello = hello.device or "a phone", hello
        self.ingest = Ingest(lambda: 1 + secrets.randbits(63))
        self._robot, self._cameras = robot, cameras
        self._to_control, self._clock = to_control, clock
        self._greeted = clock()
        self._on_taken, self._on_key_wanted = on_taken, on_key_wanted
        self.vision: VisionThread | None = None
        self._eyes_before: tuple[str, VisualFrontEnd] | None = None
        """The last that were closed, with the camera file that they saw by."""
        self._shape: ImageFormat | None = None
        self._axes: int | None = None
        """In which motion comes; see `PhoneImu.phone`."""
        self._profiles, self._make_decoder = profiles, make_decoder
        self._screen = screen
        self.wizard: CalibrationSession | None = None
        """The camera's calibration, while one is under way."""
        self.video_path = ""
        """How the pictures come, in words."""
        self.path_choice: PathChoice | None = None
        self.camera_problem = self.camera_text = ""
        self._lens: SimpleLens | None = None
        """Of a camera without a calibration, once a screen has measured it."""
        self._guessed: Camera | None = None
        """The camera in use, as long as its lens is only guessed."""
        self.meters = {name: Meter() for name in ("operator", "phone_imu", "video", "pose")}
        self.detection: Detection | None = None
        self._t_sight = -inf
        self.latency_ms: dict[str, float] = {}
        self._check = SensorCheck()
        self.link = LinkLog(clock())
        """What came when, lately."""
        self.pressed: TouchState | None = None
        """The newest word of a finger that holds."""
        self._watch = PhoneWatch(self.link)
        self._doubts: Sequence[str] = ()
        """What control says against motion sensors."""

    def silent_for(self, now: float) -> float:
        """Time since its last sign of life [s]; hello was the first."""
        return min(self.meters["operator"].age(now), now - self._greeted)

    def ping(self, now: float) -> Record:
        """The next PING, to be sent at `now` [s]."""
        record = self.ingest.ping(now)
        self.link.asked(1e-6 * record.t_us)
        return record

    def take(self, record: Record, now: float) -> None:
        """A record of this phone, from either of its sockets.

        Raises:
            WireError: not believable, or a picture without a calibration.
        """
        match self.ingest.record(record, now):
            case PhoneImu() as sample if isinstance(record.body, Motion):
                if sample.phone != self._axes:  # eyes that know motion in others look anew
                    self._axes, self._shape = sample.phone, None
                self.meters["phone_imu"].tick(now, sample.t)
                self.link.came("motion", sample.t, now)
                self._watch.add_motion(sample)
                self._to_control(sample)
                self._check.add_imu(sample.t, record.body)
                if self._screen is not None:
                    self._screen.add_imu(sample)
                if self.wizard is not None:
                    self.wizard.add_imu(sample)
                if self.vision is not None:
                    self.vision.front_end.add_imu(sample)
                    self.vision.front_end.doubts_gravity = self._check.doubts_gravity
                    if self._screen is not None and self._screen.is_shown:
                        self.vision.front_end.films_glass(self._screen.time_offset)
            case TouchState() as operator:
                self.meters["operator"].tick(now, operator.t)
                self.pressed = operator if operator.held else self.pressed
                self._to_control(operator)
            case EncodedFrame() as frame:
                self._see(frame, now)
            case None if isinstance(record.body, Pong):
                self.link.came("answers", 1e-6 * record.body.server_time_us, now)
            case None if isinstance(record.body, Picture):  # it can't be dated yet
                self._on_taken(record.sequence)

    def want_key(self) -> None:
        """Ask for a picture that can be decoded alone."""
        self._on_key_wanted()

    def add_status(self, status: ControlStatus) -> None:
        """What control says of the robot, for eyes and tests."""
        self._check.add_status(status)
        self._doubts = status.estimate.doubts if status.estimate is not None else ()
        if self.vision is not None:
            front_end = self.vision.front_end
            front_end.add_prediction(expected_of(status))
            front_end.add_imu(*body_imus(status.body_samples, status.body_twists))

    def sight(self, status: ControlStatus, now: float) -> Sight | None:
        """Where things are in its picture; None if it does not look, or knows since a moment."""
        if self.vision is None or now < self._t_sight + SIGHT_S:
            return None
        self._t_sight = now
        camera = self.vision.front_end.camera
        return sight(camera, self._robot.leds_in_b, self.detection, status, now)

    def _see(self, frame: EncodedFrame, now: float) -> None:
        self.meters["video"].tick(now, frame.t)
        self.link.came("pictures", frame.t, now)
        self._watch.add_picture(frame.t, now, frame.picture)
        self._watch.count(self.vision.undecodable if self.vision is not None else 0)
        shape = ImageFormat.of(frame.picture)
        may_guess = self.camera_problem != "" and self.wizard is None and self._films_screen
        if self._guessed is not None and self._screen is not None:
            self._lens = self._screen.lens_of(self._guessed)
        is_measured = self._guessed is not None and self._lens is not None
        if shape != self._shape or may_guess or is_measured:
            self._open_eyes(shape)
        if self.wizard is not None:
            self.wizard.offer(frame)
            return
        if self.vision is None:
            self._on_taken(frame.sequence)
            raise WireError("calibration", "frame", self.camera_problem)
        self.vision.offer(frame)

    @property
    def _films_screen(self) -> bool:
        """Whether there is a screen in place of a robot."""
        return self._screen is not None and self._screen.is_open

    def _open_eyes(self, shape: ImageFormat) -> None:
        """Begin to look, or begin again at another size or angle: that is another camera."""
        is_calibrating = self.wizard is not None and self.wizard.stored is None
        self.close()
        self._shape, self._guessed = shape, None
        self.camera_problem = self.camera_text = ""
        if is_calibrating and not shape.shrunk:
            self._calibrate(shape)
            return
        try:
            path, camera = shape.camera(self.device, self._cameras)
            self.camera_text = path.read_text(encoding="utf-8")
        except CameraFileError as error:
            if not self._films_screen:
                self.camera_problem = str(error)
                return
            # enough for a robot that is only light, and its screen measures what is guessed
            lens = self._lens or SimpleLens()
            camera = shape.guessed(lens)
            self._guessed = camera if self._lens is None else None
        self.ingest.extrinsics = camera.extrinsics
        frame_pipeline = FramePipeline(
            camera, self._robot, GatesConfig(), self._clock, self._make_decoder
        )
        if self._eyes_before is not None and self._eyes_before[0] == self.camera_text != "":
            frame_pipeline.front_end.go_on_from(self._eyes_before[1])
        screen, is_guessed = self._screen, self._guessed is not None
        self.vision = VisionThread(
            frame_pipeline,
            partial(self._on_detection, frame_pipeline),
            self._on_taken,
            self._on_key_wanted,
            partial(screen.add_detection, camera, is_guessed) if screen is not None else None,
        )

    def _on_detection(self, eye: FramePipeline, detection: Detection, frame: EncodedFrame) -> None:
        """In the vision thread: hand on what was seen, and what the robot is to blink."""
        if eye.blink_request is not None:
            self._to_control(eye.blink_request)
        self._sighted(eye.camera, detection, frame)

    def _sighted(self, camera: Camera, detection: Detection, frame: EncodedFrame) -> None:
        """In the vision thread: hand on what was seen, remember where the time went."""
        if detection.comes_again:
            return
        now = self._clock()
        seen = detection.seen(camera)
        if seen is not None:
            self._to_control(seen)
        if detection.pose is not None:
            self.meters["pose"].tick(now, detection.t)
        took = {name: 1e3 * s for name, s in detection.took_s.items()}
        self.latency_ms = {
            "capture to arrival": 1e3 * (frame.t_received - detection.t),
            "waiting": 1e3 * (now - frame.t_received) - sum(took.values()),
            **took,
        }
        self._check.add_detection(detection)
        self._watch.add_look(look_of(detection, camera, self._robot.leds_in_b))
        self.detection = detection

    def series(self, now: float, seconds: float) -> PhoneSeries:
        """What its check is made of: its last `seconds`, as far as they are kept."""
        vision = self.vision
        complaint = vision.front_end.complaint if vision is not None else self.camera_problem
        doubts = (words for words in self._doubts if words.startswith(PHONES))
        facts = PhoneFacts(
            device=self.device,
            since=self._greeted,
            clock=ClockFacts.of(self.ingest.clock),
            axes=self._check.axes,
            camera=vision.front_end.camera if vision is not None else None,
            is_calibrated=self.camera_text != "",
            health=camera_health.health(vision.front_end) if vision is not None else None,
            complaints=tuple(filter(None, (*self._check.faults(), complaint, *doubts))),
            glass=self._screen.seen if self._screen is not None else None,
        )
        return self._watch.series(now, seconds, facts)

    def thumbnail(self, wanted: bool) -> npt.NDArray[np.uint8] | None:
        """The next small picture (h, w, 3) RGB of what the camera sees, if anyone `wanted` it."""
        if self.vision is None:
            return None
        self.vision.watched = wanted
        picture, self.vision.thumbnail = self.vision.thumbnail, None
        return picture if wanted else None

    def refusals(self, now: float, busy: str = "") -> list[str]:
        """Refusals: what this phone still lacks, in words for the person who can mend it.

        `busy` is said in place of what a busy computer of the server may have kept from coming.
        """
        clock = self.ingest.clock
        if not clock.ready:
            reason = clock.reason or "The phone's clock is not known yet."
            return [f"{reason} Wait a moment.", *([busy] if busy else [])]
        why: list[str] = []
        faults: list[str] = []
        if not self.ingest.visible:
            why.append("The page on the phone is hidden: bring it to the front.")
        if self.meters["phone_imu"].age(now) > STALE_S:
            fact, do = "The phone's motion sensors are silent", "allow them in the browser"
            why += self._silent(self.meters["phone_imu"].age(now), fact, do, busy)
        else:
            faults = self._check.faults()
            why += faults
        if self.wizard is not None:
            why.append("The camera is being calibrated.")
        elif self.camera_problem:
            why.append(f"The camera is not calibrated: {self.camera_problem}.")
        elif self.meters["video"].age(now) > STALE_S:
            fact, do = "No pictures from the phone", "allow the camera in the browser"
            why += self._silent(self.meters["video"].age(now), fact, do, busy)
        elif self.vision is not None and self.vision.failed:
            why.append(self.vision.failed)
        elif self.meters["pose"].age(now) > STALE_S and not faults:
            why += self._not_seen(now, busy)
        if not faults and self.vision is not None and self.vision.front_end.complaint:
            why.append(self.vision.front_end.complaint)
        return list(dict.fromkeys(why))

    def _silent(self, age_s: float, fact: str, do: str, busy: str) -> list[str]:
        """Why a stream is silent, and what to `do` about it if that is a person's to mend.

        What ever came has its permission, and a virtual phone needs none.
        """
        if self.device == VIRTUAL_DEVICE:
            return [busy or f"{fact}: wait a moment."]
        if busy and age_s < inf:
            return [busy]
        return [f"{fact}: {do}.", *([busy] if busy else [])]

    def _not_seen(self, now: float, busy: str) -> list[str]:
        """Why there is no pose, though there are pictures."""
        if busy and (self.detection is None or now - self.detection.t > STALE_S):
            return [busy]
        if self._screen is not None and self._screen.why:  # it does not show the robot yet
            return [self._screen.why]
        found = self.detection.reason if self.detection is not None else ""
        return [f"The robot is not seen. {found}".strip()]

    def calibrate(self, request: Calibrate) -> None:
        """Begin to calibrate the camera that films now, or leave that and look again.

        Raises:
            WireError: there is no picture yet.
        """
        if request.what == "start" and (self._shape is None or self._profiles is None):
            raise WireError("order", "calibrate.what", "when pictures come")
        if request.what == "start" and self._shape is not None and self._shape.shrunk:
            raise WireError("order", "calibrate.what", "when pictures have the camera's own size")
        self.close()
        if request.what == "start" and self._shape is not None:
            self._calibrate(self._shape)
        else:
            # the next picture opens eyes, with what may have been stored, or says what is wrong
            self._shape, self.camera_problem = None, ""

    def _calibrate(self, shape: ImageFormat) -> None:
        """Begin, or begin again in another orientation."""
        assert self._profiles is not None
        size = (shape.width, shape.height, shape.screen_angle_deg)
        callbacks = self._on_taken, self._on_key_wanted
        self.wizard = CalibrationSession(
            self.device, size, self._profiles, *callbacks, self._make_decoder
        )

    def calibration(self) -> Calibration:
        """State of the calibration for the page."""
        if self.wizard is not None:
            return self.wizard.state()
        return Calibration("needed" if self.camera_problem else "off")

    def close(self) -> None:
        """Stop looking; who calibrates wants motion as it comes."""
        self.ingest.extrinsics = IDENTITY
        if self.wizard is not None:
            self.wizard.stop()
            self.wizard = None
        if self.vision is not None:
            self._eyes_before = self.camera_text, self.vision.front_end
            self.vision.stop()
            self.vision = None
