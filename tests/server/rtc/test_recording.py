"""What came by WebRTC is recorded as it came, and a replay decodes it to the same pictures."""

import asyncio
import contextlib
import hashlib
from pathlib import Path
from types import SimpleNamespace

import pytest

from server.phone.decoder import FrameDecoder
from server.protocol.wire import decode
from server.protocol.wire_records import Picture
from server.recording.reader import read
from server.replay.offline import run_offline
from server.virtual_phone.phone_client import PhoneClient
from server.virtual_phone.phone_script import DEVICE
from tests.server.house import eventually
from tests.server.rtc.rtc_house import FRAME_S, rtc_house_in

pytestmark = [pytest.mark.e2e, pytest.mark.page]


@pytest.fixture(autouse=True)
def loopback_only(monkeypatch):
    monkeypatch.setattr("aioice.ice.get_host_addresses", lambda **_: ["127.0.0.1"])


@pytest.fixture
def decoded(monkeypatch):
    """What was decoded: a digest of the luma by the digest of the encoded bytes and their date."""
    kept, decode_one = {}, FrameDecoder.decoded

    def noting(self, frame):
        luma = decode_one(self, frame)
        if luma is not None:
            kept[frame.sequence, digest(frame.picture.data)] = digest(luma.tobytes())
        return luma

    monkeypatch.setattr(FrameDecoder, "decoded", noting)
    return kept


def digest(data):
    return hashlib.sha1(data).hexdigest()


def record(folder, play, **options):
    """Record while `play` sends; gives the recording."""
    with rtc_house_in(folder) as house:

        async def run():
            async with house.open(), house.phone(**options) as page:
                await page.synchronised()
                await play(house, page)
                path = house.manager.recordings.stop()
                await eventually(lambda: not house.manager.phone.vision._waiting)
                return path

        return read(Path(asyncio.run(run())))


def pictures(recording):
    records = [decode(data) for _, data in recording.phone_records()]
    return [one for one in records if isinstance(one.body, Picture)]


def replayed(recording, decoded, folder):
    """What a replay decodes, and its bytes; `decoded` is empty afterwards."""
    decoded.clear()
    out = folder / "out.csv"
    run_offline(recording, out)
    again = dict(decoded)
    decoded.clear()
    return again, out.read_bytes()


@pytest.mark.parametrize("codec", ["h264", "vp8"])
def test_a_recording_begun_in_the_middle_replays_to_the_same_pictures(codec, tmp_path, decoded):
    async def play(house, page):
        await page.film(10)
        house.manager.start_recording()
        for k in range(11, 41):
            await page.picture(k)
            await asyncio.sleep(FRAME_S)
        await eventually(lambda: any(number == 40 for number, _ in decoded))

    recording = record(tmp_path, play, codec=codec)
    live = dict(decoded)
    kept = pictures(recording)
    first_key = next(one.sequence for one in kept if one.body.key)
    assert 10 < kept[0].sequence <= first_key < 40  # asked for, not waited for
    again, text = replayed(recording, decoded, tmp_path)
    assert {number for number, _ in again} == {n.sequence for n in kept if n.sequence >= first_key}
    seen = {key: luma for key, luma in live.items() if key[0] >= first_key}
    assert len(seen) >= 10
    assert seen.items() <= again.items()  # all, unless the machine was too busy to look at each
    assert replayed(recording, decoded, tmp_path) == (again, text)


async def change_to_websocket(house, page):
    """As a page does whose connection has ended: the next picture there is a key."""
    client = page.client
    page.running.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await page.running
    house.signalling._gone(house.signalling._link)
    await PhoneClient._open_video(client, DEVICE, SimpleNamespace(session=house.manager.phone.id))
    client.key_wanted = True
    client.send = PhoneClient.send.__get__(client)


def test_a_change_of_path_within_a_recording_replays_to_the_same_pictures(tmp_path, decoded):
    async def play(house, page):
        house.manager.start_recording()
        await page.film(15)
        await eventually(lambda: any(number == 15 for number, _ in decoded))
        await change_to_websocket(house, page)
        await page.film(12)  # counts from 1 again, as the page does
        await eventually(lambda: len([1 for number, _ in decoded if number == 12]) == 2)

    recording = record(tmp_path, play)
    live = dict(decoded)
    numbers = [one.sequence for one in pictures(recording)]
    assert numbers[-12:] == list(range(1, 13))
    again, _ = replayed(recording, decoded, tmp_path)
    assert live.items() <= again.items()
    assert len(live) >= 20
