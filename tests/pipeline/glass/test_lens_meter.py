"""Lens of a phone, by a glass: found, or found wrong, where the glass shows it and nowhere else."""

import numpy as np
import pytest

from pipeline.camera.simple_lens import SimpleLens
from pipeline.frames import R_from_rpy
from pipeline.glass.lens_meter import SPREAD_S, VIEWS, GlassCorners, GlassViews, LensMeter
from pipeline.glass.window import Glass

GLASS = Glass(0.53, 0.30)
GUESSED = SimpleLens().camera(1280, 720)
NOISE_PX = 0.25
"""As corners are found in H.264."""


def found_by(meter):
    """What was found; there must be something."""
    assert meter.lens is not None
    return meter.lens


def filmed(lens, tilt_deg, seed=0, middle_px=(0.0, 0.0), hold_deg=0.5, views=VIEWS):
    """The meter after so many pictures of a glass whose upper edge leans away by `tilt_deg`."""
    rng, camera = np.random.default_rng(seed), lens.camera(1280, 720)
    meter = LensMeter(GUESSED, GLASS)
    for k in range(views):
        hand = np.deg2rad(hold_deg) * rng.normal(size=3)
        R_cg = R_from_rpy(np.array([0.0, -np.deg2rad(tilt_deg), 0.0]) + hand)
        in_c = np.array([0.6, 0.0, 0.0]) + 0.01 * rng.normal(size=3) + GLASS.fiducials() @ R_cg.T
        pixels = camera.pixels(in_c) + middle_px + NOISE_PX * rng.normal(size=(16, 2))
        meter.add_corners(GlassCorners(0.11 * k, np.arange(16), pixels))
    return meter


@pytest.mark.parametrize("focal", [0.65, 0.78, 0.88])
@pytest.mark.parametrize("k1", [-0.04, 0.04])
def test_a_lens_is_found_by_two_seconds_before_a_glass_that_leans(focal, k1):
    found = found_by(filmed(SimpleLens(focal, k1), 12.0))
    assert found.focal == pytest.approx(focal, rel=0.02)
    assert found.k1 == pytest.approx(k1, abs=0.01)


def test_a_middle_that_is_elsewhere_costs_a_few_percent():
    found = found_by(filmed(SimpleLens(0.68), 12.0, middle_px=(9.0, -9.0)))
    assert found.focal == pytest.approx(0.68, rel=0.06)
    assert abs(found.focal - 0.68) < 0.5 * abs(SimpleLens().focal - 0.68)


def test_a_glass_at_right_angles_tells_no_lens_until_the_phone_is_tilted():
    meter = filmed(SimpleLens(0.68), 0.0, hold_deg=0.2, views=3 * VIEWS)
    assert meter.lens is None
    tilted = filmed(SimpleLens(0.68), 15.0, views=1)
    for k in range(2 * VIEWS):
        view = tilted._views.kept[0]
        meter.add_corners(GlassCorners(100.0 + 0.11 * k, view.numbers, view.pixels))
    assert found_by(meter).focal == pytest.approx(0.68, rel=0.05)


def test_pictures_that_fit_no_lens_tell_none():
    meter, rng = LensMeter(GUESSED, GLASS), np.random.default_rng(1)
    pixels = SimpleLens(0.7).camera(1280, 720).pixels(np.array([0.6, 0.0, 0.0]) + GLASS.fiducials())
    for k in range(2 * VIEWS):
        shaken = pixels + 6.0 * rng.normal(size=pixels.shape)
        meter.add_corners(GlassCorners(0.11 * k, np.arange(16), shaken))
    assert meter.lens is None


def test_neighbours_and_halves_of_the_glass_do_not_count():
    camera = SimpleLens(0.7).camera(1280, 720)
    R_cg = R_from_rpy(np.array([0.0, -0.2, 0.0]))
    pixels = camera.pixels(np.array([0.6, 0.0, 0.0]) + GLASS.fiducials() @ R_cg.T)
    meter = LensMeter(GUESSED, GLASS)
    for k in range(2 * VIEWS):
        meter.add_corners(GlassCorners(0.001 * k, np.arange(16), pixels))
        meter.add_corners(GlassCorners(1.0 + k, np.arange(8), pixels[:8]))
    assert meter.lens is None
    assert len(meter._views.kept) == 1


def test_a_phone_that_is_not_tilted_costs_a_trial_now_and_then_only(monkeypatch):
    trials = []
    measured = GlassViews.lens

    def counted(views):
        trials.append(views)
        return measured(views)

    monkeypatch.setattr(GlassViews, "lens", counted)
    filmed(SimpleLens(0.68), 0.0, hold_deg=0.2, views=VIEWS + 20)
    assert len(trials) == 5


def checked(seconds=30.0, longer=1.0, tilt_deg=12.0, larger_glass=1.0, seed=0):
    """What a glass says of a calibrated camera whose focal length is `longer` in truth."""
    rng, known = np.random.default_rng(seed), SimpleLens(0.78, -0.03).camera(1280, 720)
    true = SimpleLens(0.78 * longer, -0.03).camera(1280, 720)
    views = GlassViews(known, Glass(0.53 * larger_glass, 0.30 * larger_glass), SPREAD_S)
    for k in range(int(10 * seconds)):
        hand = np.deg2rad(2.0) * rng.normal(size=3)
        R_cg = R_from_rpy(np.array([0.0, -np.deg2rad(tilt_deg), 0.0]) + hand)
        in_c = np.array([0.6, 0.0, 0.0]) + 0.01 * rng.normal(size=3) + GLASS.fiducials() @ R_cg.T
        pixels = true.pixels(in_c) + NOISE_PX * rng.normal(size=(16, 2))
        views.add(GlassCorners(0.1 * k, np.arange(16), pixels))
    return views.focal_error()


@pytest.mark.parametrize("longer", [0.95, 1.0, 1.04])
@pytest.mark.parametrize("larger_glass", [0.95, 1.0])
def test_a_focal_length_is_held_against_its_calibration_whatever_the_glass_is_said_to_measure(
    longer, larger_glass
):
    for seed in range(5):
        found = checked(longer=longer, larger_glass=larger_glass, seed=seed)
        assert found.sigma < 0.007
        assert abs(found.value - (longer - 1.0)) < 3.0 * found.sigma


def test_a_focal_length_is_not_judged_by_few_views_nor_by_a_glass_at_right_angles():
    assert checked(seconds=5.0) is None
    assert checked(tilt_deg=0.0) is None
