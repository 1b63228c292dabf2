"""Teleop: bumpless start, honest refusals, nothing that is not a number gets through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import EnvelopeConfig, EstimatorName, TeleopConfig
from pipeline.frames import GRAVITY, exp
from pipeline.signals import BodyImu, Mode, PhoneImu, Requests, TouchState
from pipeline.teleop import Inputs, Output, Teleop
from pipeline.vision.rays import NO_RAYS
from tests.pipeline.seeing import quiver, seen_at

ROBOT = load_robot("ames").robot
UP = np.array([0.0, 0.0, GRAVITY])
STILL, LEVEL = np.zeros(3), np.eye(3)
P = np.array([2.5, 0.0, 0.0])
LEFT = np.array([0.0, 1.0, 0.0])
COVARIANCE = np.diag([1e-6, 1e-7, 1e-7, 1e-6, 1e-6, 1e-6])


def run(
    teleop: Teleop,
    start: float,
    seconds: float,
    position: Callable[[float], np.ndarray] = lambda t: P,
    held: bool = False,
    arm_at: float = -1.0,
    body_a: np.ndarray = UP,
    R_cb: np.ndarray = LEVEL,
    gyro: Callable[[float], np.ndarray] = quiver,
    lie: str = "",
    phone: int = 0,
) -> list[Output]:
    """Everything at rest, seen perfectly, 50 ms late; or a camera that is known to lie."""
    outputs = []
    for k in range(round(start / 0.005), round((start + seconds) / 0.005)):
        t = 0.005 * k
        motion = (PhoneImu(t - 0.02, STILL, UP, phone),) if k % 3 == 0 else ()
        seen = t - 0.05
        picture = seen_at(seen, position(seen), R_cb, COVARIANCE)
        if lie:
            picture = replace(picture, pose=None, rays=NO_RAYS, lie=lie)
        outputs.append(
            teleop.step(
                Inputs(
                    t=t,
                    phone_imu=motion,
                    body_imu=(BodyImu(t, gyro(t), body_a),),
                    seen=(picture,) if k % 6 == 0 and seen > 0.0 else (),
                    operator=TouchState(t - 0.01, held, int(held)),
                    requests=Requests(arm=abs(t - arm_at) < 1e-9),
                )
            )
        )
    return outputs


def test_says_what_it_lacks_until_it_lacks_nothing() -> None:
    outputs = run(Teleop(ROBOT, TeleopConfig()), 0.0, 1.5)
    assert any("camera" in why for why in outputs[0].refusals)
    assert outputs[-1].refusals == ()
    assert outputs[-1].failsafe.mode == Mode.DISARMED


def test_tracking_begins_where_the_robot_is_without_a_jump_of_thrust() -> None:
    teleop = Teleop(ROBOT, TeleopConfig())
    run(teleop, 0.0, 1.5, arm_at=1.2)
    outputs = run(teleop, 1.5, 0.5, held=True)
    first = next(o for o in outputs if o.failsafe.mode == Mode.TRACK)
    assert first.error is not None
    np.testing.assert_allclose(first.error.e_p_in_v, np.zeros(3), atol=1e-12)
    wrench = ROBOT.A @ first.thrusts
    assert np.abs(wrench[:3]).max() < 0.2
    assert np.abs(wrench[3:]).max() < 0.02


def test_a_robot_that_has_drifted_is_pulled_back() -> None:
    teleop = Teleop(ROBOT, TeleopConfig())
    run(teleop, 0.0, 1.5, arm_at=1.2)
    run(teleop, 1.5, 0.3, held=True)
    drifted = run(
        teleop,
        1.8,
        0.5,
        position=lambda t: P + 0.03 * min(1.0, (t - 1.8) / 0.3) * LEFT,
        held=True,
    )
    assert drifted[-1].failsafe.mode == Mode.TRACK
    assert (ROBOT.A @ drifted[-1].thrusts)[1] < -0.5


@pytest.mark.parametrize("rate_hz", [200, 50, 25, 18])
def test_timers_go_by_the_measured_time_at_every_rate_of_control(rate_hz: int) -> None:
    """The longest HOLD and the ramp end with the first step that is late, never a tick more."""
    teleop = Teleop(ROBOT, TeleopConfig())
    run(teleop, 0.0, 1.5, arm_at=1.2)
    run(teleop, 1.5, 0.3, held=True)
    times: dict[Mode, float] = {}
    for k in range(1, 7 * rate_hz):
        t = 1.8 + k / rate_hz
        seen = seen_at(t - 0.05, P, LEVEL, COVARIANCE)
        inputs = Inputs(
            t=t,
            phone_imu=(PhoneImu(t - 0.02, STILL, UP),),
            body_imu=(BodyImu(t, quiver(t), UP),),
            seen=(seen,) if k % (rate_hz // 15) == 0 else (),
            operator=TouchState(t - 0.01, False, 1),
        )
        times.setdefault(teleop.step(inputs).failsafe.mode, t)
    for mode, after, seconds in (
        (Mode.HOLD, Mode.RAMP, TeleopConfig().failsafe.hold_max),
        (Mode.RAMP, Mode.DISARMED, ROBOT.ramp_s),
    ):
        late = times[after] - times[mode] - seconds
        assert -0.0015 <= late < 1.0 / rate_hz + 0.0015


def test_a_reference_out_of_reach_ends_the_flight() -> None:
    teleop = Teleop(ROBOT, TeleopConfig())
    run(teleop, 0.0, 1.5, arm_at=1.2)
    far = run(teleop, 1.5, 3.0, position=lambda t: P + 0.4 * max(0.0, t - 1.6) * LEFT, held=True)
    modes = {o.failsafe.mode for o in far}
    assert Mode.RAMP in modes
    assert far[-1].failsafe.mode in (Mode.RAMP, Mode.DISARMED)


def test_a_robot_tilted_too_far_ends_the_flight() -> None:
    limits = replace(EnvelopeConfig(), max_tilt_rad=0.2)
    for tilt, mode in ((0.1, Mode.TRACK), (0.3, Mode.RAMP)):
        R_cb = exp(np.array([tilt, 0.0, 0.0]))
        teleop = Teleop(ROBOT, replace(TeleopConfig(), envelope=limits))
        run(teleop, 0.0, 1.5, arm_at=1.2, body_a=R_cb.T @ UP, R_cb=R_cb)
        last = run(teleop, 1.5, 0.3, held=True, body_a=R_cb.T @ UP, R_cb=R_cb)[-1]
        assert last.failsafe.mode == mode
    assert "tilted" in last.failsafe.reason


def test_thrusts_are_always_finite_and_within_limits() -> None:
    teleop = Teleop(ROBOT, TeleopConfig())
    run(teleop, 0.0, 1.5, arm_at=1.2)
    bad = run(teleop, 1.5, 0.5, held=True, body_a=np.array([np.nan, 0.0, 9.8]))
    for output in bad:
        assert np.isfinite(output.thrusts).all()
        assert output.thrusts.min() >= 0.0
        assert output.thrusts.max() <= ROBOT.f_max


@pytest.mark.parametrize("gyro", [np.zeros(3), np.array([0.1, 0.0, 0.0])])
def test_a_flight_ends_when_the_robots_motion_sensors_stand_still(gyro: np.ndarray) -> None:
    teleop = Teleop(ROBOT, TeleopConfig())
    run(teleop, 0.0, 1.5, arm_at=1.2)
    run(teleop, 1.5, 0.3, held=True)
    frozen = run(teleop, 1.8, 0.15, held=True, gyro=lambda t: gyro)
    assert [o.failsafe.mode for o in frozen if o.t < 1.89] == 18 * [Mode.TRACK]
    assert frozen[-1].failsafe.mode == Mode.RAMP
    assert frozen[-1].failsafe.reason == "The robot's motion sensors stand still."


def test_a_camera_that_is_found_out_is_followed_no_further() -> None:
    """What it taught before is in the estimate, and no covariance knows how wrong that is."""
    teleop = Teleop(ROBOT, TeleopConfig())
    run(teleop, 0.0, 1.5, arm_at=1.2)
    assert run(teleop, 1.5, 0.5, held=True)[-1].failsafe.mode == Mode.TRACK
    doubted = run(teleop, 2.0, 0.3, held=True, lie="It zooms.")
    first = next(k for k, o in enumerate(doubted) if o.failsafe.mode != Mode.TRACK)
    assert first <= 6, "with the first picture that says so"
    assert doubted[-1].failsafe.mode == Mode.COAST
    assert doubted[-1].failsafe.reason == "It zooms."
    assert run(teleop, 2.3, 0.5, held=True)[-1].failsafe.mode == Mode.TRACK


def test_the_next_phone_is_not_told_to_mend_the_camera_of_the_one_before() -> None:
    teleop = Teleop(ROBOT, TeleopConfig())
    run(teleop, 0.0, 1.5)
    assert "It zooms." in run(teleop, 1.5, 0.3, lie="It zooms.")[-1].refusals
    assert "It zooms." not in run(teleop, 1.8, 0.02, phone=1)[-1].refusals


@pytest.mark.parametrize("estimator", ["relative", "paper", "none"])
def test_what_was_known_by_another_phone_is_forgotten(estimator: EstimatorName) -> None:
    """Its pictures too, which are later than motion; a flight under way coasts and comes down."""
    teleop = Teleop(ROBOT, replace(TeleopConfig(), estimator=estimator))
    run(teleop, 0.0, 1.5, arm_at=1.2)
    assert run(teleop, 1.5, 0.3, held=True)[-1].failsafe.mode == Mode.TRACK
    met, *others = run(teleop, 1.8, 0.1, held=True, phone=1)
    assert met.relative is None
    assert met.failsafe.mode != Mode.TRACK
    assert met.R_fc == pytest.approx(LEVEL)
    unknown = [one for one in others if one.relative is None]
    assert unknown[-1].t == pytest.approx(1.825), "until a picture no older than its samples"
    assert others[-1].relative is not None
