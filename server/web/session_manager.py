"""Where all meets: the operator's phone, pages that watch, control, recordings, events."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import asdict

from hardware.codec import Decoder
from pipeline.control.leading import suits
from pipeline.robot import Robot
from pipeline.signals import Mode
from server.common.clock import now, unix_zero_ns
from server.common.runtime_parameters import Tune
from server.control.ipc import ControlStatus, server_end
from server.control.ipc_inputs import Input, ReadyInput, RequestInput, ToolInput
from server.control.robot_health import HealthFields
from server.diagnostics.blame import Blame
from server.diagnostics.events import Events
from server.diagnostics.load import Load
from server.diagnostics.meter import Meter
from server.diagnostics.pauses import Pauses
from server.diagnostics.tally import Tally
from server.media.decoding import Decoding
from server.phone.calibration_control import CalibrationControl
from server.phone.client_connection import ClientConnection
from server.phone.phone_session import PhoneSession
from server.phone.screen_door import ScreenDoor
from server.phone.transports import FastTransport, Transports
from server.phone.vision_thread import Picture, jpeg
from server.protocol.calibration_messages import Calibrate
from server.protocol.lead_messages import AS_EVER, Lead, UseTool
from server.protocol.messages import Command, Hello, LoggedEvent, Status, ToPage, encode_message
from server.protocol.people_messages import Deed
from server.protocol.wire import WireError, encode
from server.protocol.wire_records import Record, Thumbnail
from server.recording.control import Recordings
from server.recording.episodes import LARGEST_PRESS
from server.security.pairings import Member, of_this_machine
from server.security.security import Doors
from server.web.handover import Handover
from server.web.people import People
from server.web.status import build

log = logging.getLogger("lightleash")

INSIST_S, INSISTS = 0.01, 100
"""How often and how many times a STOP is sent to a control process that can't take it."""
TICK_S = 0.1
AT_REST = ("DISARMED", "STOPPED", "LOST")
GROUNDED = (Mode.DISARMED, Mode.ARMED, Mode.STOPPED)
PROGRAM = of_this_machine("operator")


class SessionManager:
    """One robot, at most one operator, any number of supervisors."""

    def __init__(
        self,
        runtime: Path,
        robot: Robot,
        cameras: list[Path],
        recordings: Recordings,
        profiles: Path | None = None,
        doors: Doors | None = None,
        decoding: Decoding | None = None,
        screen: ScreenDoor | None = None,
        distance_m: float = 2.0,
    ) -> None:
        """Listens to control in `runtime`; `profiles` is where new calibrations go.

        Without `decoding` pictures are decoded in this process; a `screen` can show a simulated
        robot; the robot is filmed from `distance_m`.
        """
        self.distance_m = distance_m
        self.robot, self.recordings, self.screen = robot, recordings, screen
        self._cameras, self._profiles, self.decoding = cameras, profiles, decoding
        self.paths = Transports(lambda data: recordings.record("server", data, now()))
        self._calibration = CalibrationControl(self.paths.send)
        self._control = server_end(runtime)
        self.people = People(doors or Doors(), self._keep_deed)
        self.handover = Handover(self)
        self.phone: PhoneSession | None = None
        self.supervisors: set[ClientConnection] = set()
        self.status: ControlStatus | None = None
        self.control_meter = Meter()
        self._events, self.tally = Events(1e-9 * unix_zero_ns()), Tally()
        self._last_mode = self._last_complaint = ""
        self._last_health = HealthFields()
        self._unfit: set[str] = set()
        self._shown: Status | None = None
        self.last_thumbnail: Picture | None = None
        """What the phone saw, for the 3D view."""
        self.blame, self.load = Blame(), Load()
        self.pauses = Pauses(on_stall=self.blame.stalled)
        self.unready = ""
        """What the server itself has against arming."""

    async def run(self) -> None:
        """Serve until cancelled."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._control.fileno(), self._receive_status)
        watching = [asyncio.create_task(one.watch()) for one in (self.pauses, self.load)]
        try:
            while True:
                await asyncio.sleep(TICK_S)
                self._tick()
                await self.handover.expire()
        finally:
            for task in watching:
                task.cancel()
            self.pauses.close()
            loop.remove_reader(self._control.fileno())
            if self.phone is not None:
                self.phone.close()
            self.recordings.stop()
            self._control.close()

    def to_control(self, message: Input) -> None:
        """Hand something to the control process."""
        self._control.send(message)

    @property
    def events(self) -> Sequence[LoggedEvent]:
        """What people should see, newest first."""
        return self._events.shown

    def log_event(self, text: str, of: str = "") -> None:
        """An event that people should see, and the log keep; see `Events.add`."""
        if said := self._events.add(text, now(), of):
            log.info("%s", said)

    def _keep_deed(self, deed: Deed) -> None:
        self.recordings.message("server", encode_message(deed), now())

    def request(self, command: Command, who: Member) -> None:
        """A person's request, already checked for its role."""
        if command.what == "key_frame":
            return
        lacks = self.status.refusals if command.what == "arm" and self.status is not None else ()
        self.people.note(command.what, who, f"refused: {'; '.join(lacks)}"[:300] if lacks else "")
        self.log_event(said := f"{who.name}: {command.what}", of=said)
        self._ask(RequestInput(command.what), INSISTS * (command.what in ("stop", "disarm")))

    def tune(self, request: Tune) -> None:
        """Send a supervisor's runtime parameters of the virtual camera to control."""
        knobs = {name: value for name, value in asdict(request).items() if value is not None}
        if not knobs:
            return
        text = "virtual camera: " + ", ".join(f"{name} {value}" for name, value in knobs.items())
        if self._control.send(request):
            self.log_event(f"supervisor: {text}", of="virtual camera")
        else:
            self.log_event(f"{text} did not reach the control process: try again.")

    def lead(self, request: Lead, who: Member) -> None:
        """Send control how the next press is to lead.

        Raises:
            WireError: this robot can't be led so.
        """
        if not suits(request.leading, self.robot):
            field = "scale" if request.scale != 1.0 else "axes"
            allowed = "1" if field == "scale" else "all or shift"
            raise WireError("value", f"lead.{field}", f"{allowed}: this robot hangs from nothing")
        text = f"from the next press: {request.scale:g} times as far, {request.axes}"
        if self._control.send(request):
            self.people.note("leading", who, text)
            self.log_event(f"{who.name}: {text}", of="leading")
        else:
            self.log_event(f"{text} did not reach the control process: try again.")

    def use_tool(self, request: UseTool) -> None:
        """Open or close the robot's tool, for the hand that leads.

        Raises:
            WireError: it has none.
        """
        if not self.robot.tool:
            raise WireError("value", "tool", "none: this robot has no tool")
        pressed = self.phone.pressed if self.phone is not None else None
        if pressed is not None and pressed.press & LARGEST_PRESS == request.press:
            self._control.send(ToolInput(request.opening))

    def calibrate(self, request: Calibrate) -> None:
        """Let the operator's phone begin its camera's calibration, or leave it."""
        if (phone := self.phone) is not None:
            self._calibration.request(phone, request, self.status)
            self.log_event(
                f"{phone.device}: calibration, {request.what}", of=f"{phone.device}: calibration"
            )

    def _ask(self, request: RequestInput, insists: int) -> None:
        """Nobody may be there, or the queue may be full: what stops the robot is said again."""
        if self._control.send(request):
            return
        if insists > 0:
            asyncio.get_running_loop().call_later(INSIST_S, self._ask, request, insists - 1)
        else:
            self.log_event(f"{request.what} did not reach the control process: try again.")

    def connect_phone(
        self, hello: Hello, page: ClientConnection, who: Member = PROGRAM
    ) -> PhoneSession | None:
        """Give the lease to a phone of `who`; None while another one has it, or shall have it.

        A robot that somebody else has left in flight comes down first: None until it has.
        """
        current = self.phone
        silent_s = current.silent_for(now()) if current is not None else None
        if not self.people.lease.is_free_for(who.id, silent_s, now()):
            return None
        if self.is_flying() and self.people.lease.is_of_another(who.id):
            self.people.note("take-over", who, "the robot comes down first")
            self.log_event(f"{who.name} leads once the robot is down.")
            self.disarm()
            return None
        if current is not None:
            self.people.note("take-over", who, "the phone that led was silent")
            self.disconnect_phone(current)
        soon: Callable[..., Any] = asyncio.get_running_loop().call_soon_threadsafe
        self.phone = PhoneSession(
            hello,
            self.robot,
            self._cameras,
            self.to_control,
            now,
            on_taken=partial(soon, self.paths.taken),
            on_key_wanted=partial(soon, self.paths.want_key),
            profiles=self._profiles,
            make_decoder=self.decoding.open if self.decoding is not None else Decoder,
            screen=self.screen,
        )
        self.paths.begin(page)
        self.recordings.message("phone", encode_message(hello), now())
        self.disarm()  # never go on with another hand
        if self.people.lease.is_of_another(who.id):
            self.to_control(AS_EVER)
        self.people.lease.take(who.id)
        self.people.note("lead", who, self.phone.device)
        self.log_event(f"{who.name} leads: {self.phone.device}.")
        return self.phone

    def is_flying(self) -> bool:
        """Whether the robot may be in the air, as far as is known."""
        return self.status is None or Mode(self.status.mode) not in GROUNDED

    def disarm(self) -> None:
        """Bring the robot down, whoever leads."""
        self._ask(RequestInput("disarm"), INSISTS)

    def join_video(self, session: str, page: ClientConnection) -> PhoneSession | None:
        """The video socket of the phone that has the lease; None for anyone else."""
        if (phone := self._leading(session)) is not None:
            self.paths.join_video(page)
        return phone

    def join_fast(self, session: str, fast: FastTransport) -> PhoneSession | None:
        """A fast path of the phone that has the lease; None for anyone else."""
        if (phone := self._leading(session)) is not None:
            self.paths.use(fast)
        return phone

    def _leading(self, session: str) -> PhoneSession | None:
        return self.phone if self.phone is not None and self.phone.id == session else None

    def disconnect_phone(self, phone: PhoneSession) -> None:
        """A phone has gone."""
        if self.phone is phone:
            self.phone = None
            self.paths.close()
            self.people.note("leave", self.people.named(self.people.lease.holder), phone.device)
            self.people.lease.free()
            self.log_event(f"{phone.device} has left.")
            phone.close()

    def start_recording(self) -> str:
        """Begin to record, with what a replay must know of the phone that leads; gives the name.

        Raises:
            RecordingError: the file can't be made.
        """
        phone = self.phone
        if phone is None:
            return self.recordings.start()
        name = self.recordings.start(phone.device, phone.camera_text)
        self.recordings.message("phone", encode_message(phone.hello), now())
        self._ask_key()
        return name

    def record(self, data: str | bytes | Record, t: float) -> None:
        """Keep what the leading phone said, if a recording runs."""
        if isinstance(data, Record):
            if self.recordings.name:
                self.recordings.record("phone", encode(data), t)
        elif isinstance(data, bytes):
            self.recordings.record("phone", data, t)
        else:
            self.recordings.message("phone", data, t)

    def _ask_key(self) -> None:
        """Pictures recorded before the next key are of no use."""
        if self.recordings.key_is_due(now()):
            self.paths.want_key()

    def ping(self) -> None:
        """Ask the phone for a sign of life."""
        if self.phone is not None:
            self.paths.ping(encode(self.phone.ping(now())))

    def _receive_status(self) -> None:
        for status in self._control.statuses():
            self.status = status
            self.control_meter.tick(now(), status.t)
            self.recordings.status(status, now())
            if (phone := self.phone) is not None:
                self.recordings.learn(phone.device, phone.camera_text)
                phone.add_status(status)
                if (sight := phone.sight(status, now())) is not None:
                    self.paths.send(encode_message(sight))

    def refusals(self) -> list[str]:
        """What the server has against arming."""
        if self.unready:
            return [self.unready]
        if self.phone is None:
            return ["No phone is connected: scan the code, or start the virtual phone."]
        return self.phone.refusals(now(), self.load.words)

    def _tick(self) -> None:
        self.to_control(ReadyInput(self.refusals()))
        self.handover.make_room(now())
        for said in self._events.count_up(now()):
            log.info("%s", said)
        status = build(self)
        if status.mode != self._last_mode:
            self.log_event(f"{status.mode}: {status.reason}")
            self.people.note("mode", why=f"{status.mode}: {status.reason}")
            self._last_mode = status.mode
        complaint = status.camera.complaint if status.camera is not None else ""
        if complaint not in ("", self._last_complaint):
            self.log_event(complaint)
        self._last_complaint = complaint
        unfit = {*status.thrusters_weak, *status.sensors_doubted}
        if self.status is not None and self.status.gains_weak:
            unfit.add(self.status.gains_weak)
        for said in unfit - self._unfit:
            self.log_event(said)
        self._unfit = unfit
        self._log_health(self.status.health if self.status is not None else None)
        self._shown = status
        self.tally.see(status)
        if paused := self.pauses.tick(status.mode not in AT_REST, idle=self.phone is None):
            self.log_event(paused)
        if self.decoding is not None and (ended := self.decoding.news(now())):
            self.log_event(ended)
        count, gone = self.recordings.folder.removed()
        if gone:
            self.tally.removed(count)
            self.log_event(gone)
        if self.recordings.end_if_failed():
            self.log_event(f"The recording has ended: {self.recordings.failure}.")
        self.broadcast(status)
        self._show_picture()
        self._ask_key()
        self._calibration.send(self.phone, self.status)

    def _log_health(self, health: HealthFields | None) -> None:
        """A battery or an emergency stop that has changed, once, whatever the voltage."""
        said = health or HealthFields()
        for now_is, was, words in (
            (said.battery, self._last_health.battery, said.battery_words),
            (said.e_stop, self._last_health.e_stop, said.e_stop_words),
        ):
            if now_is != was and words:
                self.log_event(words)
        self._last_health = said

    def broadcast(self, message: ToPage) -> None:
        """To every page."""
        text = encode_message(message)
        self.recordings.message("server", text, now())
        for page in self.supervisors:
            page.send(text)
        self.paths.send(text)

    def _show_picture(self) -> None:
        picture = self.phone.thumbnail(bool(self.supervisors)) if self.phone is not None else None
        if picture is None:
            return
        self.last_thumbnail = picture
        data = encode(Record(0, int(1e6 * now()), Thumbnail(jpeg(picture))))
        for page in self.supervisors:
            page.send(data)

    def snapshot(self) -> bytes:
        """The last status as JSON, for people with a terminal."""
        return msgspec.json.encode(self._shown)
