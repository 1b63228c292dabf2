"""Pictures and records by WebRTC on real sockets: all of them, as they were sent."""

import asyncio
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hardware.codec import Decoder
from pipeline.signals import PhoneImu, TouchState
from server.common.clock import now
from server.protocol.wire import decode
from server.protocol.wire_records import Motion, Picture, Touch
from server.recording.reader import read
from server.rtc.receiving import metadata_trailer
from server.rtc.receiving.metadata_trailer import split
from server.virtual_phone.touches import NEWEST_TOUCH_US
from tests.server.house import eventually
from tests.server.rtc.rtc_house import ATTITUDES, FRAME_S, rtc_house_in

pytestmark = [pytest.mark.e2e, pytest.mark.page]
PICTURES = 45


@pytest.fixture(autouse=True)
def loopback_only(monkeypatch):
    monkeypatch.setattr("aioice.ice.get_host_addresses", lambda **_: ["127.0.0.1"])


def in_house(folder, play, **options):
    with rtc_house_in(folder) as house:

        async def run():
            async with house.open(), house.phone(**options) as page:
                await page.synchronised()
                house.taken, house.said = [], []  # type: ignore[attr-defined]
                listen(house)
                await play(house, page)

        asyncio.run(run())


def listen(house):
    """Note what reaches the phone at the server."""
    take = house.manager.phone.take

    def noting(record, t):
        house.taken.append((record, t))
        take(record, t)

    house.manager.phone.take = noting


def pictures(house):
    return [plain(record) for record, _ in house.taken if isinstance(record.body, Picture)]


def plain(record):
    """With start codes of one length: packets hold none, so their length is the receiver's."""
    data = record.body.data.replace(b"\0\0\0\1", b"\0\0\1")
    return replace(record, body=replace(record.body, data=data))


def sent(page):
    return [plain(record) for record in page.sent]


@pytest.mark.parametrize("codec", ["h264", "vp8"])
def test_every_picture_comes_with_its_own_record(codec, tmp_path, monkeypatch):
    attitudes = []

    def noting(data):
        plain, record = split(data)
        attitudes.append(record.orientation_wxyz)
        return plain, record

    monkeypatch.setattr(metadata_trailer, "split", noting)

    async def play(house, page):
        await page.film(PICTURES)
        await eventually(lambda: len(pictures(house)) == PICTURES)
        assert pictures(house) == sent(page)  # sequence, time, size, angle and every encoded byte
        expected = [ATTITUDES[k % len(ATTITUDES)] for k in range(1, PICTURES + 1)]
        np.testing.assert_allclose(attitudes, expected, atol=1e-4)
        assert house.manager.phone.video_path == f"WebRTC, {codec.upper()}, dated by record"
        assert house.signalling._link.peer.lost == 0
        came = [t for record, t in house.taken if isinstance(record.body, Picture)]
        way = [t + 1000.0 - 1e-6 * record.t_us for t, record in zip(came, page.sent, strict=True)]
        assert np.median(way) < 0.5 * FRAME_S  # it has not waited for the next picture

    in_house(tmp_path, play, codec=codec)


def test_motion_and_touch_come_by_the_data_channel_and_reach_control(tmp_path):
    async def play(house, page):
        swallow(page.client._sockets[0])
        await page.film(10)
        for sequence in range(1, 6):
            await page.touch(sequence, held=sequence > 2)
        motions = list(range(1, 11))
        await eventually(
            lambda: [r.sequence for r, _ in house.taken if isinstance(r.body, Motion)] == motions
        )
        heard = await house.control_hears(lambda one: isinstance(one, TouchState) and one.held)
        assert any(isinstance(one, PhoneImu) for one in heard)
        assert house.manager.phone.ingest.clock.ready
        assert house.manager.phone.ingest.clock.offset == pytest.approx(1000.0, abs=0.05)

    in_house(tmp_path, play)


def swallow(socket):
    """From now on nothing gets through."""

    async def nothing(_):
        return None

    socket.send = nothing


@pytest.mark.parametrize("dead", ["channel", "websocket"])
def test_whichever_way_dies_without_a_word_the_finger_is_felt_by_the_other(dead, tmp_path):
    async def play(house, page):
        if dead == "channel":
            page.client._channel.send = house.signalling._link.peer._channel.send = lambda _: None
        else:
            swallow(page.client._sockets[0])
            house.manager.paths._operator.send = lambda _: None
        pongs = page.pongs
        await eventually(lambda: page.pongs >= pongs + 3)
        for sequence, held in ((1, False), (2, True)):
            await page.touch(sequence, held)
        heard = await house.control_hears(lambda one: isinstance(one, TouchState) and one.held)
        touches = [one for one in heard if isinstance(one, TouchState)]
        felt = [one.held for one in touches]
        assert sorted(felt) == felt  # said again with a PING, but never in another order
        assert set(felt) == {False, True}
        age = now() - touches[-1].t
        assert house.manager.phone.silent_for(now()) <= age + 0.01

    in_house(tmp_path, play)


def test_the_newest_touch_comes_back_with_each_ping_of_the_fast_path(tmp_path):
    async def play(house, page):
        swallow(page.client._sockets[0])
        await page.touch(1, held=True)
        await eventually(lambda: sum(isinstance(r.body, Touch) for r, _ in house.taken) >= 4)
        touches = [r for r, _ in house.taken if isinstance(r.body, Touch)]
        assert len({r.body.nonce for r in touches}) == len(touches)
        assert [r.sequence for r in touches] == list(range(1, len(touches) + 1))
        assert all(r.body.held and r.body.press == 1 for r in touches)
        assert touches[-1].t_us - touches[0].t_us <= NEWEST_TOUCH_US  # then the page may hang
        count, pongs = len(touches), page.pongs
        await eventually(lambda: page.pongs > pongs + 20)
        assert sum(isinstance(r.body, Touch) for r, _ in house.taken) <= count + 6

    in_house(tmp_path, play)


@pytest.mark.parametrize(("source", "limit_s"), [("pair", 2e-5), ("arrival", 0.25)])
def test_without_records_pictures_are_dated_by_pairs_or_by_their_arrival(source, limit_s, tmp_path):
    async def play(house, page):
        await page.film(PICTURES)
        await eventually(lambda: len(pictures(house)) == PICTURES)
        bodies = [record.body for record in pictures(house)]
        assert [replace(body, by_arrival=False) for body in bodies] == [r.body for r in sent(page)]
        assert all(body.by_arrival == (source == "arrival") for body in bodies[5:])
        late = [
            1e-6 * (came.t_us - taken.t_us)
            for came, taken in zip(pictures(house)[5:], page.sent[5:], strict=True)
        ]
        assert max(np.abs(late)) < limit_s
        assert source in house.manager.phone.video_path

    in_house(tmp_path, play, dated_by=source)


def lose(page, is_lost):
    """Lose packets of pictures on their way: `is_lost(how many so far, is it sent again)`."""
    sender, count = page.client._sender, 0
    transport, again = sender.transport, sender._RTCRtpSender__rtx_payload_type
    send = transport._send_rtp

    async def losing(data):
        nonlocal count
        count += 1
        if not is_lost(count, data[1] & 0x7F == again):
            await send(data)

    transport._send_rtp = losing


def test_lost_packets_are_sent_again_and_no_picture_is_missing(tmp_path):
    async def play(house, page):
        lose(page, lambda n, _: n % 6 == 0)
        await page.film(PICTURES)
        await eventually(lambda: len(pictures(house)) >= PICTURES - 3)  # the last hole has no end
        assert pictures(house) == sent(page)[: len(pictures(house))]

    in_house(tmp_path, play)


def test_after_a_blackout_only_whole_pictures_come_and_they_begin_with_a_key(tmp_path):
    async def play(house, page):
        dark = False
        lose(page, lambda _, again: dark or again)
        for k in range(1, 61):
            dark = 20 <= k < 26
            await page.picture(k)
            await asyncio.sleep(1 / 30)
        await eventually(lambda: pictures(house) and pictures(house)[-1].sequence == 60)
        came = pictures(house)
        numbers = [record.sequence for record in came]
        after = next(i for i, number in enumerate(numbers) if number >= 20)
        assert came[after].body.key
        assert numbers[after] <= 45  # asked for, not waited for until the encoder's own
        decoder = Decoder("h264", 1280, 720)
        for record in came[after:]:
            decoder.decode(record.body.data)

    in_house(tmp_path, play)


def test_the_recording_has_the_encoded_pictures_as_they_came(tmp_path):
    async def play(house, page):
        house.manager.start_recording()
        await page.film(10)
        await eventually(lambda: len(pictures(house)) == 10)
        path = house.manager.recordings.stop()
        kept = [decode(data) for _, data in read(Path(path)).phone_records()]
        assert [plain(r) for r in kept if isinstance(r.body, Picture)] == sent(page)

    in_house(tmp_path, play)


def test_a_phone_that_leaves_and_one_that_calls_again_leave_no_connection_behind(tmp_path):
    async def play(house, page):
        first = house.signalling._link
        answer = await house.post("/api/rtc", {"session": house.manager.phone.id})
        assert answer.status_code == 200
        assert first.is_closing
        await asyncio.wait_for(asyncio.gather(page.running, return_exceptions=True), 5.0)
        second = house.signalling._link
        assert second is not first
        house.manager.disconnect_phone(house.manager.phone)
        refused = await house.post("/api/rtc/answer", {"id": second.id, "sdp": "v=0"})
        assert refused.status_code in (400, 404)
        await eventually(lambda: second.is_closing)

    in_house(tmp_path, play)


def test_a_second_answer_is_read_refused_and_costs_the_connection_nothing(tmp_path):
    async def play(house, page):
        link = house.signalling._link
        answer = page.client._connection.localDescription.sdp
        for sdp, field in (
            ("Once upon a time", "sdp"),
            (answer.replace("a=setup:", "a=setup:not"), "sdp.setup"),
            (answer, "sdp"),
        ):
            refused = await house.post("/api/rtc/answer", {"id": link.id, "sdp": sdp})
            assert (refused.status_code, refused.json()["field"]) == (400, field)
        assert not link.is_closing
        await page.film(PICTURES)
        await eventually(lambda: pictures(house) == sent(page))

    in_house(tmp_path, play)


def test_a_first_answer_that_is_none_withdraws_the_offer(tmp_path):
    async def play(house, page):
        offer = await house.post("/api/rtc", {"session": house.manager.phone.id})
        link, answer = house.signalling._link, page.client._connection.localDescription.sdp
        refused = await house.post(
            "/api/rtc/answer", {"id": offer.json()["id"], "sdp": answer.replace("H264", "H265")}
        )
        assert (refused.status_code, refused.json()["field"]) == (400, "sdp.codec")
        assert link.is_closing

    in_house(tmp_path, play)


def test_another_hand_takes_the_fast_path_away(tmp_path):
    async def play(house, page):
        link = house.signalling._link
        house.manager.disconnect_phone(house.manager.phone)
        assert link.is_closing
        await page.touch(1, held=True)
        assert house.taken == [] or all(t < now() for _, t in house.taken)

    in_house(tmp_path, play)


def test_the_desk_has_the_rules_of_the_sockets(tmp_path):
    async def play(house, page):
        session = house.manager.phone.id
        for body, status in (
            ({"session": "somebody else"}, 403),
            ({"session": session, "more": 1}, 400),
            ({}, 400),
        ):
            assert (await house.post("/api/rtc", body)).status_code == status
        assert (await house.post("/api/rtc", {"session": session}, "nobody")).status_code == 401
        long = {"id": house.signalling._link.id, "sdp": "v=0\n" + "x" * 40_000}
        assert (await house.post("/api/rtc/answer", long)).status_code == 400
        other = await house.post("/api/rtc/answer", {"id": "x", "sdp": "v=0"})
        assert (other.status_code, other.json()["field"]) == (404, "id")
        again = {"id": house.signalling._link.id, "sdp": "Once upon a time"}
        refused = await house.post("/api/rtc/answer", again)
        assert (refused.status_code, refused.json()["field"]) == (400, "sdp")

    in_house(tmp_path, play)
