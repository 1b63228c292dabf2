"""Shells around `Session` and `SessionManager`: one coroutine reads a page, one writes to it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import Awaitable

from msgspec import structs
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from server.common.clock import now
from server.common.runtime_parameters import Tune
from server.common.settings import VideoSettings
from server.phone.phone_session import PhoneSession
from server.protocol.calibration_messages import Calibrate
from server.protocol.lead_messages import Lead, UseTool
from server.protocol.messages import (
    Command,
    FromPage,
    Hello,
    Log,
    Refused,
    Welcome,
    encode_message,
)
from server.protocol.screen_messages import ClockAnswer, ClockAsk, ScreenLights, ScreenSize
from server.protocol.session import Session
from server.protocol.video_path_messages import PathChoice
from server.protocol.wire import VERSION, WireError
from server.protocol.wire_records import Picture, Record
from server.security.pairings import Member
from server.web.session_manager import SessionManager

log = logging.getLogger("lightleash")

PING_S = 1.0 / 60.0
"""The operator's age is that of the newest PING answered, so one lost packet must be little of what
control bears; and a phone's radio falls asleep after some 75 ms in which nothing comes."""
MAX_UNSENT = 16
"""Of one page; a page that does not read loses the oldest."""
HELLO_S = 5.0
BUSY = WireError(
    "role", "hello.role", "one phone at a time: another one leads, or has left the robot in flight"
)


class Connection:
    """A page at the other end of a websocket."""

    def __init__(self, socket: WebSocket) -> None:
        """Begin before it is accepted."""
        self._socket = socket
        self._unsent: deque[str | bytes] = deque(maxlen=MAX_UNSENT)
        self._newest: bytes | None = None
        self._news = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    def send(self, data: str | bytes) -> None:
        """Send when possible."""
        self._unsent.append(data)
        self._news.set()

    def send_newest(self, data: bytes) -> None:
        """Send when possible, in place of what was pushed so and still waits."""
        self._newest = data
        self._news.set()

    def refuse(self, error: WireError, fatal: bool = False) -> None:
        """Tell the page what was not taken."""
        refused = Refused(error.code, error.field, error.allowed, fatal)
        self.send(encode_message(refused))

    def show(self, lights: ScreenLights) -> None:
        """Send a screen what it shows; any thread may call it."""
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self.send, encode_message(lights))

    async def write(self) -> None:
        """Send what is pushed, until cancelled."""
        while True:
            await self._news.wait()
            self._news.clear()
            while (data := self._next()) is not None:
                if isinstance(data, bytes):
                    await self._socket.send_bytes(data)
                else:
                    await self._socket.send_text(data)

    def _next(self) -> str | bytes | None:
        """What is sent next: a sign of life is not kept waiting by the rest."""
        data, self._newest = self._newest, None
        if data is None and self._unsent:
            return self._unsent.popleft()
        return data

    async def read(self) -> str | bytes:
        """The next thing the page says.

        Raises:
            WebSocketDisconnect: it has gone.
        """
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1000))
        data = message.get("bytes")
        return data if data is not None else str(message.get("text", ""))

    async def close(self, code: int = 1000) -> None:
        """Send the last words and close."""
        while self._unsent and self._socket.application_state == WebSocketState.CONNECTED:
            data = self._unsent.popleft()
            await (
                self._socket.send_bytes(data)
                if isinstance(data, bytes)
                else self._socket.send_text(data)
            )
        if self._socket.application_state == WebSocketState.CONNECTED:
            await self._socket.close(code)


class PageServer:
    """Serves the four kinds of socket."""

    def __init__(self, manager: SessionManager, video: VideoSettings, name: str = "") -> None:
        """Serve the pages of one robot; `name` is the server's."""
        self._manager, self._video, self._name = manager, video, name

    async def phone(self, socket: WebSocket) -> None:
        """`/ws/phone`: an operator."""
        await self._serve(socket, "operator")

    async def video(self, socket: WebSocket) -> None:
        """`/ws/video`: an operator's pictures."""
        await self._serve(socket, "video")

    async def supervisor(self, socket: WebSocket) -> None:
        """`/ws/supervisor`: someone who watches."""
        await self._serve(socket, "supervisor")

    async def screen(self, socket: WebSocket) -> None:
        """`/ws/screen`: shows a simulated robot's light; may request nothing."""
        await self._serve(socket, "screen")

    async def _serve(self, socket: WebSocket, role: str) -> None:
        await socket.accept()
        member: Member = socket.scope["member"]
        looks_only = role == "supervisor" and member.role != "supervisor"
        page, session = Connection(socket), Session(role, looks_only)
        phone: PhoneSession | None = None
        writer = asyncio.create_task(page.write())
        pinger: asyncio.Task[None] | None = None
        try:
            phone = await self._greet(page, session, member)
            if role == "operator":
                pinger = asyncio.create_task(self._ping(phone))
            while not session.hopeless:
                await self._listen(page, session, phone, member)
        except WireError as error:
            log.warning("a page as %s is refused: %s", role, error)
            page.refuse(error, fatal=True)
        except (WebSocketDisconnect, RuntimeError, TimeoutError):
            pass  # it has gone, or never said hello
        finally:
            for task in (writer, pinger):
                if task is not None:
                    task.cancel()
            self._manager.supervisors.discard(page)
            if role == "screen" and (screen := self._manager.screen) is not None:
                screen.leave(page.show)
            if role == "operator" and phone is not None:
                self._manager.disconnect_phone(phone)
            await _quietly(page.close(1008 if session.hopeless or session.hello is None else 1000))

    async def _greet(
        self, page: Connection, session: Session, member: Member
    ) -> PhoneSession | None:
        """Hear hello, answer welcome, take the place; raises WireError if there is none."""
        hello = session.receive(await asyncio.wait_for(page.read(), HELLO_S), now())
        if not isinstance(hello, Hello):
            raise WireError("order", "message", "hello first")
        phone: PhoneSession | None = None
        if session.role == "operator":
            phone = self._manager.connect_phone(hello, page, member)
            if phone is None:
                raise BUSY
        elif session.role == "video":
            phone = self._manager.join_video(hello.session, page)
            if phone is None:
                raise WireError("role", "hello.session", "the session of the phone that leads")
        elif session.role == "screen":
            self._enter(page)
        else:
            self._manager.supervisors.add(page)
        video, screen = self._video, self._manager.screen
        page.send(
            encode_message(
                Welcome(
                    session=phone.id if phone is not None else "",
                    version=VERSION,
                    robot=self._manager.robot.name,
                    width=video.width,
                    height=video.height,
                    frame_rate_hz=video.frame_rate_hz,
                    bitrate_bps=video.bitrate_bps,
                    you=member.id,
                    distance_m=self._manager.distance_m,
                    screen_height_m=screen.least_height_m if screen is not None else None,
                    name=self._name,
                )
            )
        )
        return phone

    def _enter(self, page: Connection) -> None:
        """Let a screen show the robot; raises WireError if there is nothing to show, or no room."""
        screen = self._manager.screen
        if screen is None:
            raise WireError("role", "hello.role", "a simulated robot: a real one has its own LEDs")
        if not screen.enter(page.show):
            raise WireError("role", "hello.role", "one screen at a time: another one is open")
        self._manager.log_event("A screen shows the robot.", of="screen")

    async def _listen(
        self, page: Connection, session: Session, phone: PhoneSession | None, member: Member
    ) -> None:
        """Take one thing the page says; a fault is answered and costs nobody else anything.

        Raises:
            WireError: another phone has taken the lead.
        """
        data = await page.read()
        t = now()
        if phone is not None and self._manager.phone is not phone:
            raise BUSY
        try:
            said = session.receive(data, t)
            if phone is not None and self._is_straggler(said):
                return
            if phone is not None:
                self._manager.record(data, t)
            if isinstance(said, Record) and phone is not None:
                phone.take(said, t)
            elif isinstance(said, Command):
                self._manager.request(said, member)
            elif isinstance(said, Calibrate) and phone is not None:
                self._manager.calibrate(said)
            elif isinstance(said, Tune):
                self._manager.people.note("tune", member)
                self._manager.tune(said)
            elif isinstance(said, Lead):
                self._manager.lead(said, member)
            elif isinstance(said, UseTool):
                self._manager.use_tool(said)
            elif isinstance(said, PathChoice):
                self._choose(said, phone)
            elif isinstance(said, ScreenSize) and (screen := self._manager.screen) is not None:
                screen.measure(page.show, said)
            elif isinstance(said, ClockAsk):
                page.send(encode_message(ClockAnswer(said.page_ms, 1e3 * t)))
            elif isinstance(said, Log):
                self._manager.log_event(f"page: {said.text}", of=f"page of {member.name}")
        except WireError as error:
            if error.code in ("role", "age"):
                self._manager.people.note("refusal", member, str(error))
            page.refuse(error, fatal=session.hopeless)

    def _choose(self, choice: PathChoice, phone: PhoneSession | None) -> None:
        """Hand a supervisor's choice on to the page, which obeys and says so; hear what it says.

        Raises:
            WireError: no phone leads, or its page lets nobody choose.
        """
        if phone is None:
            leading = self._manager.phone
            if leading is None or leading.path_choice is None:
                raise WireError("order", "path.wish", "while a phone leads that has several ways")
            self._manager.paths.send(encode_message(structs.replace(choice, by="supervisor")))
            return
        if choice.by and choice != phone.path_choice:
            way = "the best way" if choice.wish == "auto" else choice.wish
            self._manager.log_event(f"pictures by {way}: chosen by the {choice.by}", of="pictures")
        phone.path_choice = choice

    def _is_straggler(self, said: FromPage | Record) -> bool:
        """A picture that was on its way when the phone went over to its fast path."""
        if not isinstance(said, Record) or not isinstance(said.body, Picture):
            return False
        if not self._manager.paths.takes_from_socket(said.t_us, said.sequence, said.body.key):
            return True
        if self._manager.phone is not None:
            self._manager.phone.video_path = f"websocket, {said.body.codec.name}"
        return False

    async def _ping(self, phone: PhoneSession | None) -> None:
        t = now()
        while phone is not None and self._manager.phone is phone:
            self._manager.ping()
            t = max(t + PING_S, now())  # what was missed is not made up for
            await asyncio.sleep(t - now())


async def _quietly(closing: Awaitable[None]) -> None:
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):
        await closing
