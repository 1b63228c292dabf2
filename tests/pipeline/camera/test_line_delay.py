from dataclasses import replace

import numpy as np
import pytest

from pipeline.camera.fit import CameraFacts
from pipeline.camera.line_delay import MAX_S, LineDelay

FACTS = CameraFacts(20.0, 0.0, 1e-4, 0.02, 3e-4, 0.0, 0.003, 0.0, 0.01, np.zeros(3), np.ones(3))


def facts(value, sigma):
    return replace(FACTS, readout_s=value, readout_sigma_s=sigma)


def test_before_pictures_say_it_surely_the_file_counts():
    readout = LineDelay(0.015)
    assert not readout.learn(facts(0.02, 0.003))
    assert (readout.in_use_s, readout.is_learnt) == (0.015, False)


def test_what_is_sure_is_used():
    readout = LineDelay(0.015)
    assert readout.learn(facts(0.02, 0.0005))
    assert (readout.in_use_s, readout.is_learnt) == (0.02, True)


def test_what_agrees_with_the_one_in_use_changes_nothing_but_is_learnt():
    readout = LineDelay(0.02)
    assert not readout.learn(facts(0.0203, 0.0005))
    assert (readout.in_use_s, readout.is_learnt) == (0.02, True)


@pytest.mark.parametrize("value", [0.0, -0.02, 0.001])
def test_global_shutters_and_pictures_upside_down_are_learnt_as_well(value):
    readout = LineDelay(0.03)
    assert readout.learn(facts(value, 0.0004))
    assert readout.in_use_s == value


def test_no_camera_is_that_slow():
    assert not LineDelay(0.02).learn(facts(1.1 * MAX_S, 0.0005))
