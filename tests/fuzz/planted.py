"""A parser with a bug put into it, to show that it is found. Not among the targets."""

from server.protocol.wire import WireError, decode
from server.protocol.wire_records import Picture
from tests.fuzz.records_targets import record_seeds
from tests.fuzz.target import Target


def _run(data: bytes) -> None:
    body = decode(data).body
    if isinstance(body, Picture) and body.width > 4000 and body.shrunk:
        raise KeyError("planted")


PLANTED = {"planted": Target("planted", _run, record_seeds, (WireError,), 256, 2.0, 20_000)}
