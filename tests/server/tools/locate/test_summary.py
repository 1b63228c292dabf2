from types import SimpleNamespace

import numpy as np

from pipeline.camera.fit import CameraFacts
from pipeline.camera.lens import Camera
from pipeline.signals import RelativePose
from pipeline.vision.detection import FramePrior
from server.media.frame import MediaFrame
from server.tools.locate.history import History
from server.tools.locate.summary import camera_lines, summary
from server.tools.locate.work import Located

CAMERA = Camera(640, 480, np.diag([500.0, 500.0, 1.0]), "plumb_bob", np.zeros(4), 0.018)


def located(k, pose=None, reason=""):
    detection = SimpleNamespace(
        pose=pose, reason=reason, match=None, unbelieved=None, took_s={"detect": 1e-4 * (k + 1)}
    )
    return Located(MediaFrame(f"{k}.png", 0.1 * k, None), detection, 0.002, FramePrior())


def pose(leds):
    C = np.diag([0.003, 0.001, 0.002, 0.01, 0.01, 0.01]) ** 2
    return RelativePose(0.0, np.array([2.0, 0.0, 0.0]), np.eye(3), C, 0.25, leds)


def history(*frames):
    kept = History()
    for frame in frames:
        kept.add(frame)
    return kept


def test_a_run_is_summed_up():
    said = summary(history(located(0, pose(5)), located(1, pose(4)), located(2, reason="Dark.")))
    for line in (
        "frames         3, from 0.000 to 0.200 s",
        "found          2 (66.7 %)",
        "LEDs           5 in 1, 4 in 1 frames",
        "reprojection   0.25 px in the median, 0.25 px in the worst 5 %",
        "σ across       2.00 mm in the median, 2.00 mm in the worst 5 %",
        "σ in depth     3.00 mm in the median, 3.00 mm in the worst 5 %",
        "  detect            0.200    0.298    0.300",
        "     1  Dark.",
    ):
        assert line in said.splitlines()


def test_reasons_that_differ_in_numbers_only_are_one_the_commonest_first():
    reasons = ("Dark.", "3 lights, 1.5 px", "7 lights, 0.25 px")
    said = summary(history(*(located(k, reason=reason) for k, reason in enumerate(reasons))))
    assert said.splitlines()[-2:] == ["     2  … lights, … px", "     1  Dark."]


def test_where_nothing_was_found_nothing_is_said_of_its_quality():
    said = summary(history(located(0, reason="Dark.")))
    assert "found          0 (0.0 %)" in said
    assert "reprojection" not in said


def test_what_the_pictures_say_of_the_camera_is_told_with_its_uncertainty():
    facts = CameraFacts(
        *(1.0, 0.0051, 0.0003, 0.0195, 0.0004, 0.0, 0.002, 0.0, 0.01),
        np.zeros(3),
        np.full(3, 0.01),
    )
    watch = SimpleNamespace(facts=facts, complaint="It zooms.")
    learnt = Camera(640, 480, CAMERA.K, "plumb_bob", np.zeros(4), 0.0195)
    said = camera_lines(CAMERA, SimpleNamespace(monitor=watch, camera=learnt))
    assert "  dates        +5.1 ± 0.3 ms later than t_s says" in said
    assert "  readout      +19.5 ± 0.4 ms (in the file: 18.0 ms, corrected while it ran)" in said
    assert said[-1] == "  It zooms."
    unmoved = SimpleNamespace(monitor=SimpleNamespace(facts=None), camera=CAMERA)
    assert camera_lines(CAMERA, unmoved) == []
