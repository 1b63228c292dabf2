"""One target under atheris (libFuzzer), in this process: `python -m tests.fuzz.child NAME …`."""

import logging
import mmap
import sys
import warnings
from pathlib import Path

import atheris

INSTRUMENTED = [
    "aioice.stun",
    "aiortc.codecs.h264",
    "aiortc.codecs.vpx",
    "aiortc.rtp",
    "aiortc.sdp",
    "hardware.camera_file",
    "hardware.link.control_end",
    "hardware.link.datagram",
    "hardware.link.link_key",
    "hardware.led_file",
    "hardware.led_layout.file",
    "hardware.link.blink_datagram",
    "hardware.link.tool_datagram",
    "hardware.link.robot_end",
    "hardware.robot_file",
    "hardware.robot_schema",
    "hardware.codec",
    "mcap",
    "server.web.app",
    "server.control.ipc",
    "server.phone.decoder",
    "server.phone.ingest",
    "server.protocol.messages",
    "server.replay.setting",
    "server.recording.reader",
    "server.rtc",
    "server.control.ipc_inputs",
    "server.view.viser_proxy",
    "server.protocol.wire",
    "tomllib",
    "yaml",
]
"""Modules whose branches are seen; what is compiled (msgspec, FFmpeg, OpenCV) runs unseen."""


def main() -> None:
    with atheris.instrument_imports(include=INSTRUMENTED):
        from tests.fuzz.planted import PLANTED
        from tests.fuzz.target import CALLS
        from tests.fuzz.targets import TARGETS
    name, *options = sys.argv[1:]
    target = (TARGETS | PLANTED)[name]
    corpus = Path(options[-1])
    for k, data in enumerate([*target.seeds, *(path.read_bytes() for path in target.found())]):
        (corpus / f"seed-{k}").write_bytes(data[: target.max_bytes])
    logging.disable()  # a line for each refusal would be slower than what is fuzzed
    warnings.simplefilter("error", RuntimeWarning)  # as in the tests: NumPy's overflows
    with corpus.with_suffix(CALLS).open("w+b") as file:
        file.truncate(8)
        calls = memoryview(mmap.mmap(file.fileno(), 8)).cast("Q")  # libFuzzer ends without a word

    def check(data: bytes) -> None:
        calls[0] += target.check(data)

    atheris.Setup([sys.argv[0], f"-max_len={target.max_bytes}", *options], check)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
