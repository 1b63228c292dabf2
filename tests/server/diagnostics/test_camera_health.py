"""What was learnt of a camera reaches the pages, and keeps the robot from being armed."""

from dataclasses import replace

import msgspec
import numpy as np

from pipeline.camera.exposure import ADVICE, ExposureHint
from pipeline.camera.fit import CameraFacts
from pipeline.vision.camera_lies import SHIFTED
from pipeline.vision.visual_front_end import VisualFrontEnd, warm_up
from pipeline.vision_config import GatesConfig
from server.diagnostics.camera_health import health
from server.protocol.camera_messages import CameraHealth
from tests.pipeline.seeing import CAMERA, LEDS_IN_B

FACTS = CameraFacts(
    20.0, 0.0301, 2e-4, 0.0203, 4e-4, 0.031, 0.003, 0.012, 0.008, np.zeros(3), np.ones(3)
)


def front_end():
    return VisualFrontEnd(CAMERA, LEDS_IN_B, GatesConfig())


def test_before_the_phone_moved_only_the_calibration_is_known():
    told = health(front_end())
    assert told == CameraHealth("", "", "", None, 1e3 * CAMERA.readout_s, readout_learnt=False)
    assert msgspec.json.decode(msgspec.json.encode(told))["larger_percent"] is None


def test_what_was_learnt_is_told_in_the_units_of_screens():
    eye = front_end()
    eye.monitor.facts, eye.monitor.complaint = FACTS, "Another lens."
    eye.exposure.hint = ExposureHint.TOO_BRIGHT
    assert eye.readout.learn(FACTS)
    told = health(eye)
    assert (told.complaint, told.hint) == ("Another lens.", "too_bright")
    assert told.advice == ADVICE[ExposureHint.TOO_BRIGHT]
    assert (told.readout_ms, told.readout_sigma_ms, told.readout_learnt) == (20.3, 0.4, True)
    assert (told.time_offset_ms, told.time_offset_sigma_ms) == (30.1, 0.2)
    assert (told.larger_percent, told.larger_sigma_percent) == (3.1, 0.3)
    assert (told.held_percent, told.held_sigma_percent) == (1.2, 0.8)


def test_a_lie_of_the_camera_is_told():
    eye = front_end()
    eye.check.complaint = SHIFTED
    assert health(eye).complaint == SHIFTED


def test_pictures_are_looked_at_as_of_when_they_were_taken():
    eye = front_end()
    assert eye.offset_s == 0.0
    eye.monitor.facts = replace(FACTS, offset_s=-0.02)
    assert eye.offset_s == -0.02


def test_warming_up_leaves_nothing_to_compile():
    from pipeline.camera.block_kernels import put_sums
    from pipeline.camera.exposure_kernels import put_exposures

    warm_up()
    assert put_sums.nopython_signatures
    assert put_exposures.nopython_signatures
