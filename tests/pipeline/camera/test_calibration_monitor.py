"""The camera watch: faults are found within 20 s of motion, a good camera is left in peace."""

from functools import cache

import numpy as np
import pytest

from hardware.sim.world.sensors import body_samples, phone_samples
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.camera import verdict as camera_verdict
from pipeline.camera.calibration_monitor import CalibrationMonitor
from pipeline.imu_stream import ImuStreams
from pipeline.signals import BodyImu, PhoneImu, RelativePose
from pipeline.timing.camera_imu_delay import CameraImuDelay
from tests.pipeline.faulty_camera import CAMERA, Faults, looks, watched

FOUND_S = 20.0
MOVING, STEADY = (0.03, float(np.deg2rad(1.0))), (0.005, float(np.deg2rad(0.4)))
STILL = (5e-4, float(np.deg2rad(0.03)))
USUAL = Faults(
    readout=0.025, led_m=0.001, focal=1.004, middle_px=(8.0, -8.0), gyro=1.004
)  # nothing is perfect
DATED_S = 0.03


@cache
def world(hand=MOVING, duration=20.5, seed=5):
    return World(
        WorldOptions(
            seed=seed,
            duration=duration,
            hand_sigma=hand,
            time_offset=DATED_S,
            tremor_relaxation=0.15,
        )
    )


def complaints(faults, hand=MOVING, **options):
    """[(t, words)] while there was a complaint, and the watch."""
    said = []

    def observe(watch):
        if watch.complaint and (not said or said[-1][1] != watch.complaint):
            said.append((watch.facts.t, watch.complaint))

    return said, watched(world(hand), faults, observe=observe, **options)


@pytest.mark.parametrize("hand", [MOVING, pytest.param(STEADY, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("faults", "words"),
    [
        (Faults(zoom=1.1, readout=0.02), "% larger than when it was calibrated"),
        (Faults(zoom=0.9), "% smaller than when it was calibrated"),
        (Faults(zoom=1.03, readout=0.015, led_m=0.001), "% larger than they should"),
        (Faults(low_pass_hz=1.0, readout=0.015), "moves less than the phone turns"),
        (Faults(low_pass_hz=0.5), "moves less than the phone turns"),
        (Faults(smooth_s=0.3), "moves less than the phone turns"),
        (Faults(low_pass_hz=1.0, share=0.5), "moves less than the phone turns"),
    ],
)
def test_a_camera_that_is_not_the_calibrated_one_is_found_within_20_s_of_motion(
    faults, words, hand
):
    said, _ = complaints(faults, hand)
    assert said
    assert words in said[0][1]
    assert said[0][0] < FOUND_S


def test_a_stabiliser_is_found_even_if_nobody_knows_how_wrong_the_stamps_are():
    said, _ = complaints(Faults(low_pass_hz=0.7), coarse=False)
    assert said[0][1] == camera_verdict.STABILISED


def test_a_picture_whose_middle_is_elsewhere_is_found():
    said, _ = complaints(Faults(middle_px=(0.0, 90.0)))
    assert "beside where its motion sensors say" in said[0][1]


@pytest.mark.parametrize("hand", [MOVING, pytest.param(STEADY, marks=pytest.mark.slow)])
def test_readout_and_time_offset_are_learnt_from_a_hand(hand):
    watch = watched(world(hand), USUAL)
    facts = watch.facts
    assert abs(facts.readout_s / USUAL.readout - 1.0) < 0.15
    assert abs(facts.offset_s - DATED_S) < 0.005
    assert abs(facts.readout_s - USUAL.readout) < 4.0 * facts.readout_sigma_s
    assert watch.complaint == ""


def test_the_sign_of_the_readout_says_which_row_comes_first():
    assert watched(world(), Faults(readout=-0.02)).facts.readout_s == pytest.approx(-0.02, abs=2e-3)


def test_the_time_offset_is_found_without_any_hint():
    facts = watched(world(), Faults(readout=0.02), coarse=False).facts
    assert facts.offset_s == pytest.approx(DATED_S, abs=2e-3)


def test_a_hand_that_only_trembles_is_not_judged():
    assert watched(world(STILL), Faults(zoom=1.1)).facts is None


def test_pictures_without_motion_samples_teach_nothing():
    watch = CalibrationMonitor(CAMERA, LEDS_IN_B, ImuStreams())
    assert not any(watch.add_observation(look, None) for look in looks(world(), Faults()))
    assert watch.facts is None


def test_a_gap_in_the_motion_samples_spoils_no_more_than_its_block():
    said, lost = [], (6.0, 6.5)

    def observe(watch):
        said.append(watch.complaint)

    watched(
        world(),
        USUAL,
        observe=observe,
        spoil=lambda s: (
            None if isinstance(s, PhoneImu | BodyImu) and lost[0] < s.t < lost[1] else s
        ),
    )
    assert not any(said)


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_a_browser_that_reads_its_sensors_seldom_is_no_fault_of_the_camera(seed):
    """Samples 30 to 90 ms apart, as of a page that hardly gets a processor."""
    rng, due, said = np.random.default_rng(seed), 0.0, []

    def seldom(sample):
        nonlocal due
        if not isinstance(sample, PhoneImu):
            return sample
        if sample.t < due:
            return None
        due = sample.t + rng.uniform(0.02, 0.08)
        return sample

    watched(
        world(duration=30.0, seed=seed),
        USUAL,
        seed,
        observe=lambda watch: said.append(watch.complaint),
        spoil=seldom,
    )
    assert not any(said)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "hand"), [(1, MOVING), (2, STEADY), (3, (0.05, float(np.deg2rad(3.0)))), (4, MOVING)]
)
def test_ten_minutes_of_usual_use_raise_no_false_alarm(seed, hand):
    """A quarter of them each; tremor, rolling shutter, late stamps, a file that is a bit wrong."""
    said = []
    watch = watched(
        world(hand, 150.0, seed), USUAL, seed, observe=lambda watch: said.append(watch.complaint)
    )
    assert not any(said)
    assert abs(watch.facts.readout_s / USUAL.readout - 1.0) < 0.15
    assert abs(watch.facts.offset_s - DATED_S) < 0.005


@pytest.mark.slow
@pytest.mark.parametrize("readout", [0.0, 0.03])
def test_the_coarse_offset_of_the_stamps_bears_a_rolling_shutter_nobody_models(readout):
    """To 5 ms within 20 s of motion, poses untreated."""
    imus = ImuStreams()
    search = CameraImuDelay(imus)
    samples = sorted([*phone_samples(world()), *body_samples(world())], key=lambda event: event[0])
    for look, arrival in zip(
        looks(world(), Faults(readout=readout)), world().pictures.arrival, strict=True
    ):
        while samples and samples[0][0] <= arrival:
            imus.add(samples.pop(0)[1])
        C = np.diag([*[1e-8] * 3, *[1e-6] * 3])
        search.add_pose(RelativePose(look.t, look.p_bc_in_c, look.R_cb, C, 0.1, 5))
    assert search.offset is not None
    assert search.offset.value == pytest.approx(DATED_S, abs=0.005)
