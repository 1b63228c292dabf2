"""What a server's recording holds after a real Chromium filmed a film of ours.

The page is the real one: camera, encoder, credits and websocket are those of a phone. Only the
camera is a file (`y4m_camera`), and the sensors are at rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import av
import numpy as np
from playwright.sync_api import Page

from hardware.sim.scenes.video import RATE_HZ
from pipeline.signals import Image
from server.experiments.vision.write import camera_text
from server.phone.decoder import FrameDecoder
from server.phone.ingest import EncodedFrame
from server.protocol.wire import decode
from server.protocol.wire_records import Codec, Picture
from server.recording.reader import read
from tests.bench.y4m_camera import number_of, write_y4m
from tests.e2e.chromium_channel import feeling, reading
from tests.e2e.chromium_phone import browser
from tests.e2e.chromium_rig import LANDSCAPE
from tests.e2e.page_scripts import LACKING
from tests.e2e.played_phone import HD_CAMERA
from tests.e2e.serving import Serving, serving

START_S = 4.0
"""From the tap until pictures flow, and the encoder's rate control knows the film."""
KEY_S = 1.0
"""Until the key picture that a recording asks for."""
STREAMING = "Number.parseInt(document.body.innerText.split('Video')[1] ?? '') > 0"


@dataclass(frozen=True, slots=True, eq=False)
class Delivered:
    """A picture as the server decodes it."""

    number: int
    """In the film."""
    luma: Image
    full_range: bool
    key: bool
    bytes: int


@dataclass(frozen=True, slots=True)
class Speed:
    """How fast a film is played, and what the page may send."""

    slower: int
    """Bits a second shrink with the pictures, so that a picture has as many as in real time."""
    bitrate_bps: int
    """In real time."""
    path: str = "WebCodecs"
    """One of `LACKING`."""

    @property
    def rate_hz(self) -> int:
        """Pictures a second."""
        return round(RATE_HZ / self.slower)

    @property
    def options(self) -> list[str]:
        """Of `lightleash serve`."""
        rate, bits = str(self.rate_hz), str(self.bitrate_bps // self.slower)
        return ["--video.frame-rate-hz", rate, "--video.bitrate-bps", bits]


class Studio:
    """A server that films are sent to, one Chromium after the other."""

    def __init__(self, executable: str, server: Serving, folder: Path, speed: Speed) -> None:
        self._executable, self._server, self._speed = executable, server, speed
        self._y4m = folder / "film.y4m"

    def filmed(self, pictures: Sequence[Image]) -> list[Delivered]:
        """One pass of a film from its first picture to its last, as the server got it.

        Raises:
            RuntimeError: no pass came through.
        """
        write_y4m(self._y4m, pictures, self._speed.rate_hz)
        passes = list(_passes(_delivered(self._recorded(len(pictures)))))
        if not passes:
            raise RuntimeError("no picture came through: is the machine too busy?")
        return max(reversed(passes), key=len)  # the first one follows the recording's key picture

    def _recorded(self, count: int) -> Path:
        """The recording of going through the film forwards at least once."""
        seconds = KEY_S + 3.0 * count / self._speed.rate_hz
        with browser(self._executable, camera_file=self._y4m, **LANDSCAPE) as context:
            page = context.new_page()
            for script in LACKING[self._speed.path]:
                page.add_init_script(script)
            _rest(page)
            page.goto(f"{self._server.local_https}/{self._server.link()}")
            page.tap("#start")
            _wait_for_pictures(page)
            page.wait_for_timeout(1e3 * START_S)
            self._server.request("POST", "/api/recording")
            page.wait_for_timeout(1e3 * seconds)
            return Path(str(self._server.request("DELETE", "/api/recording")["path"]))


@contextmanager
def studio(executable: str, speed: Speed) -> Iterator[Studio]:
    """A studio with a server of its own; vision there looks with some calibration."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cameras").mkdir()
        text = camera_text(HD_CAMERA, f"Linux 412x915@1 / {folder / 'film.y4m'}")
        (folder / "cameras" / "film.yaml").write_text(text)
        with serving(folder, "--cameras", str(folder / "cameras"), *speed.options) as server:
            yield Studio(executable, server, folder, speed)


def _wait_for_pictures(page: Page) -> None:
    """Until they are sent.

    Raises:
        RuntimeError: they never are.
    """
    for _ in range(60):
        page.wait_for_timeout(500.0)
        if page.evaluate(STREAMING):
            return
    words = str(page.evaluate("document.body.innerText")).replace("\n", " · ")
    raise RuntimeError(f"no pictures; the page says: {words}")


def _rest(page: Page) -> None:
    """Sensors of a phone that lies still."""
    cdp = page.context.new_cdp_session(page)
    for kind, z in (("accelerometer", 9.8), ("gyroscope", 0.0), ("linear-acceleration", 0.0)):
        cdp.send(*feeling(kind))
        cdp.send(*reading(kind, np.array((0.0, 0.0, z))))


def _delivered(recording: Path) -> Iterator[Delivered]:
    """Every picture that can be decoded, in order."""
    decoder: FrameDecoder | None = None
    colours: av.CodecContext | None = None
    for t, data in read(recording).phone_records():
        record = decode(data)
        picture = record.body
        if not isinstance(picture, Picture):
            continue
        decoder = decoder or FrameDecoder(picture.width, picture.height)
        luma = decoder.decoded(EncodedFrame(t, t, record.sequence, picture))
        if luma is None:
            continue
        name = "h264" if picture.codec is Codec.H264 else "mjpeg"
        colours = colours or av.CodecContext.create(name, "r")
        number = number_of(_chroma(colours, picture.data))
        if number is not None:
            size = len(picture.data)
            yield Delivered(number, luma.copy(), decoder.full_range, picture.key, size)


def _chroma(colours: Any, data: bytes) -> Image:
    plane = colours.decode(av.Packet(data))[-1].planes[1]
    rows = np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)
    return rows[:, : plane.width]


def _passes(pictures: Iterator[Delivered]) -> Iterator[list[Delivered]]:
    """Stretches in which the film ran forwards."""
    stretch: list[Delivered] = []
    for picture in pictures:
        if stretch and picture.number <= stretch[-1].number:
            yield stretch
            stretch = []
        stretch.append(picture)
    yield stretch
