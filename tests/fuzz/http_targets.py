"""Bodies of HTTP requests, through the whole application but its sockets."""

import asyncio
import tempfile
from pathlib import Path

from tests.fuzz.target import target
from tests.server.rtc.rtc_house import RtcHouse

PATHS = (
    "/api/rtc",
    "/api/rtc/answer",
    "/api/pair",
    "/api/people/confirm",
    "/api/people/deny",
    "/api/people/revoke",
    "/api/people/lead",
    "/api/people/keep",
    "/api/stop",
)
FOLDER = tempfile.TemporaryDirectory(prefix="lightleash-fuzz-")
HOUSE: list[RtcHouse] = []
LOOP = asyncio.new_event_loop()


def house() -> RtcHouse:
    """One for all inputs, whose doors count no tries."""
    if not HOUSE:
        HOUSE.append(RtcHouse(Path(FOLDER.name)))
        HOUSE[0].doors.may_try = lambda *_: True
    return HOUSE[0]


async def post(path: str, body: bytes) -> tuple[int, bytes]:
    """(status, answer) of a request with a supervisor's right."""
    one, said = house(), []
    token = one.doors.supervisor_token
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": "POST",
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "root_path": "",
        "headers": [(b"host", b"127.0.0.1"), (b"authorization", f"Bearer {token}".encode())],
        "client": ("127.0.0.1", 5),
        "server": ("127.0.0.1", 8080),
    }

    async def receive():
        return {"type": "http.request", "body": body, "more_body": False}

    async def send(message):
        said.append(message)

    await one.app(scope, receive, send)
    return said[0]["status"], b"".join(m.get("body", b"") for m in said[1:])


def body_seeds():
    yield b'\0{"session": "abc"}'
    yield b'\1{"id": "abc", "sdp": "v=0\\r\\n"}'
    yield b'\2{"token": "abc", "name": "a phone"}'
    yield b'\3{"id": "abc", "code": "ABCD"}'
    yield b'\7{"type": "command", "what": "stop", "age_ms": 5}'
    yield b'\1{"id": "\\u00e4", "sdp": "' + 1000 * b"a" + b'"}'


@target("http_body", body_seeds, max_bytes=4096, mutants=600)
def http_body(data: bytes) -> None:
    """Whatever the body: an answer that says what would be right, and no traceback."""
    path = PATHS[(data or b"\0")[0] % len(PATHS)]
    status, said = LOOP.run_until_complete(post(path, data[1:]))
    assert 200 <= status < 500
    assert len(said) < 2000
