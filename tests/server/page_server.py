"""A small server on the loopback interface, for clients that play a page."""

import json

from msgspec import structs
from websockets.asyncio.server import serve

from server.common.access import Access
from server.protocol.messages import Command, Status, Welcome
from server.protocol.wire import decode, encode
from server.protocol.wire_records import Codec, Credit, Picture, Pong, Record
from server.virtual_phone.phone_client import PhoneClient

WELCOME = Welcome("s1", 1, "ames", 1280, 720, 30, 4_000_000)
JPEG = b"\xff\xd8" + bytes(30)


def status(mode):
    fields = dict.fromkeys(field.name for field in structs.fields(Status) if field.required)
    numbers = dict.fromkeys(("leds", "phones", "supervisors", "time_ms", "thrust_limit_n"), 0)
    texts = dict.fromkeys(
        ("robot", "operator", "video_path", "recording", "realtime", "reason"), ""
    )
    flags = {"ready": True, "saturated": False, "resumes": False, "at_limit": False}
    tables: dict[str, object] = {
        **{name: {} for name in ("streams", "latency_ms", "control", "server", "gaps")},
        **{name: [] for name in ("refusals", "events", "warnings", "people", "thrusts_n")},
        **{name: [] for name in ("sensors_doubted", "thrusters_weak")},
    }
    words = {"mode": mode, "takes": "thrusts"}
    return Status(**fields | numbers | texts | flags | tables | words)


def picture(sequence):
    return Record(sequence, 1, Picture(Codec.JPEG, True, 640, 360, 90, JPEG))


class PageServer:
    """Keeps what it hears; `after_hello` says what it sends on the main socket."""

    def __init__(self, after_hello, credit=True):
        self.after_hello, self.credit = after_hello, credit
        self.heard, self.hellos, self.tokens = [], [], []

    async def __call__(self, socket):
        self.tokens.append(socket.request.headers["Authorization"])
        self.hellos.append(json.loads(await socket.recv()))
        if socket.request.path == "/ws/phone":
            for message in self.after_hello:
                await socket.send(message)
        async for data in socket:
            self.heard.append((socket.request.path, data))
            if socket.request.path == "/ws/video" and self.credit:
                await socket.send(encode(Record(1, 1, Credit(decode(data).sequence))))

    async def serve(self, talk):
        """Run `talk(access)` while this server listens."""
        async with serve(self, "127.0.0.1", 0) as listening:
            port = listening.sockets[0].getsockname()[1]
            return await talk(Access(f"http://127.0.0.1:{port}", "secret"))

    async def session(self, talk):
        """Run `talk(client)` against this server."""

        async def with_client(access):
            client = PhoneClient(access, self.pong, self.request)
            try:
                await talk(client)
            finally:
                await client.close()

        await self.serve(with_client)

    def pong(self, nonce, server_time_us):
        return Record(1, 77, Pong(nonce, server_time_us))

    def request(self, shown):
        return Command("arm") if shown.mode == "DISARMED" else None
