"""The virtual phone's page and person: polite, in order, understood by the server's ingest."""

import asyncio
import itertools
import json

import numpy as np
import pytest

from hardware.camera_file import find_camera
from hardware.codec import Encoder
from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from hardware.sim.phone import PERFECT, Event, EventKind, PhoneOptions, VirtualPhone
from hardware.sim.render import RenderOptions
from pipeline.config import VirtualCameraConfig
from pipeline.frames import exp
from pipeline.signals import PhoneImu, TouchState
from server.common.access import PhoneClientError
from server.phone.ingest import EncodedFrame, Ingest
from server.protocol.messages import encode_message
from server.protocol.wire import decode, encode
from server.protocol.wire_records import Codec, Motion, Picture, Ping, Pong, Record, Touch
from server.virtual_phone import command
from server.virtual_phone.command import main, summary
from server.virtual_phone.live_phone import EXPOSED_S, LivePhone, _first_failure, is_superseded
from server.virtual_phone.phone_script import Manners, PhoneScript, TrackingMetrics, VirtualOperator
from tests.server.page_server import WELCOME, PageServer, status

LEDS_IN_B = np.array(
    [[0.2, 0.2, 0.1], [0.2, -0.2, 0.15], [0.1, 0.1, -0.2], [0.25, -0.1, -0.1], [0.3, 0.0, 0.0]]
)


def make_script(kind="steady", codec="jpeg", options=None):
    camera = find_camera("lightleash-virtual-phone", 1280, 720)
    rng = np.random.default_rng(2)
    phone = VirtualPhone(
        camera, make_hand(kind), LEDS_IN_B, RenderOptions(), rng, options or PhoneOptions()
    )
    return PhoneScript(
        phone, Encoder(camera.width, camera.height, 30.0, 3_000_000, codec), VirtualOperator()
    )


def hanging_still(_t):
    return np.eye(3), np.zeros(3)


def watch(operator, modes, step=0.05):
    """Show (mode, ready, how long) one after the other; gives [(t, held, press)] and the wishes."""
    touches, wishes, t = [], [], 0.0
    for mode, ready, seconds in modes:
        for _ in range(round(seconds / step)):
            wish = operator.see(mode, ready, t)
            if wish:
                wishes.append((t, wish.what))
            touches.append((t, *operator.touch(t)))
            t += step
    return touches, wishes


def test_operator_waits_until_arming_would_be_granted():
    _, wishes = watch(VirtualOperator(), [("DISARMED", False, 2.0), ("DISARMED", True, 0.5)])
    assert wishes == [(pytest.approx(2.0), "arm")]


def test_operator_presses_after_armed_and_holds_while_tracking():
    touches, wishes = watch(
        VirtualOperator(), [("DISARMED", True, 0.5), ("ARMED", False, 1.0), ("TRACK", False, 9.0)]
    )
    pressed = [t for t, held, _ in touches if held]
    assert [what for _, what in wishes] == ["arm"]
    assert pressed[0] == pytest.approx(0.5 + 0.7, abs=0.06)
    assert all(held for t, held, _ in touches if t > pressed[0])
    assert touches[-1][2] == 1


@pytest.mark.parametrize(("armed_s", "pressed_s"), [(0.5, 3.0), (2.9, 3.6)])
def test_who_is_patient_presses_at_a_given_time_or_once_it_is_armed(armed_s, pressed_s):
    operator = VirtualOperator(Manners(not_before_s=3.0))
    touches, _ = watch(operator, [("DISARMED", False, armed_s), ("ARMED", False, 3.0)])
    pressed = [t for t, held, _ in touches if held]
    assert pressed[0] == pytest.approx(pressed_s, abs=0.06)
    assert all(held for t, held, _ in touches if pressed[0] < t < pressed[0] + 0.9)


def test_a_press_that_changes_nothing_is_given_up_and_made_anew():
    touches, _ = watch(VirtualOperator(), [("ARMED", False, 3.2)])
    edges = [b[1] for a, b in itertools.pairwise(touches) if a[1] != b[1]]
    assert edges == [True, False, True, False]
    assert touches[-1][2] == 2


def test_after_hold_a_new_press_follows_and_after_a_ramp_a_new_arm():
    modes = [("TRACK", False, 1.0), ("HOLD", False, 2.0), ("RAMP", False, 2.0)]
    touches, wishes = watch(VirtualOperator(), [*modes, ("DISARMED", True, 0.2)])
    assert not any(held for t, held, _ in touches if 1.0 <= t < 1.95)
    assert any(held for t, held, _ in touches if 1.95 <= t < 3.0)
    assert not any(held for t, held, _ in touches if t >= 3.0)
    assert len(wishes) == 1


@pytest.mark.parametrize("mode", ["LOST", "DISARMED", "RAMP", "STOPPED"])
def test_operator_never_holds_where_nothing_may_move(mode):
    touches, _ = watch(VirtualOperator(), [(mode, False, 5.0)])
    assert not any(held for _, held, _ in touches)


def test_once_is_enough_when_told_so():
    operator = VirtualOperator(Manners(again=False))
    modes = [("TRACK", False, 1.0), ("HOLD", False, 4.0), ("DISARMED", True, 4.0)]
    touches, wishes = watch(operator, modes)
    assert not any(held for _, held, _ in touches)
    assert wishes == []


def test_leaving_lets_go():
    operator = VirtualOperator()
    watch(operator, [("ARMED", False, 1.5), ("TRACK", False, 1.0)])
    assert operator.touch(2.5)[0]
    operator.leaving = True
    assert not operator.touch(2.6)[0]


def synchronised(script, seconds=1.0):
    """An ingest that has learnt the phone's clock through 20 ms of network each way."""
    ingest = Ingest(itertools.count(1).__next__)
    for k in range(round(20 * seconds)):
        t = k / 20.0
        ping = ingest.ping(t)
        ingest.record(decode(encode(script.pong(ping.body.nonce, ping.t_us, t + 0.02))), t + 0.04)
    return ingest


def test_servers_ingest_reads_back_the_hand():
    script = make_script(options=PERFECT)
    ingest = synchronised(script)
    for event in script.phone.events(5.0, 5.5):
        if event.kind is EventKind.MOTION:
            record = decode(encode(script.motion(event.t_capture)))
            imu = ingest.record(record, event.t_deliver)
            assert isinstance(imu, PhoneImu)
            assert imu.t == pytest.approx(event.t_capture, abs=1e-3)
            omega = script.phone.hand.omega_in_c(event.t_capture)
            force = script.phone.hand.specific_force_in_c(event.t_capture)
            assert imu.omega_m_cf_in_c == pytest.approx(omega, abs=1e-6)
            assert imu.a_m_cf_in_c == pytest.approx(force, abs=1e-5)


def test_touch_echoes_the_newest_nonce():
    script = make_script()
    ingest = synchronised(script)
    newest = ingest.ping(1.0)
    ingest.record(decode(encode(script.pong(newest.body.nonce, newest.t_us, 1.02))), 1.04)
    record = decode(encode(script.touch(1.03)))
    assert isinstance(record.body, Touch)
    assert record.body.nonce == newest.body.nonce
    operator = ingest.record(record, 1.05)
    assert isinstance(operator, TouchState)
    assert not operator.held


def test_touch_counts_from_the_earliest_that_its_stamp_allows():
    script = make_script()
    operator = synchronised(script).record(decode(encode(script.touch(1.0))), 1.02)
    assert isinstance(operator, TouchState)
    assert operator.t == pytest.approx(1.0 - 0.02, abs=1e-4)  # the network's way to the phone


@pytest.mark.parametrize(("name", "codec"), [("jpeg", Codec.JPEG), ("h264", Codec.H264)])
def test_pictures_are_numbered_encoded_and_dated(name, codec):
    script = make_script(codec=name)
    ingest = synchronised(script)
    frames = []
    for k in range(3):
        record = decode(encode(script.picture(2.0 + k / 30.0, hanging_still)))
        assert isinstance(record.body, Picture)
        frames.append(ingest.record(record, 2.2 + k / 30.0))
    assert all(isinstance(frame, EncodedFrame) for frame in frames)
    assert [frame.sequence for frame in frames] == [0, 1, 2]
    assert [frame.t for frame in frames] == pytest.approx(
        [2.0, 2.0 + 1 / 30, 2.0 + 2 / 30], abs=2e-3
    )
    assert frames[0].picture.codec == codec
    assert frames[0].picture.key
    assert frames[0].picture.screen_angle_deg == 90


def test_a_key_frame_comes_when_asked():
    script = make_script(codec="h264")
    keys = [script.picture(1.0 + k / 30.0, hanging_still, key=k == 2).body.key for k in range(4)]
    assert keys == [True, False, True, False]


class Meeting(PageServer):
    """Pings its page, shows one mode after the other, and asks for a key frame."""

    async def __call__(self, socket):
        if socket.request.path == "/ws/phone":
            pings = [encode(Record(k, k, Ping(100 + k))) for k in range(20)]
            modes = [encode_message(status(mode)) for mode in ("DISARMED", "ARMED")]
            self.after_hello = [encode_message(WELCOME), *pings, *modes]
        await super().__call__(socket)


@pytest.mark.e2e
def test_live_phone_plays_its_part_on_real_sockets():
    """One and a half seconds of real time; rates are asked for loosely: the machine may be busy."""
    server = Meeting([])
    shown = []

    async def talk(access):
        live = LivePhone(access, make_script(codec="h264"), truth_port=0)
        await live.run(1.5, shown.append)
        return live

    live = asyncio.run(server.serve(talk))
    video = [decode(data).body for path, data in server.heard if path == "/ws/video"]
    main = [data for path, data in server.heard if path == "/ws/phone"]
    records = [decode(data).body for data in main if isinstance(data, bytes)]
    messages = [json.loads(data)["what"] for data in main if isinstance(data, str)]
    assert messages == ["arm", "disarm"]
    assert len(video) == live.sent > 15
    assert video[0].key
    assert sum(isinstance(body, Motion) for body in records) > 45
    assert sum(isinstance(body, Pong) for body in records) == 20
    touches = [body for body in records if isinstance(body, Touch)]
    assert [held for held, _ in itertools.groupby(body.held for body in touches)] == [
        False, True, False,
    ]  # fmt: skip
    assert shown
    assert json.dumps(summary(live))


@pytest.mark.e2e
def test_a_phone_asked_to_leave_lets_go_first():
    server = Meeting([])

    async def talk(access):
        live = LivePhone(access, make_script(), truth_port=0)

        def leave_when_held(_live):
            if live.script.operator.presses:
                live.leave()

        await live.run(60.0, leave_when_held)

    asyncio.run(server.serve(talk))
    main = [data for path, data in server.heard if path == "/ws/phone"]
    last = next(
        r.body
        for r in map(decode, (d for d in main[::-1] if isinstance(d, bytes)))
        if isinstance(r.body, Touch)
    )
    assert not last.held
    last_word = json.loads(main[-1])
    assert (last_word["type"], last_word["what"]) == ("command", "disarm")


@pytest.mark.parametrize(
    ("heard_s", "why"), [(0.05, "one phone at a time"), (9.0, "received 1000")]
)
def test_who_is_hung_up_on_says_why_whoever_of_its_parts_notices_first(heard_s, why):
    async def fails(words, after_s):
        await asyncio.sleep(after_s)
        raise PhoneClientError(words)

    async def run():
        parts = fails("one phone at a time", heard_s), fails("received 1000", 0.01)
        await _first_failure([asyncio.create_task(part) for part in parts], 5.0)

    with pytest.raises(PhoneClientError, match=why):
        asyncio.run(run())


def test_a_busy_phone_leaves_a_picture_out_once_the_next_is_there_and_it_would_come_late():
    period = 1.0 / 30.0
    quick = Event(1.0 + EXPOSED_S, 1.0, EventKind.PICTURE)
    there = 1.0 + EXPOSED_S + period
    assert not is_superseded(quick, there - 1e-6, period)
    assert is_superseded(quick, there + 1e-6, period)
    slow = Event(1.12, 1.0, EventKind.PICTURE)
    assert not is_superseded(slow, 1.1199, period)  # there is time until it is to arrive
    assert is_superseded(slow, 1.1201, period)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--path", "carrier-pigeon"],
        ["--latency-ms", "5"],
        ["--fps", "500"],
        ["--codec", "gif"],
        ["--fault", "haunted"],
        ["--truth-port", "70000"],
        ["--seed", "-1"],
    ],
)
def test_command_refuses_what_it_cannot_play(arguments):
    with pytest.raises(SystemExit):
        main([*arguments, "--url", "http://127.0.0.1:9", "--token", "t"])


@pytest.mark.e2e
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--hand", "juggling"], "juggling"),
        ([], r"127.0.0.1:9"),
        (["--path", "webrtc"], r"127.0.0.1:9"),
        (["--path", "webrtc", "--codec", "jpeg"], "h264, vp8"),
    ],
)
def test_command_says_what_is_wrong(arguments, words, capsys):
    assert main([*arguments, "--url", "http://127.0.0.1:9", "--token", "t"]) == 1
    assert words in capsys.readouterr().err


def test_a_robot_that_follows_exactly_scores_nothing():
    script = make_script("step_y")
    score = TrackingMetrics(script.phone, VirtualCameraConfig())
    hand = script.phone.hand
    start = hand.pose(1.0)[1]

    def follows(t):
        return np.eye(3), hand.pose(t)[1] - start

    score.start(1.0, follows)
    score.advance(5.0, follows)
    assert score.tracked_s == pytest.approx(4.0, abs=0.01)
    assert score.rms_m < 1e-9
    assert score.rms_rad < 1e-9


def test_a_robot_that_hangs_still_scores_the_hands_step():
    script = make_script("step_y")
    score = TrackingMetrics(script.phone, VirtualCameraConfig())
    score.start(2.0, hanging_still)
    score.advance(3.0, hanging_still, counted=False)
    score.advance(5.0, hanging_still)
    assert score.max_m == pytest.approx(0.03, abs=1e-6)
    assert score.rms_m == pytest.approx(0.03, abs=1e-6)
    assert score.tracked_s == pytest.approx(2.0, abs=0.01)


def test_a_turned_robot_scores_its_angle():
    script = make_script("still")
    score = TrackingMetrics(script.phone, VirtualCameraConfig())
    score.start(1.0, hanging_still)
    score.advance(3.0, lambda _t: (exp(np.array([0.0, 0.0, 0.1])), np.zeros(3)))
    assert score.rms_rad == pytest.approx(0.1)
    assert score.rms_m == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("around", ["near_bloom", None])
def test_the_command_puts_a_room_around_the_robot(around):
    ames = load_robot("ames")
    told = command.make_parser().parse_args(["--around", around] if around else [])
    told.truth_port = 0
    script = command.make_script(told, ames, 0)
    x, y, _ = script.phone.hand.pose(0.0)[1]
    distance, usual = float(np.hypot(x, y)), ames.start.distance
    assert (script.phone.films is not None) == (around is not None)
    assert (distance < 0.6 * usual) if around else (distance == pytest.approx(usual))
