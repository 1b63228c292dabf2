"""An arm by its model: where its tip is, what moves it, and what is said of one that is no arm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from hardware.arm.arm_model import ArmError, ArmModel, jacobian_rates
from pipeline.frames import Array, log
from tests.hardware.arm.arms import ARM, HOME, PARAMETERS, SO101, postures

STEP = 1e-6


def test_at_home_its_tip_is_level_before_its_base() -> None:
    R_kb, p_bk_in_k = ARM.tip(HOME)
    assert np.degrees(np.linalg.norm(log(R_kb))) < 0.1
    assert p_bk_in_k == pytest.approx([0.315, 0.0, 0.170], abs=0.001)


@pytest.mark.parametrize("q", postures(1, 10))
def test_its_jacobian_is_how_its_tip_moves_in_the_axes_of_its_body(q: Array) -> None:
    moved = []
    for step in STEP * np.eye(len(q)):
        (R_before, p_before), (R_after, p_after) = ARM.tip(q - step), ARM.tip(q + step)
        R_kb = ARM.tip(q)[0]
        turn = log(R_before.T @ R_after)
        moved.append(np.append(R_kb.T @ (p_after - p_before), turn) / (2.0 * STEP))
    assert ARM.jacobian(q) == pytest.approx(np.array(moved).T, abs=1e-6)


@pytest.mark.parametrize("q", postures(2, 10))
def test_how_its_jacobian_changes_is_its_difference(q: Array) -> None:
    steps = 1e-5 * np.eye(len(q))
    changes = [(ARM.jacobian(q + one) - ARM.jacobian(q - one)) / 2e-5 for one in steps]
    assert jacobian_rates(ARM.jacobian(q)) == pytest.approx(np.array(changes), abs=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"model": Path("nowhere.xml")}, "arm.model: "),
        ({"tip": "finger"}, "arm.tip: sites of so101.xml, which has none that is called 'finger'"),
        (
            {"keeps_apart": (("palm_ball", "wall"),)},
            "arm.keeps_apart: geoms of so101.xml, which has",
        ),
        ({"tool_joint": "thumb"}, "arm.tool_joint: joints of so101.xml, which has none"),
        ({"tool_joint": "wrist_roll"}, "arm.tool_joint: a joint behind the tip's, with a range"),
        ({"home": HOME[:4]}, "arm.home_deg: 5 angles: of shoulder_pan, shoulder_lift, elbow_flex"),
        ({"home": HOME + 2.0}, "arm.home_deg: within shoulder_pan -110 to 110, "),
    ],
)
def test_what_can_not_be_an_arm_is_refused_with_what_would_be_allowed(
    change: dict[str, object], words: str
) -> None:
    with pytest.raises(ArmError) as caught:
        ArmModel(replace(PARAMETERS, **change))
    assert str(caught.value).startswith(words)


MODELS = {
    "arm.tip: a site that hinges move, and nothing else": '<joint type="slide" range="0 1"/>',
    "arm.model: a range for each joint before the tip": '<joint axis="0 0 1"/>',
}


@pytest.mark.parametrize("words", MODELS)
def test_joints_of_other_kinds_are_refused(words: str, tmp_path: Path) -> None:
    body = f'<body>{MODELS[words]}<geom size="0.1"/><site name="tip"/></body>'
    file = tmp_path / "other.xml"
    file.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    with pytest.raises(ArmError, match=words):
        ArmModel(replace(PARAMETERS, model=file, keeps_apart=(), home=np.zeros(1)))


@pytest.mark.parametrize(
    ("aside_m", "above_m", "hidden"),
    [(0.0, 0.0, 0), (0.0, 0.3, 0), (0.15, 0.0, 0), (-0.3, 0.0, 0), (0.3, 0.0, 1)],
)
def test_the_arm_hides_at_most_one_of_its_leds_from_a_phone_behind_it(
    aside_m: float, above_m: float, hidden: int
) -> None:
    """From where one begins, and from beside and above that: rays to LEDs meet nothing."""
    data = mujoco.MjData(ARM.model)
    data.qpos[:] = ARM.configuration(HOME)
    mujoco.mj_kinematics(ARM.model, data)
    R_kb, p_bk_in_k = ARM.tip(HOME)
    phone = p_bk_in_k + np.array([-SO101.start.distance, aside_m, SO101.start.above + above_m])
    solid, met = np.array([1, 1, 1, 0, 1, 1], dtype=np.uint8), np.full(1, -1, dtype=np.int32)
    ways = [p_bk_in_k + R_kb @ led - phone for led in SO101.robot.leds_in_b]
    shares = [mujoco.mj_ray(ARM.model, data, phone, way, solid, 1, -1, met) for way in ways]
    assert sum(0.0 <= share < 1.0 for share in shares) == hidden
