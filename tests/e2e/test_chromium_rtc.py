"""A real Chromium sends by WebRTC, each picture with its record; when that ends, by websocket."""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

from hardware.codec import Decoder
from server.phone.decoder import CODEC_NAMES
from server.protocol.wire import decode
from server.protocol.wire_records import Codec, Picture, Record, Touch
from server.recording.reader import read
from tests.e2e.chromium_phone import browser
from tests.e2e.chromium_rig import LANDSCAPE, calibrate, hearing, telling
from tests.e2e.clock_canvas import clock_canvas, painted_ms
from tests.e2e.page_scripts import KEEP_CONNECTIONS, NO_H264, STREAMS_ONLY
from tests.e2e.serving import Serving, serving

pytestmark = [pytest.mark.e2e, pytest.mark.flight]
FILM_S = 6.0
WIDTH, HEIGHT = 640, 360
FRAME_MS = 1000.0 / 30.0
FAIL = "made.at(-1).close(); made.at(-1).dispatchEvent(new Event('connectionstatechange'))"
LEAVE = "worker.postMessage(told);"
LEFT = "[sequence, performance.timeOrigin + performance.now()]"


@dataclass
class Film:
    """What was recorded of a page that films its clock."""

    records: list[tuple[float, Record]] = field(default_factory=list)
    """With their arrival [s]."""
    left: dict[int, float] = field(default_factory=dict)
    """When a picture left the page's worker [s]."""

    @property
    def pictures(self) -> list[tuple[float, Record, Picture]]:
        return [(t, r, r.body) for t, r in self.records if isinstance(r.body, Picture)]


def path_is(server: Serving, page: Page, beginning: str, seconds: float = 25.0) -> None:
    """Wait until pictures come this way."""
    end = time.monotonic() + seconds
    path = ""
    while time.monotonic() < end:
        path = str(server.request("GET", "/api/status")["video_path"])
        if path.startswith(beginning):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"{path}, not {beginning}")


def becomes(page: Page, condition: str, seconds: float = 20.0) -> None:
    """Wait for a JavaScript expression; Playwright's own way is forbidden by the page's policy."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, condition
        page.wait_for_timeout(50)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    folder = tmp_path_factory.mktemp("rtc")
    with serving(folder, "--cameras", str(calibrate(folder))) as running:
        yield running


@contextlib.contextmanager
def filming(
    chromium: str, server: Serving, *scripts: str, flags: tuple[str, ...] = ()
) -> Iterator[Page]:
    """A page that films its clock, tapped."""
    with browser(chromium, flags=flags, **LANDSCAPE) as context:
        context.route("**/rtc_worker.js", telling(server, "left", LEAVE, LEFT))
        page = context.new_page()
        for script in (clock_canvas(WIDTH), hearing("left"), KEEP_CONNECTIONS, *scripts):
            page.add_init_script(script)
        page.goto(f"{server.local_https}/{server.link()}")
        page.tap("#start")
        yield page


def filmed(server: Serving, page: Page, first: Callable[[], None] = lambda: None) -> Film:
    """Record what is done first, and for a while."""
    server.request("POST", "/api/recording")
    first()
    page.wait_for_timeout(1e3 * FILM_S)
    recorded = Path(str(server.request("DELETE", "/api/recording")["path"]))
    here = time.time() - time.monotonic()
    left = {int(number): 1e-3 * ms - here for number, ms in page.evaluate("left")}
    return Film([(t, decode(data)) for t, data in read(recorded).phone_records()], left)


def each_has_its_own_record(film: Film, codec: Codec) -> None:
    """Every picture that can be decoded was taken when its record says, to less than a picture."""
    decoder, last, checked, late = Decoder(CODEC_NAMES[codec], WIDTH, HEIGHT), None, 0, []
    for _, record, picture in film.pictures:
        assert picture.codec is codec
        follows = last is not None and record.sequence == last + 1
        last = record.sequence if picture.key or follows else None
        if last is None:
            continue
        ms = painted_ms(decoder.decode(picture.data))
        assert ms is not None
        late.append(1e-3 * record.t_us - ms)
        checked += 1
    assert checked >= 5 * FILM_S  # 30 on a quiet machine
    assert min(late) > -0.5 * FRAME_MS  # not the picture before
    assert np.percentile(late, 90) < FRAME_MS  # a starved page paints, and is looked at later
    assert np.median(late) < 0.5 * FRAME_MS


def test_pictures_go_by_webrtc_with_their_records_by_websocket_when_it_ends_and_back(
    chromium: str, server: Serving
) -> None:
    def fail_and_come_back() -> None:
        page.evaluate(FAIL)
        path_is(server, page, "websocket, H264")
        path_is(server, page, "WebRTC, H264")

    with filming(chromium, server) as page:
        path_is(server, page, "WebRTC, H264, dated by record")
        film = filmed(server, page)
        becomes(page, "/^\\d+ ms$/.test(document.querySelector('#h-rtt').innerText)")
        each_has_its_own_record(filmed(server, page, fail_and_come_back), Codec.H264)
        becomes(page, "document.querySelector('#h-path').innerText === 'WebRTC'")
    each_has_its_own_record(film, Codec.H264)
    ways = [
        1e3 * (t - film.left[r.sequence]) for t, r, _ in film.pictures if r.sequence in film.left
    ]
    assert len(ways) >= 0.9 * len(film.pictures)
    assert np.median(ways) <= 10.0  # waiting for the next picture would be 33
    times = [record.t_us for _, record, _ in film.pictures]
    assert all(b > a for a, b in itertools.pairwise(times))
    assert {(p.width, p.height) for *_, p in film.pictures} == {(WIDTH, HEIGHT)}
    assert sum(isinstance(r.body, Touch) for _, r in film.records) >= 10 * FILM_S


def test_vp8_of_a_browser_without_transforms_has_its_records_too(
    chromium: str, server: Serving
) -> None:
    with filming(chromium, server, NO_H264, STREAMS_ONLY) as page:
        path_is(server, page, "WebRTC, VP8, dated by record")
        film = filmed(server, page)
    each_has_its_own_record(film, Codec.VP8)


def test_where_udp_is_blocked_pictures_go_by_websocket(chromium: str, server: Serving) -> None:
    blocked = ("--webrtc-ip-handling-policy=disable_non_proxied_udp",)
    with filming(chromium, server, flags=blocked) as page:
        path_is(server, page, "websocket, H264")
        becomes(page, "made.length > 0 && made.at(-1).connectionState !== 'connected'")
        film = filmed(server, page)
        assert str(server.request("GET", "/api/status")["video_path"]) == "websocket, H264"
        assert page.inner_text("#h-path") == "WebSocket"
    each_has_its_own_record(film, Codec.H264)


def test_a_supervisor_chooses_the_way_and_the_phone_obeys_says_so_and_may_choose_again(
    chromium: str, server: Serving
) -> None:
    with filming(chromium, server) as page:
        path_is(server, page, "WebRTC, H264")
        board = page.context.new_page()
        board.goto(f"{server.http_url}/supervisor{server.link('supervisor')}")
        becomes(board, "!document.querySelector('#path-wish').disabled")
        board.select_option("#path-wish", "WebSocket")
        path_is(server, board, "websocket, H264")
        page.bring_to_front()
        becomes(page, "document.querySelector('#path-by').innerText === 'By supervisor'")
        assert page.evaluate("document.querySelector('#path-wish').value") == "WebSocket"
        page.select_option("#path-wish", "WebRTC")
        path_is(server, page, "WebRTC, H264")
        said = server.request("GET", "/api/status")["path_choice"]
        assert said == {"type": "path", "wish": "WebRTC", "by": "operator"}
