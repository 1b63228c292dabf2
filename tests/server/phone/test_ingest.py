"""Ingest: dates on our clock, camera axes, and liveness that can't be faked by old bytes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera.extrinsics import Extrinsics
from pipeline.frames import GRAVITY, exp
from pipeline.signals import PhoneImu, TouchState
from pipeline.timing.clock_line import MAX_DRIFT
from server.phone.ingest import REMEMBERED_NONCES, UNHEARD_S, EncodedFrame, Ingest
from server.protocol.wire import WireError
from server.protocol.wire_records import Codec, Motion, Picture, Ping, Pong, Record, Touch

OFFSET = 4321.5


def counting(first: int = 1000) -> Ingest:
    nonces = iter(range(first, 9000))
    return Ingest(lambda: next(nonces))


def nonce_of(ping: Record) -> int:
    assert isinstance(ping.body, Ping)
    return ping.body.nonce


def pong(ping: Record, t: float) -> Record:
    return Record(1, int((t + OFFSET) * 1e6), Pong(nonce_of(ping), ping.t_us))


def synchronised(first: int = 1000) -> Ingest:
    ingest = counting(first)
    for k in range(6):
        ping = ingest.ping(0.05 * k)
        assert ingest.record(pong(ping, 0.05 * k + 0.002), 0.05 * k + 0.004) is None
    return ingest


FLAT = Motion((1.0, 2.0, 3.0), (0.0, 0.0, GRAVITY), None, 0)


def at(t: float) -> int:
    return int((t + OFFSET) * 1e6)


def test_captures_are_dated_on_our_clock() -> None:
    ingest = synchronised()
    sample = ingest.record(Record(1, at(1.0), FLAT), 1.02)
    assert isinstance(sample, PhoneImu)
    assert sample.t == pytest.approx(1.0, abs=1e-3)
    frame = ingest.record(Record(1, at(0.9), Picture(Codec.H264, True, 64, 64, 0, b"x")), 1.02)
    assert isinstance(frame, EncodedFrame)
    assert frame.t == pytest.approx(0.9, abs=1e-3)


def test_nothing_is_dated_before_the_clock_is_known() -> None:
    ingest = counting()
    assert ingest.record(Record(1, at(1.0), FLAT), 1.02) is None
    assert ingest.unsynchronised == 1


@pytest.mark.parametrize(
    ("angle", "up_in_device"),
    [(0, (0.0, 1.0, 0.0)), (90, (1.0, 0.0, 0.0)), (180, (0.0, -1.0, 0.0)), (270, (-1.0, 0.0, 0.0))],
)
def test_up_is_up_however_the_screen_is_turned(
    angle: int, up_in_device: tuple[float, float, float]
) -> None:
    force = tuple(GRAVITY * u for u in up_in_device)
    motion = replace(FLAT, acceleration=force, screen_angle_deg=angle)
    sample = synchronised().record(Record(1, at(1.0), motion), 1.0)
    assert isinstance(sample, PhoneImu)
    np.testing.assert_allclose(sample.a_m_cf_in_c, [0.0, 0.0, GRAVITY], atol=1e-9)


def test_with_the_screen_motion_gets_other_axes_and_the_press_stays() -> None:
    ingest, samples, presses = synchronised(), [], []
    nonce = nonce_of(ingest.ping(1.0))
    for k, angle in enumerate((0, 0, 90, 90)):
        t = at(1.0 + 0.1 * k)
        sample = ingest.record(Record(k, t, replace(FLAT, screen_angle_deg=angle)), 2.0)
        touch = ingest.record(Record(k, t, Touch(True, True, 3, nonce)), 2.0)
        assert isinstance(sample, PhoneImu)
        assert isinstance(touch, TouchState)
        samples.append(sample.phone)
        presses.append(touch.press)
    assert samples[0] == samples[1] != samples[2] == samples[3]
    assert len(set(presses)) == 1


def test_looking_along_the_back_of_the_phone_is_forward() -> None:
    spin = replace(FLAT, rotation_rate=(0.0, 0.0, -1.0))  # about the rear camera's axis
    sample = synchronised().record(Record(1, at(1.0), spin), 1.0)
    assert isinstance(sample, PhoneImu)
    np.testing.assert_allclose(sample.omega_m_cf_in_c, [1.0, 0.0, 0.0], atol=1e-12)


def test_motion_comes_out_in_the_axes_of_a_camera_that_sits_askew() -> None:
    ingest, R_ci = synchronised(), exp(np.array([0.05, -0.04, 0.03]))
    ingest.extrinsics = Extrinsics(R_ci)
    motion = replace(FLAT, rotation_rate=(0.1, -0.2, 0.3))
    sample, plain = (
        one.record(Record(1, at(1.0), motion), 1.0) for one in (ingest, synchronised())
    )
    assert isinstance(sample, PhoneImu)
    assert isinstance(plain, PhoneImu)
    np.testing.assert_allclose(sample.omega_m_cf_in_c, R_ci @ plain.omega_m_cf_in_c)
    np.testing.assert_allclose(sample.a_m_cf_in_c, R_ci @ plain.a_m_cf_in_c)


def test_the_operator_is_as_old_as_the_nonce_it_echoes() -> None:
    ingest = synchronised()
    ping = ingest.ping(2.0)
    said = ingest.record(Record(9, at(2.0), Touch(True, True, 4, nonce_of(ping))), 2.5)
    assert isinstance(said, TouchState)
    assert (said.t, said.held, said.press & 0xFFFFFFFF) == (2.0, True, 4)


def touched(ingest: Ingest, ping: Record, t: float, now: float) -> float:
    """From when on a touch counts that was stamped at `t` and heard at `now`."""
    said = ingest.record(Record(9, at(t), Touch(True, True, 4, nonce_of(ping))), now)
    assert isinstance(said, TouchState)
    return said.t


def test_who_is_heard_while_our_pings_are_late_is_no_older_than_his_stamp_allows() -> None:
    ingest = synchronised()
    heard = touched(ingest, ingest.ping(2.0), 2.5, 2.51)
    assert 2.5 - 0.002 - 2.5 * MAX_DRIFT <= heard <= 2.5


def test_a_page_that_hears_nothing_grows_old_however_well_it_is_heard() -> None:
    ingest = synchronised()
    assert touched(ingest, ingest.ping(2.0), 4.5, 4.51) == 2.0 + UNHEARD_S


def test_stamps_say_nothing_while_the_clock_is_unknown_or_contradicted() -> None:
    unknown = counting()
    assert touched(unknown, unknown.ping(2.0), 2.5, 2.51) == 2.0
    jumped = synchronised()
    jumped.record(pong(jumped.ping(2.0), 2.0 + 0.7), 2.01)  # the clock ran on by 0.7 s
    assert touched(jumped, jumped.ping(2.1), 2.5 + 0.7, 2.51) == 2.1


def test_a_stamp_from_the_future_says_nothing() -> None:
    ingest = synchronised()
    assert touched(ingest, ingest.ping(2.0), 2.9, 2.51) == 2.0


@given(
    delays=st.lists(st.tuples(st.floats(0.0, 0.3), st.floats(0.0, 0.3)), min_size=5, max_size=40),
    drift=st.floats(-3e-4, 3e-4),
    late=st.floats(0.0, 0.9),
)
def test_no_touch_counts_as_younger_than_it_is(
    delays: list[tuple[float, float]], drift: float, late: float
) -> None:
    ingest = counting()
    now = 0.0
    for there, back in delays:  # whatever their delays, each way by itself
        made = now + there
        ping = ingest.ping(now)
        answer = Pong(nonce_of(ping), ping.t_us)
        ingest.record(Record(1, at(made + drift * made), answer), made + back)
        now = made + back + 0.01
    ping, made = ingest.ping(now), now + late
    assert touched(ingest, ping, made + drift * made, made + 0.2) <= made + 2e-6


def test_a_touch_that_was_overtaken_says_nothing() -> None:
    ingest = synchronised()
    nonce = nonce_of(ingest.ping(2.0))
    released = Record(8, 1, Touch(False, True, 4, nonce))
    assert ingest.record(released, 2.1) is not None
    for sequence in (7, 8):  # late, and by the other way
        assert ingest.record(Record(sequence, 1, Touch(True, True, 4, nonce)), 2.2) is None
    assert ingest.record(Record(5, 1, Touch(True, True, 4, nonce=77)), 2.2) is None  # no fault
    assert ingest.record(Record(9, 1, Touch(True, True, 5, nonce)), 2.3) is not None


def test_the_first_press_and_samples_of_another_phone_are_told_apart() -> None:
    presses, phones = [], []
    for first in (1000, 2000):
        ingest = synchronised(first)
        nonce = nonce_of(ingest.ping(2.0))
        said = ingest.record(Record(1, 1, Touch(True, True, 1, nonce)), 2.0)
        assert isinstance(said, TouchState)
        presses.append(said.press)
        for t in (1.0, 1.1):
            sample = ingest.record(Record(1, at(t), FLAT), 2.0)
            assert isinstance(sample, PhoneImu)
            phones.append(sample.phone)
    assert presses[0] != presses[1]
    assert phones[0] == phones[1] != phones[2] == phones[3]


def test_a_hidden_page_holds_nothing() -> None:
    ingest = synchronised()
    nonce = nonce_of(ingest.ping(2.0))
    said = ingest.record(Record(9, 1, Touch(True, False, 4, nonce)), 2.5)
    assert isinstance(said, TouchState)
    assert not said.held


def test_invented_and_repeated_nonces_are_refused() -> None:
    ingest = synchronised()
    ping = ingest.ping(2.0)
    with pytest.raises(WireError, match=r"touch\.nonce"):
        ingest.record(Record(1, 1, Touch(True, True, 1, 77)), 2.0)
    ingest.record(pong(ping, 2.0), 2.0)
    with pytest.raises(WireError, match=r"pong\.nonce"):
        ingest.record(pong(ping, 2.0), 2.0)
    for k in range(REMEMBERED_NONCES):
        ingest.ping(3.0 + k)
    with pytest.raises(WireError, match=r"touch\.nonce"):
        ingest.record(Record(1, 1, Touch(True, True, 1, nonce_of(ping))), 4.0)


def test_captures_from_the_future_and_repeated_ones_are_not_taken() -> None:
    ingest = synchronised()
    with pytest.raises(WireError, match="not later than its arrival"):
        ingest.record(Record(1, at(3.0), FLAT), 2.0)
    assert ingest.record(Record(1, at(2.0), FLAT), 2.0) is not None
    assert ingest.record(Record(1, at(2.0), FLAT), 2.0) is None


class Phone:
    """Another clock behind a network of 10-30 ms each way; says 60 motions a second."""

    def __init__(self, ingest: Ingest, offset: float, drift: float) -> None:
        self.ingest, self.offset, self.drift = ingest, offset, drift
        self.rng = np.random.default_rng(0)
        self.errors: list[float] = []
        self.refused = 0

    def reads_us(self, t: float) -> int:
        return int(1e6 * (t * (1.0 + self.drift) + self.offset))

    def run(self, t_from: float, t_to: float) -> None:
        pings = [(t, None) for t in np.arange(t_from, t_to, 0.05)]
        motions = [(t + 0.02, t) for t in np.arange(t_from, t_to, 1 / 60)]
        for t, t_capture in sorted(pings + motions, key=lambda event: event[0]):
            if t_capture is None:
                self.answer(t)
            else:
                self.say(t_capture, t)

    def answer(self, t: float) -> None:
        there, back = self.rng.uniform(0.01, 0.03, 2)
        nonce = nonce_of(self.ingest.ping(t))
        record = Record(1, self.reads_us(t + there), Pong(nonce, int(1e6 * t)))
        self.ingest.record(record, t + there + back)

    def say(self, t_capture: float, t: float) -> None:
        try:
            sample = self.ingest.record(Record(1, self.reads_us(t_capture), FLAT), t)
        except WireError:
            self.refused += 1
            return
        if isinstance(sample, PhoneImu):
            self.errors.append(sample.t - t_capture)


def test_a_clock_an_hour_off_and_200_ppm_fast_is_followed() -> None:
    phone = Phone(counting(), -3600.0 + 5000.0, 200e-6)
    phone.run(0.0, 60.0)
    assert len(phone.errors) > 3550
    assert max(map(abs, phone.errors)) < 0.02
    assert max(map(abs, phone.errors[1200:])) < 2e-3
    assert phone.refused == 0


@pytest.mark.parametrize("jump", [2.0, -2.0])
def test_after_a_jump_of_the_clock_dates_are_right_within_a_second(jump: float) -> None:
    phone = Phone(counting(), 5000.0, 50e-6)
    phone.run(0.0, 5.0)
    phone.offset += jump
    phone.errors.clear()
    phone.run(5.0, 6.0)
    assert phone.ingest.clock.restarts == 1
    assert f"jumped by {jump:+.1f}" in phone.ingest.clock.reason
    assert phone.refused <= 4, "few enough to be no reason to part"
    wrong = [error for error in phone.errors if abs(error) > 0.02]
    assert len(wrong) <= 4
    assert len(phone.errors) > 35


def test_the_browsers_own_attitude_is_not_used() -> None:
    north = synchronised().record(Record(1, at(1.0), FLAT), 1.0)
    for wxyz in ((1.0, 0.0, 0.0, 0.0), (0.0, 0.6, 0.0, 0.8)):
        motion = replace(FLAT, orientation_wxyz=wxyz)
        sample = synchronised().record(Record(1, at(1.0), motion), 1.0)
        assert isinstance(sample, PhoneImu)
        assert isinstance(north, PhoneImu)
        np.testing.assert_array_equal(sample.omega_m_cf_in_c, north.omega_m_cf_in_c)
        np.testing.assert_array_equal(sample.a_m_cf_in_c, north.a_m_cf_in_c)


def test_what_is_dated_a_little_after_its_arrival_was_taken_when_it_arrived() -> None:
    ingest = synchronised()
    sample = ingest.record(Record(1, at(1.02), FLAT), 1.0)
    assert isinstance(sample, PhoneImu)
    assert sample.t == 1.0
    frame = ingest.record(Record(1, at(1.02), Picture(Codec.H264, True, 64, 64, 0, b"x")), 1.0)
    assert isinstance(frame, EncodedFrame)
    assert frame.t == 1.0
