"""The virtual phone: a browser's sensors, a network's delays, pictures of the robot."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.camera_file import find_camera
from hardware.sim.hand import make_hand
from hardware.sim.phone import PERFECT, EventKind, PhoneClock, PhoneOptions, VirtualPhone
from hardware.sim.phone_faults import SensorFault
from hardware.sim.render import RenderOptions
from pipeline.frames import GRAVITY, R_cd, R_from_wxyz, log

LEDS_IN_B = np.array(
    [[0.2, 0.2, 0.1], [0.2, -0.2, 0.15], [0.1, 0.1, -0.2], [0.25, -0.1, -0.1], [0.3, 0.0, 0.0]]
)
CAMERA = find_camera("lightleash-virtual-phone", 1280, 720)
TIMES = np.arange(2.0, 12.0, 0.17)


def make_phone(kind="moving", seed=1, options=None, clock=None):
    hand = make_hand(kind, seed=seed)
    rng = np.random.default_rng(seed)
    return VirtualPhone(
        CAMERA,
        hand,
        LEDS_IN_B,
        RenderOptions(),
        rng,
        options or PhoneOptions(),
        clock or PhoneClock(),
    )


def hanging_still(_t):
    return np.eye(3), np.zeros(3)


@pytest.mark.parametrize("angle", [0, 90, 180, 270])
def test_perfect_sensors_read_the_hand_in_the_devices_axes(angle):
    phone = make_phone(options=replace(PERFECT, screen_angle_deg=angle))
    for t in TIMES:
        reading = phone.motion(t)
        R = R_cd(reading.screen_angle_deg)
        assert np.abs(R @ reading.omega_m_in_d - phone.hand.omega_in_c(t)).max() < 1e-9
        assert np.abs(R @ reading.a_m_in_d - phone.hand.specific_force_in_c(t)).max() < 1e-9
        R_fc = R_from_wxyz(reading.R_ed_wxyz) @ R.T
        assert np.abs(R_fc - phone.hand.pose(t)[0]).max() < 1e-9


def test_held_in_landscape_gravity_is_on_the_devices_x():
    """At screen angle 90° the device lies on its side: W3C's x points up."""
    at_rest = make_phone("still", options=PERFECT).motion(1.0)
    assert at_rest.screen_angle_deg == 90
    assert at_rest.a_m_in_d == pytest.approx([9.80665, 0.0, 0.0], abs=1e-9)


def test_browser_rounds_to_its_steps():
    phone = make_phone()
    for t in TIMES:
        reading = phone.motion(t)
        steps_of_omega = np.degrees(reading.omega_m_in_d) / 0.1
        steps_of_a = reading.a_m_in_d / 0.1
        steps_of_angle = np.degrees(np.linalg.norm(log(R_from_wxyz(reading.R_ed_wxyz)))) / 0.1
        for steps in (steps_of_omega, steps_of_a, steps_of_angle):
            assert np.abs(steps - np.round(steps)).max() < 1e-6


def test_rounded_orientation_is_within_a_step_of_the_truth():
    phone = make_phone()
    for t in TIMES:
        R_ed = R_from_wxyz(phone.motion(t).R_ed_wxyz)
        truth = phone.hand.pose(t)[0] @ R_cd(90)
        assert np.degrees(np.linalg.norm(log(R_ed.T @ truth))) < 0.051


def test_noise_and_bias_are_of_the_promised_size():
    errors = []
    for seed in range(40):
        phone = make_phone("still", seed=seed)
        readings = [phone.motion(t) for t in np.arange(0.0, 2.0, 0.1)]
        force = R_cd(90).T @ (0.0, 0.0, 9.80665)
        mean_omega = np.mean([r.omega_m_in_d for r in readings], axis=0)
        mean_a = np.mean([r.a_m_in_d for r in readings], axis=0) - force
        errors.append(np.concatenate((mean_omega, mean_a)))
    spread = np.std(errors, axis=0)
    assert spread[:3] == pytest.approx([0.002] * 3, rel=0.5)
    assert spread[3:] == pytest.approx([0.05] * 3, rel=0.5)


def test_clock_began_elsewhere_and_drifts():
    clock = PhoneClock(offset_s=1234.0, drift_ppm=40.0)
    assert clock.at(0.0) == 1234.0
    assert clock.at(1000.0) - clock.at(0.0) == pytest.approx(1000.04)


def test_events_come_in_order_at_their_rate_within_their_delay():
    events = make_phone().events(100.0, 110.0)
    assert [e.t_deliver for e in events] == sorted(e.t_deliver for e in events)
    limits = {EventKind.MOTION: (60.0, 0.015, 0.040), EventKind.PICTURE: (30.0, 0.060, 0.120)}
    for kind, (rate, low, high) in limits.items():
        own = [e for e in events if e.kind is kind]
        assert len(own) == pytest.approx(10.0 * rate, abs=2)
        captures = np.array([e.t_capture for e in own])
        assert np.diff(captures) == pytest.approx(np.full(len(own) - 1, 1.0 / rate))
        delays = np.array([e.t_deliver for e in own]) - captures
        assert delays.min() >= low - 1e-9
        assert delays.max() <= high + 1e-9
        assert np.ptp(delays) > 0.8 * (high - low)


def test_windows_that_join_lose_and_repeat_nothing():
    phone = make_phone()
    whole = phone.events(50.0, 53.0)
    pieces = [e for k in range(300) for e in phone.events(50.0 + k / 100, 50.0 + (k + 1) / 100)]
    assert sorted(pieces) == sorted(whole)
    times = sorted(e.t_capture for e in phone.pictures.captures(50.0, 51.0))
    assert len(times) in (29, 30, 31)
    assert times[0] >= 50.0
    assert times[-1] < 51.0


def test_same_seed_same_phone():
    first, second = make_phone(seed=4), make_phone(seed=4)
    assert first.events(0.0, 5.0) == second.events(0.0, 5.0)
    assert (first.motion(3.0).a_m_in_d == second.motion(3.0).a_m_in_d).all()
    luma = first.picture(3.0, hanging_still)
    assert (luma == second.picture(3.0, hanging_still)).all()


def test_picture_shows_the_leds_where_they_are():
    phone = make_phone("steady", options=PERFECT)
    R_cb, p_bc_in_c = phone.relative_pose(5.0, hanging_still)
    luma = phone.picture(5.0, hanging_still)
    assert luma.shape == (CAMERA.height, CAMERA.width)
    assert luma.dtype == np.uint8
    assert p_bc_in_c == pytest.approx([2.5, 0.0, 0.0], abs=0.1)
    for u, v in CAMERA.pixels(LEDS_IN_B @ R_cb.T + p_bc_in_c):
        window = luma[round(v) - 4 : round(v) + 5, round(u) - 4 : round(u) + 5].astype(float)
        assert window.max() > 150


def test_a_hidden_led_is_dark_as_long_as_it_is_hidden():
    def hidden(t):
        return (1, 3) if 2.0 <= t < 3.0 else ()

    seen = make_phone()
    covered = VirtualPhone(
        CAMERA, seen.hand, LEDS_IN_B, RenderOptions(), np.random.default_rng(1), hidden=hidden
    )
    for t in (1.9, 2.5, 3.0):
        R, p = seen.relative_pose(t, hanging_still)
        luma = covered.picture(t, hanging_still)
        places = np.round(CAMERA.pixels(p + LEDS_IN_B @ R.T)).astype(int)
        lit = luma[places[:, 1], places[:, 0]] > 128
        assert lit.tolist() == [led not in hidden(t) for led in range(len(LEDS_IN_B))]


def faulty(fault):
    """Readings at rest and on the move of a phone with and without the fault."""
    spoilt = make_phone(options=replace(PERFECT, fault=fault))
    return zip(
        map(make_phone(options=PERFECT).motion, TIMES), map(spoilt.motion, TIMES), strict=True
    )


def test_each_fault_spoils_what_it_says_and_nothing_else():
    def same(a, b):
        return np.array_equal(a, b)

    for good, bad in faulty(SensorFault.IOS_SIGN):
        assert same(bad.a_m_in_d, -good.a_m_in_d)
        assert same(bad.omega_m_in_d, good.omega_m_in_d)
    for good, bad in faulty(SensorFault.RATE_ORDER):
        assert same(bad.omega_m_in_d, good.omega_m_in_d[[1, 2, 0]])
        assert same(bad.a_m_in_d, good.a_m_in_d)
    for good, bad in faulty(SensorFault.SCREEN_ANGLE):
        assert (good.screen_angle_deg, bad.screen_angle_deg) == (90, 0)
        assert same(bad.a_m_in_d, good.a_m_in_d)
    for good, bad in faulty(SensorFault.G_UNITS):
        assert bad.a_m_in_d == pytest.approx(good.a_m_in_d / GRAVITY)
    for good, bad in faulty(SensorFault.NONE):
        assert same(bad.a_m_in_d, good.a_m_in_d)


def test_without_gravity_rest_feels_like_nothing():
    phone = make_phone("still", options=replace(PERFECT, fault=SensorFault.NO_GRAVITY))
    assert phone.motion(1.0).a_m_in_d == pytest.approx(np.zeros(3), abs=1e-9)
