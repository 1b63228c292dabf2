"""Cameras that lie: what they show, of which moment, and nothing before their time."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.sim.camera_faults import (
    BREATH,
    LATE_S,
    OPTICAL_RAD,
    ZOOMED,
    CameraFault,
    FaultyCamera,
)
from pipeline.frames import exp
from tests.pipeline.seeing import CAMERA

BEGIN_S = 1.0
TIMES = np.arange(0.0, 3.0, 1.0 / 30.0)


def tremor(t: float) -> np.ndarray:
    """A phone that trembles at 5 Hz by half a degree, about up and about left."""
    return exp(0.009 * np.sin(2.0 * np.pi * 5.0 * t) * np.array([0.0, 1.0, -1.0]))


def faulty(fault: CameraFault) -> FaultyCamera:
    return FaultyCamera(fault, CAMERA, tremor, BEGIN_S)


def shown(fault: CameraFault) -> np.ndarray:
    camera = faulty(fault)
    return np.array([camera.moment(t) for t in TIMES])


@pytest.mark.parametrize("fault", CameraFault)
def test_before_its_time_a_camera_is_honest(fault) -> None:
    camera = faulty(fault)
    for t in TIMES[TIMES < BEGIN_S]:
        assert camera.moment(t) == t
        assert np.array_equal(camera.at(t).K, CAMERA.K)


def test_what_lies_about_time_shows_the_past() -> None:
    lies = TIMES >= BEGIN_S
    first = TIMES[lies][0]
    assert set(shown(CameraFault.FROZEN)[lies]) == {first}
    assert np.array_equal(shown(CameraFault.TWICE)[lies][0::2], TIMES[lies][0::2])
    assert np.array_equal(shown(CameraFault.TWICE)[lies][1::2], TIMES[lies][0::2])
    assert len(set(shown(CameraFault.FOUR_TIMES)[lies])) == lies.sum() / 4
    late = shown(CameraFault.LATE)[lies]
    assert np.all(late >= BEGIN_S)
    assert np.allclose(late[-10:], TIMES[-10:] - LATE_S)


def test_what_lies_about_the_lens_scales_the_picture() -> None:
    assert faulty(CameraFault.ZOOM).at(2.0).K[0, 0] == pytest.approx(ZOOMED * CAMERA.K[0, 0])
    camera = faulty(CameraFault.BREATHING)
    scales = [camera.at(t).K[1, 1] / CAMERA.K[1, 1] for t in np.arange(1.0, 3.0, 0.01)]
    assert min(scales) == pytest.approx(1.0 - BREATH, abs=1e-4)
    assert max(scales) == pytest.approx(1.0 + BREATH, abs=1e-4)


@pytest.mark.parametrize(
    ("fault", "left"), [(CameraFault.ELECTRONIC, 0.4), (CameraFault.OPTICAL, 0.7)]
)
def test_a_stabiliser_takes_a_tremor_out_of_the_picture(fault, left) -> None:
    camera, far = faulty(fault), np.array([1e3, 0.0, 0.0])
    honest, held = [], []
    for t in TIMES:
        seen_by, in_c = camera.at(t), tremor(t).T @ far
        if t > BEGIN_S + 0.5:
            honest.append(CAMERA.pixels(in_c[None])[0])
            held.append(seen_by.pixels(in_c[None])[0])
            shift = np.abs(seen_by.K[:2, 2] - CAMERA.K[:2, 2]) / CAMERA.focal_px
            assert fault is CameraFault.ELECTRONIC or shift.max() <= OPTICAL_RAD * 1.001
    assert np.all(np.std(held, axis=0) < left * np.std(honest, axis=0))
