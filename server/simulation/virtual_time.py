"""The whole loop in virtual time: simulated robot, virtual phone, records, vision, control.

The same bytes and the same code as live, without sockets, clocks and threads; as fast as the CPU
allows, and the same for a seed every time. What differs between experiments stands in
`SimulationOptions`: sensors, whether pictures are rendered, whether the phone's clock is known.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hardware.camera_file import find_camera
from hardware.codec import Encoder
from hardware.robot_file import RobotFile
from hardware.sim.hand import Hand, hovering, make_hand
from hardware.sim.led_sensor_model import LedSensorModel
from hardware.sim.phone import EventKind, PhoneClock, PhoneOptions, VirtualPhone
from hardware.sim.plant.plant import PlantOptions
from hardware.sim.reference_trajectory import Pose
from hardware.sim.render import RenderOptions
from hardware.sim.scenes.flown import FlownScene, seen_from
from hardware.sim.scenes.scene import Scene
from hardware.sim.truth import Truth
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from pipeline.camera.extrinsics import IDENTITY, Extrinsics
from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.frames import Array
from pipeline.signals import BodyImu, PhoneImu, TouchState, VisionMeasurement
from pipeline.teleop import Output
from pipeline.timing.clock_synchronisation import ClockSynchronisation
from pipeline.vision.blink_code import NONE, BlinkCode
from pipeline.vision.detection import Detection
from server.control.controller import Controller, never_too_late
from server.control.ipc_inputs import Input, ReadyInput, RequestInput, is_believable
from server.control.process import too_late
from server.control.robot_clock import RobotLink
from server.control.told_body import ToldBody
from server.phone.frame_pipeline import FramePipeline
from server.phone.ingest import EncodedFrame, Ingest
from server.protocol.wire import WireError, decode, encode
from server.protocol.wire_records import Ping, Record, Touch
from server.simulation.line import Kind, Transit
from server.simulation.trace import TrackingEvaluator, TrackingTrace
from server.virtual_phone.phone_script import DEVICE, PhoneScript, VirtualOperator

EVERY_TICKS = {"ping": 10, "touch": 7, "ready": 20, "status": 4}
BESIDE = np.array([0.1, -0.8, 0.0])
"""Where another robot flies [m], in f."""
NETWORK_TICKS = 2
"""10 ms one way for what is small."""


@dataclass(frozen=True, slots=True)
class SimulationOptions:
    """What is simulated."""

    hand: str = "steady"
    seed: int = 0
    latency_s: tuple[float, float] = (0.060, 0.120)
    """Of a picture, from capture to arrival."""
    frame_rate_hz: float = 30.0
    width: int = 1280
    height: int = 720
    gains: str = ""
    """Name of the gain set, if arming is to be refused where its margins say so."""
    codec: str = "h264"
    bitrate_bps: int = 3_000_000
    readout_s: float = 0.0
    """Of the rolling shutter."""
    extrinsics: Extrinsics = IDENTITY
    """How the camera sits beside the phone's motion sensors ..."""
    knows_extrinsics: bool = True
    """... and whether the camera's file says it."""
    hidden: tuple[tuple[float, float, tuple[int, ...]], ...] = ()
    """From when to when [s] which LEDs can't be seen."""
    around: Scene | None = None
    """What stands and shines around the robot, whose body is drawn; None: LEDs, no more."""
    twin: bool = False
    """Another robot of the same kind flies beside, in pictures before an empty wall."""
    twin_code: int | None = None
    """What the LEDs of that one blink; None: they shine."""
    led_error_m: float = 0.0
    """Standard deviation of what the robot file has each LED's place wrong by, each axis [m]."""
    led_noise_px: float | None = None
    """None: pictures are rendered and looked at; else LEDs' rays come with this noise instead."""
    camera: Camera | None = None
    """None: the virtual phone's, as large as said above."""
    knows_camera: bool = True
    """The server has its calibration; else it takes it for a phone's usual one."""
    sensors: PhoneOptions | None = None
    """None: those of a phone with Chromium, with pictures as often and as late as said above."""
    knows_clock: bool = False
    """The phone's clock and each picture's time are known; else PING asks for them."""
    newest_only: bool = False
    """Of pictures that arrive in one period only the newest is looked at."""

    def hidden_at(self, t: float) -> tuple[int, ...]:
        """LEDs that can't be seen at `t` [s]."""
        covered = (leds for since, until, leds in self.hidden if since <= t < until)
        return tuple(sorted({led for leds in covered for led in leds}))


class KnownClock(ClockSynchronisation):
    """Of a phone that need not be asked."""

    ready = True

    def __init__(self, clock: PhoneClock) -> None:
        """As it truly goes."""
        super().__init__()
        self._clock = clock

    def local(self, t_remote: float) -> float:
        """When the phone's clock shows `t_remote` [s], on ours [s]."""
        return (t_remote - self._clock.offset_s) / (1.0 + 1e-6 * self._clock.drift_ppm)


class VirtualTimeSimulation:
    """One flight. `advance` moves everything by one control period."""

    def __init__(
        self,
        robot_file: RobotFile,
        config: TeleopConfig,
        scene: SimulationOptions,
        operator: VirtualOperator | None = None,
        hand: Hand | None = None,
        plant: PlantOptions | None = None,
        follower: VirtualTimeFollower | None = None,
    ) -> None:
        """Everything at rest at time 0.

        The usual `operator` holds the phone, or another, and the scene's `hand` moves it; the
        usual `follower` is the robot behind our own link, or another, which `plant` does not reach.
        """
        self.scene = scene
        self.follower = follower or VirtualTimeFollower(robot_file, scene.seed, options=plant)
        late = too_late(robot_file, scene.gains, config) if scene.gains else never_too_late
        self.controller = Controller(robot_file.robot, config, too_late=late)
        self._evaluator = TrackingEvaluator(config.virtual_camera, robot_file.robot.axes, PERIOD_S)
        self.trace = self._evaluator.trace
        self.lost: set[str] = set()
        """What of the phone does not arrive now: motion, picture, touch."""
        self.transit = Transit()
        """Between phone and server, beyond the usual delays."""
        self.control_every = 1
        """Ticks from one of control's to the next; 0: it stands still."""
        self.tamper: Callable[[list[Input]], list[Input]] = list
        """What becomes of what the server tells control."""
        self.checks_rays = False
        """What LEDs' rays say is held against the motion sensors, as each picture is."""
        self._script = make_script(robot_file, scene, operator, hand)
        self.phone.hidden = self._hidden_at
        self._nonces = np.random.default_rng((scene.seed, 7))
        camera = self.phone.camera
        if not scene.knows_camera:
            camera = SimpleLens().camera(camera.width, camera.height)
        camera = camera if scene.knows_extrinsics else replace(camera, extrinsics=IDENTITY)
        self._frame_pipeline = FramePipeline(camera, robot_file.robot, config.gates)
        self._ingest = self._new_ingest()
        self._vision_model = make_vision_model(robot_file, scene, self._script)
        robot = robot_file.robot
        told = ToldBody.of(robot)
        self._link = RobotLink(self.follower, robot.blinking_leds, told=told)
        self._poses: deque[tuple[float, Array, Array]] = deque(maxlen=120)
        self._dark: deque[int] = deque(maxlen=120)
        """The LED that the robot kept dark with each pose."""
        self._known: Truth | None = None
        """All that, of this tick; None: nobody has asked."""
        self._on_their_way: deque[tuple[int, Record]] = deque()
        self._frames: list[EncodedFrame] = []
        self._inbox: list[Input] = []
        self._output: Output | None = None
        self._ticks = 0

    def _new_ingest(self) -> Ingest:
        ingest = Ingest(lambda: int(self._nonces.integers(1, 2**63)))
        if self.scene.knows_clock:
            ingest.clock = KnownClock(self.phone.clock)
        ingest.extrinsics = self._frame_pipeline.camera.extrinsics
        return ingest

    def change_phone(self) -> None:
        """Begin another phone's session as the server does: disarmed, its clock unknown."""
        self._ingest = self._new_ingest()
        self.request("disarm")

    @property
    def t(self) -> float:
        """Virtual time [s]."""
        return self.follower.t

    @property
    def phone(self) -> VirtualPhone:
        """What the person holds."""
        return self._script.phone

    def truth(self) -> tuple[Pose, Pose]:
        """Poses of camera and body in f."""
        body = self.follower.body
        return self._script.phone.hand.pose(self.t), (body.R_fb, body.p_bf_in_f)

    def run(self, seconds: float) -> TrackingTrace:
        """Fly until `seconds`, or until tracking ends."""
        while self.t < seconds and not self.trace.left:
            self.advance()
        return self.trace

    def request(self, what: str) -> None:
        """A supervisor's request."""
        self._inbox.append(RequestInput(what))

    def advance(self) -> Output:
        """One control period of everything."""
        t_before = self.t
        self.follower.advance(PERIOD_S)
        self._ticks += 1
        robot = self.follower.body
        self._poses.append((self.t, robot.wxyz_fb, robot.p_bf_in_f))
        self._dark.append(self.follower.dark)
        self._known = None
        self._hear_phone(t_before)
        self._hear_small_talk()
        due = self.control_every > 0 and self._ticks % self.control_every == 0
        if due or self._output is None:
            self._output = self._control()
        hand, body = self.truth()
        self._evaluator.look(self.t, body, hand, self._output)
        return self._output

    def _control(self) -> Output:
        """What the control process does in a tick, and what its status leads to."""
        inbox, self._inbox = list(filter(is_believable, self.tamper(self._inbox))), []
        samples = self._link.receive(self.t)
        link = self._link
        command, output = self.controller.tick(
            self.t, inbox, samples, link.reason, link.gap, link.left_s, link.condition
        )
        if self._ticks % EVERY_TICKS["status"] == 0:
            self._frame_pipeline.front_end.add_prediction(self.controller.expected(output))
        self._link.send(command)
        self._link.pass_on(inbox, self.t)
        self._add_imu(*samples)
        request = self._script.operator.see(output.failsafe.mode.name, not output.refusals, self.t)
        if request is not None:
            self._inbox.append(RequestInput(request.what))
        return output

    def _robot_at(self, t: float) -> tuple[Array, Array]:
        return self._truth().at(t)

    def _hidden_at(self, t: float) -> tuple[int, ...]:
        dark = self._truth().dark_at(t)
        return self.scene.hidden_at(t) + ((dark,) if dark != NONE else ())

    def _truth(self) -> Truth:
        if self._known is None:
            times, wxyz, p = zip(*self._poses, strict=True)
            dark = np.array(self._dark, dtype=np.int8)
            self._known = Truth(np.array(times), np.array(wxyz), np.array(p), np.zeros(0), dark)
        return self._known

    def _hear_phone(self, t_before: float) -> None:
        """Sensors and pictures that arrive within this period."""
        events = [
            event
            for event in self.phone.events(t_before, self.t)
            if event.t_capture >= PERIOD_S and event.kind.value not in self.lost
        ]
        pictures = [event for event in events if event.kind == EventKind.PICTURE]
        for event in events:
            if event.kind == EventKind.MOTION:
                motion = self._script.motion(event.t_capture)
                self.transit.send(self.t, "motion", partial(self._take, motion))
            elif self._vision_model is None:
                key = self._frame_pipeline.needs_key
                picture = self._script.picture(event.t_capture, self._robot_at, key)
                self.transit.send(self.t, "picture", partial(self._take, picture))
            elif event is pictures[-1] or not self.scene.newest_only:
                self._glimpse(self._vision_model, event.t_capture)
        self.transit.deliver(self.t)
        self._see()

    def _hear_small_talk(self) -> None:
        """PING there and PONG back, TOUCH, and the server's readiness, each at its rate."""
        if self._ticks % EVERY_TICKS["ping"] == 0:
            self._send_later(self._ingest.ping(self.t))
        if self._ticks % EVERY_TICKS["touch"] == 0:
            self._send_later(self._script.touch(self.t))
        if self._ticks % EVERY_TICKS["ready"] == 0:
            lacks = [] if self._ingest.clock.ready else ["The phone's clock is not known yet."]
            complaint = self._frame_pipeline.front_end.complaint
            self._inbox.append(ReadyInput(lacks + [complaint] * (complaint != "")))
        while self._on_their_way and self._on_their_way[0][0] <= self._ticks:
            _, record = self._on_their_way.popleft()
            if isinstance(record.body, Ping):
                self.transit.send(self.t, "ping", partial(self._answer, record.body, record.t_us))
            elif "touch" not in self.lost:
                kind: Kind = "touch" if isinstance(record.body, Touch) else "pong"
                self.transit.send(self.t, kind, partial(self._take, record))
        self.transit.deliver(self.t)

    def _answer(self, ping: Ping, t_us: int) -> None:
        """The page answers at once."""
        self._send_later(self._script.pong(ping.nonce, t_us, self.t))

    def _send_later(self, record: Record) -> None:
        self._on_their_way.append((self._ticks + NETWORK_TICKS, record))

    def _take(self, record: Record) -> None:
        """What the server does with a record: the bytes, not the object, go on."""
        try:
            signal = self._ingest.record(decode(encode(record)), self.t)
        except WireError:  # a live server hangs up: of this phone there is no news
            self.transit.lost += 1
            return
        match signal:
            case PhoneImu() as sample:
                self._add_imu(sample)
                self._inbox.append(sample)
            case TouchState() as operator:
                self._inbox.append(operator)
            case EncodedFrame() as frame:
                self._frames.append(frame)
                if not self.scene.newest_only:
                    self._see()

    def _see(self) -> None:
        """Decode all frames that have come, and look at the newest."""
        frames, self._frames = self._frames, []
        if not frames:
            return
        detection = self._frame_pipeline.see(frames)
        if self._frame_pipeline.blink_request is not None:
            self._inbox.append(self._frame_pipeline.blink_request)
        self.trace.pictures += 1
        self.trace.leds.append(len(detection.rays) if detection is not None else 0)
        self._send(detection.seen(self._frame_pipeline.camera) if detection is not None else None)
        if detection is not None:
            self._look_further(detection)

    def _look_further(self, detection: Detection) -> None:
        """What else the server does with a picture: nothing."""

    def _glimpse(self, eye: LedSensorModel, t: float) -> None:
        """A picture of which only the LEDs' rays exist; dated as others are."""
        clock, phone = self._ingest.clock, self._script.phone
        if not clock.ready:
            return
        stamp = clock.local(phone.clock.at(phone.dated(t)))
        stamp += self._frame_pipeline.camera.extrinsics.time_offset_s
        seen = eye.seen(t, stamp, self._robot_at)
        self.trace.pictures += 1
        self.trace.leds.append(len(seen.rays) if seen is not None else 0)
        self.transit.send(self.t, "picture", partial(self._held, seen))

    def _held(self, seen: VisionMeasurement | None) -> None:
        if seen is not None and self.checks_rays:
            seen = self._frame_pipeline.front_end.check.believed(seen)
        self._send(seen)

    def _send(self, seen: VisionMeasurement | None) -> None:
        if seen is not None:
            self.trace.poses += seen.pose is not None
            self._inbox.append(seen)

    def _add_imu(self, *samples: PhoneImu | BodyImu) -> None:
        """Motion samples, for whoever looks."""
        for sample in samples if self.checks_rays else ():
            self._frame_pipeline.front_end.check.add_imu(sample)
        if self._vision_model is None:
            self._frame_pipeline.front_end.add_imu(*samples)
        elif not self.scene.knows_clock:
            for sample in samples:
                self._vision_model.add_imu(sample)


def make_vision_model(
    robot_file: RobotFile, scene: SimulationOptions, script: PhoneScript
) -> LedSensorModel | None:
    """What stands for pictures and vision in a scene without them."""
    if scene.led_noise_px is None:
        return None
    rng, robot = np.random.default_rng((scene.seed, 11)), robot_file.robot
    return LedSensorModel(
        script.phone,
        robot.leds_in_b,
        scene.led_noise_px,
        scene.hidden_at,
        rng,
        is_told=robot.motion is not None,
    )


def make_script(
    robot_file: RobotFile,
    scene: SimulationOptions,
    operator: VirtualOperator | None = None,
    hand: Hand | None = None,
) -> PhoneScript:
    """The virtual phone of a scene, with its page and its holder."""
    usual = PhoneOptions(frame_rate_hz=scene.frame_rate_hz, picture_delay_s=scene.latency_s)
    sensors, camera = scene.sensors or usual, scene.camera
    if camera is None:
        camera = find_camera(DEVICE, scene.width, scene.height)
        camera = replace(camera, readout_s=scene.readout_s, extrinsics=scene.extrinsics)
    start, around = robot_file.start, scene.around
    if around is not None:
        camera, start = seen_from(around, scene.seed, camera, start)
    leds_in_b, placing = robot_file.robot.leds_in_b, np.random.default_rng((scene.seed, 17))
    phone = VirtualPhone(
        camera,
        hand or make_hand(scene.hand, seed=scene.seed, start=start),
        leds_in_b + scene.led_error_m * placing.standard_normal(leds_in_b.shape),
        RenderOptions(),
        np.random.default_rng((scene.seed, 3)),
        sensors,
        twin_hidden=_twin_hidden(robot_file, scene),
        twin=hovering(np.random.default_rng((scene.seed, 13)), BESIDE, np.zeros(3)).pose
        if scene.twin
        else None,
    )
    if around is not None:
        phone.films = FlownScene(around, scene.seed, robot_file, phone).film
    size = camera.width, camera.height
    encoder = Encoder(*size, sensors.frame_rate_hz, scene.bitrate_bps, scene.codec)
    return PhoneScript(phone, encoder, operator or VirtualOperator())


def _twin_hidden(robot_file: RobotFile, scene: SimulationOptions) -> Callable[[float], list[int]]:
    """LEDs of the twin that are dark at a time [s]."""
    if scene.twin_code is None:
        return lambda _: []
    code, leds = BlinkCode(scene.twin_code, 0.0), len(robot_file.robot.leds_in_b)
    return lambda t: [led for led in (code.dark(t, leds),) if led != NONE]
