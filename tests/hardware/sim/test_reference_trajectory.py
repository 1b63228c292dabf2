"""What the hand meant: rigid with an ideal virtual camera from the press on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hardware.sim.reference_trajectory import ReferenceTrajectory
from pipeline.config import VirtualCameraConfig
from pipeline.frames import exp

HAND = (np.eye(3), np.array([-2.5, 0.0, 1.0]))
BODY = (exp(np.array([0.0, 0.1, 0.3])), np.array([0.0, 0.2, 0.9]))
UP = np.array([0.0, 0.0, 1.0])
H = 0.005


def turned(angle):
    return exp(angle * UP), HAND[1]


def test_a_hand_at_rest_means_the_place_where_the_body_was():
    intent = ReferenceTrajectory(VirtualCameraConfig(), HAND, BODY)
    for _ in range(100):
        R_fr, p_rf_in_f = intent.step(HAND, H)
    np.testing.assert_allclose(R_fr, BODY[0], atol=1e-12)
    np.testing.assert_allclose(p_rf_in_f, BODY[1], atol=1e-12)


def test_a_moved_hand_moves_it_at_once_and_alike():
    intent, shift = (
        ReferenceTrajectory(VirtualCameraConfig(), HAND, BODY),
        np.array([0.03, -0.02, 0.05]),
    )
    R_fr, p_rf_in_f = intent.step((HAND[0], HAND[1] + shift), H)
    np.testing.assert_allclose(R_fr, BODY[0], atol=1e-12)
    np.testing.assert_allclose(p_rf_in_f, BODY[1] + shift, atol=1e-12)


def test_a_turned_hand_swings_it_about_the_camera_after_the_low_pass():
    intent, hand = ReferenceTrajectory(VirtualCameraConfig(), HAND, BODY), turned(0.1)
    _, first = intent.step(hand, H)
    assert np.linalg.norm(first - BODY[1]) < 1e-3
    for _ in range(4000):
        R_fr, p_rf_in_f = intent.step(hand, H)
    np.testing.assert_allclose(R_fr, hand[0] @ BODY[0], atol=1e-4)
    np.testing.assert_allclose(p_rf_in_f, HAND[1] + hand[0] @ (BODY[1] - HAND[1]), atol=1e-3)


def test_without_a_low_pass_it_is_rigid_with_the_hand():
    free = replace(VirtualCameraConfig(), mode="off", max_speed_m_s=0.0)
    intent, hand = ReferenceTrajectory(free, HAND, BODY), turned(0.1)
    R_fr, p_rf_in_f = intent.step(hand, H)
    np.testing.assert_allclose(R_fr, hand[0] @ BODY[0], atol=1e-9)
    np.testing.assert_allclose(p_rf_in_f, HAND[1] + hand[0] @ (BODY[1] - HAND[1]), atol=1e-9)


def test_knobs_turned_in_flight_leave_what_was_meant_where_it_is():
    intent = ReferenceTrajectory(VirtualCameraConfig(), HAND, BODY)
    intent.step(turned(0.1), H)
    _, before = intent.step(turned(0.1), H)
    intent.tune(replace(VirtualCameraConfig(), mode="selective"))
    _, after = intent.step(turned(0.1), H)
    assert np.linalg.norm(after - before) < 2e-3
