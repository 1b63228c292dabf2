"""An eye that errs by noise only: as wrong as it says, blind where LEDs are hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.camera_file import find_camera
from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from hardware.sim.led_sensor_model import LedSensorModel
from hardware.sim.phone import VirtualPhone
from hardware.sim.render import RenderOptions
from pipeline.camera.lens import COLUMNS, ROWS
from pipeline.frames import Array

LEDS = load_robot("ames").robot.leds_in_b


def at_rest(t: float) -> tuple[Array, Array]:
    return np.eye(3), np.zeros(3)


def eye(
    noise_px: float, hidden: tuple[int, ...] = (), readout_s: float = 0.0, axis: int = ROWS
) -> LedSensorModel:
    camera = replace(
        find_camera("lightleash-virtual-phone", 1280, 720), readout_s=readout_s, readout_axis=axis
    )
    rng = np.random.default_rng(1)
    phone = VirtualPhone(camera, make_hand("moving", seed=2), LEDS, RenderOptions(), rng)
    return LedSensorModel(phone, LEDS, noise_px, lambda t: hidden, np.random.default_rng(3))


def test_without_noise_it_tells_the_truth() -> None:
    one = eye(0.0)
    seen = one.seen(3.0, 3.1, at_rest)
    assert seen is not None
    assert seen.pose is not None
    R_cb, p_bc_in_c = one._phone.relative_pose(3.0, at_rest)
    np.testing.assert_allclose(seen.pose.p_bc_in_c, p_bc_in_c, atol=1e-6)
    np.testing.assert_allclose(seen.pose.R_cb, R_cb, atol=1e-6)
    assert seen.t == seen.pose.t == 3.1
    assert seen.rays.led.tolist() == [0, 1, 2, 3, 4]


def test_its_noise_is_what_its_rays_claim() -> None:
    noisy, perfect = eye(0.3), eye(0.0)
    times = 2.0 + 0.03 * np.arange(60)
    pairs = [(noisy.seen(t, t, at_rest), perfect.seen(t, t, at_rest)) for t in times]
    whitened = [
        np.linalg.solve(np.linalg.cholesky(C), a - b)
        for one, other in pairs
        if one is not None and other is not None
        for C, a, b in zip(
            one.rays.covariances, one.rays.tangents, other.rays.tangents, strict=True
        )
    ]
    assert np.std(whitened) == pytest.approx(1.0, abs=0.1)


def test_leds_shine_where_they_are_and_the_pose_is_by_where_the_file_has_them() -> None:
    one, exact = eye(0.0), eye(0.0)
    one._phone.leds_in_b = LEDS + np.array([0.0, 0.01, 0.0])
    seen, same = (eyes.seen(3.0, 3.0, at_rest) for eyes in (one, exact))
    assert seen is not None
    assert same is not None
    assert seen.pose is not None
    assert same.pose is not None
    moved = seen.rays.tangents - same.rays.tangents
    assert (np.linalg.norm(moved, axis=1) > 0.003).all()  # 10 mm at 2.5 m
    shift_in_b = same.pose.R_cb.T @ (seen.pose.p_bc_in_c - same.pose.p_bc_in_c)
    np.testing.assert_allclose(shift_in_b, [0.0, 0.01, 0.0], atol=1e-5)


def test_hidden_leds_have_no_rays_and_few_give_no_pose() -> None:
    seen = eye(0.1, hidden=(0, 3)).seen(2.0, 2.0, at_rest)
    assert seen is not None
    assert seen.rays.led.tolist() == [1, 2, 4]
    assert seen.pose is None
    assert eye(0.1, hidden=(0, 1, 2, 3, 4)).seen(2.0, 2.0, at_rest) is None


@pytest.mark.parametrize("axis", [ROWS, COLUMNS])
@pytest.mark.parametrize("readout_s", [0.03, -0.03])
def test_each_led_is_where_it_is_when_its_line_is_read(readout_s: float, axis: int) -> None:
    rolling = eye(0.0, readout_s=readout_s, axis=axis).seen(4.0, 4.0, at_rest)
    assert rolling is not None
    for k, t in enumerate(rolling.rays.t):
        alone = eye(0.0).seen(float(t), 4.0, at_rest)
        assert alone is not None
        np.testing.assert_allclose(rolling.rays.tangents[k], alone.rays.tangents[k], atol=2e-5)


@pytest.mark.parametrize("readout_s", [0.03, -0.03])
def test_its_pose_is_that_of_the_middle_row_though_others_are_read_at_other_times(
    readout_s: float,
) -> None:
    one, away = eye(0.0, readout_s=readout_s), []
    for t in 2.0 + 0.5 * np.arange(8):
        seen = one.seen(t, t, at_rest)
        assert seen is not None
        assert seen.pose is not None
        away.append(seen.pose.p_bc_in_c - one._phone.relative_pose(t, at_rest)[1])
    np.testing.assert_allclose(away, np.zeros((8, 3)), atol=1e-6)
