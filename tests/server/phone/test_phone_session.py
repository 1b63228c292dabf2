"""One operator's phone: what it lacks, in words, and what it says, to control."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from hardware.camera_file import CAMERAS
from pipeline.camera import verdict as camera_verdict
from pipeline.camera.simple_lens import SimpleLens
from pipeline.estimation import sensor_validation
from pipeline.frames import exp
from pipeline.signals import (
    LedRays,
    PhoneImu,
    RelativePose,
    Spots,
    StampOffset,
    TouchState,
    VisionMeasurement,
)
from pipeline.vision import camera_lies, repeated_frames
from pipeline.vision.detection import Detection
from pipeline.vision.rays import NO_RAYS
from server.diagnostics.phone_check.measure import figures
from server.phone.ingest import UNHEARD_S, EncodedFrame
from server.phone.phone_session import STALE_S, PhoneSession
from server.protocol.calibration_messages import Calibrate
from server.protocol.messages import Hello
from server.protocol.wire import VERSION, WireError
from server.protocol.wire_records import Motion, Ping, Pong, Record, Touch
from server.virtual_phone.phone_script import DEVICE
from tests.pipeline.seeing import CAMERA, rays_at
from tests.server.house import JPEG, ROBOT, control_status

NO_SPOTS = Spots(np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0))

FLAT = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), None, 0)


class Rig:
    """A phone in virtual time; its clock is ours."""

    def __init__(self, device: str, cameras: Path = CAMERAS) -> None:
        self.t = 50.0
        self.to_control: list[object] = []
        self.taken: list[int] = []
        hello = Hello(VERSION, "operator", device)
        self.phone = PhoneSession(
            hello,
            ROBOT,
            [cameras],
            self.to_control.append,
            lambda: self.t,
            self.taken.append,
            lambda: None,
        )
        self.nonce = 0

    def say(self, body: object, sequence: int = 1) -> None:
        self.phone.take(Record(sequence, int(1e6 * self.t), body), self.t)

    def synchronise(self) -> None:
        for _ in range(6):
            self.synchronise_once()
            self.t += 0.05

    def synchronise_once(self) -> None:
        ping = self.phone.ingest.ping(self.t)
        assert isinstance(ping.body, Ping)
        self.nonce = ping.body.nonce
        self.say(Pong(self.nonce, ping.t_us))

    def settle(self) -> None:
        """A second of motion at rest: the sensors pass what can be tested without pictures."""
        for _ in range(60):
            self.t += 1.0 / 60.0
            self.synchronise_once()
            self.say(FLAT)

    def why(self, busy: str = "") -> list[str]:
        return self.phone.refusals(self.t, busy)


@pytest.fixture
def rig():
    made = Rig("Nobody's phone")
    yield made
    made.phone.close()


def test_each_thing_that_lacks_is_told_to_the_person_who_can_mend_it(rig):
    assert rig.why() == ["The phone's clock is not known yet. Wait a moment."]
    rig.synchronise()
    motion, pictures = rig.why()
    assert "motion sensors" in motion
    assert "camera" in pictures
    rig.say(FLAT)
    assert rig.why() == [sensor_validation.WAIT, pictures]
    rig.settle()
    assert rig.why() == [pictures]
    rig.say(Touch(False, False, 0, rig.nonce))
    assert rig.why() == ["The page on the phone is hidden: bring it to the front.", pictures]
    rig.t += STALE_S + 0.1
    assert motion in rig.why()


def test_on_a_busy_computer_nobody_is_asked_for_a_permission_that_was_given(rig):
    busy = "The server's computer is too busy."
    assert rig.why(busy)[-1] == busy
    rig.synchronise()
    motion, also, pictures = rig.why(busy)
    assert also == busy
    assert "allow them" in motion
    assert "allow the camera" in pictures
    rig.settle()
    rig.t += STALE_S + 0.1
    assert rig.why(busy) == [busy, pictures]


def test_a_virtual_phone_is_asked_for_no_permission():
    rig = Rig(DEVICE)
    rig.synchronise()
    motion, pictures = rig.why()
    assert motion.endswith("silent: wait a moment.")
    assert pictures == "No pictures from the phone: wait a moment."
    assert rig.why("too busy") == ["too busy"]
    rig.phone.close()


def test_a_camera_without_a_calibration_is_told_as_long_as_it_films(rig):
    rig.synchronise()
    rig.settle()
    for sequence in (1, 2):
        with pytest.raises(WireError) as refused:
            rig.say(JPEG, sequence)
        assert refused.value.code == "calibration"
        assert "Nobody" in refused.value.allowed or "nobody" in refused.value.allowed
    assert rig.taken == [1, 2]
    (why,) = rig.why()
    assert why.startswith("The camera is not calibrated: ")


def test_after_a_calibration_nothing_is_said_of_the_camera_before_the_next_picture(rig):
    rig.synchronise()
    rig.settle()
    with pytest.raises(WireError):
        rig.say(JPEG, 1)
    assert rig.phone.calibration().phase == "needed"
    rig.phone.calibrate(Calibrate("stop"))
    assert rig.phone.calibration().phase == "off"
    with pytest.raises(WireError):
        rig.say(JPEG, 2)
    assert rig.phone.calibration().phase == "needed"


def test_motion_and_touch_reach_control_at_their_own_times(rig):
    rig.say(FLAT)
    assert rig.to_control == []
    rig.synchronise()
    rig.say(FLAT)
    rig.say(Touch(True, True, 3, rig.nonce))
    imu, operator = rig.to_control
    assert isinstance(imu, PhoneImu)
    assert isinstance(operator, TouchState)
    assert imu.t == pytest.approx(rig.t, abs=1e-3)
    assert operator.t == pytest.approx(rig.t, abs=1e-3)
    assert operator.held


def test_a_hidden_page_holds_no_button(rig):
    rig.synchronise()
    rig.say(Touch(True, False, 3, rig.nonce))
    assert not rig.to_control[-1].held


def test_hello_is_the_first_sign_of_life_and_a_page_that_hears_nothing_gives_none(rig):
    rig.t += 1.0
    assert rig.phone.silent_for(rig.t) == pytest.approx(1.0)
    rig.synchronise()
    rig.t += 2.0
    rig.say(Touch(False, True, 0, rig.nonce))
    assert rig.phone.silent_for(rig.t) == pytest.approx(2.05 - UNHEARD_S)


def test_what_its_check_is_made_of_is_as_it_was_whatever_comes_while_that_is_judged(rig):
    rig.synchronise()
    rig.settle()
    series = rig.phone.series(rig.t, 60.0)
    before = figures(series)
    ping = rig.phone.ingest.ping(rig.t)
    late = Record(1, int(1e6 * rig.t) + 10_000_000, Pong(ping.body.nonce, ping.t_us))
    rig.phone.take(late, rig.t)  # its clock has jumped, it seems
    assert not rig.phone.ingest.clock.ready
    assert figures(series).clock_error_ms == before.clock_error_ms


def test_pictures_that_cannot_be_dated_are_given_back(rig):
    rig.say(JPEG, 9)
    assert rig.taken == [9]


def test_a_calibrated_phone_has_eyes_until_it_leaves():
    rig = Rig(DEVICE)
    rig.synchronise()
    rig.settle()
    rig.say(JPEG)
    assert rig.phone.vision is not None
    assert rig.phone.camera_problem == ""
    assert rig.why() == ["The robot is not seen."]
    rig.t += STALE_S + 0.1
    assert any("No pictures" in why for why in rig.why())
    with pytest.raises(WireError, match="calibrat"):
        rig.say(replace(JPEG, width=640, height=200))
    assert rig.phone.vision is None
    rig.phone.close()


def test_the_profile_of_a_camera_turns_the_motion_as_long_as_it_films(tmp_path):
    R_ci = exp(np.array([0.03, 0.02, -0.04]))
    table = yaml.safe_load((CAMERAS / "virtual_phone.yaml").read_text())
    table["camera_imu"] = {"rotation": R_ci.ravel().tolist(), "time_offset_s": 0.0}
    (tmp_path / "phone.yaml").write_text(yaml.safe_dump(table))
    rig = Rig(DEVICE, tmp_path)
    rig.settle()
    plain = rig.to_control[-1]
    rig.say(JPEG)
    rig.t += 0.01
    rig.say(FLAT)
    turned = rig.to_control[-1]
    assert isinstance(plain, PhoneImu)
    assert isinstance(turned, PhoneImu)
    np.testing.assert_allclose(turned.a_m_cf_in_c, R_ci @ plain.a_m_cf_in_c)
    rig.phone.close()
    assert (rig.phone.ingest.extrinsics.R_ci == np.eye(3)).all()


SHOT = EncodedFrame(49.9, 50.0, 1, JPEG)
FEW = rays_at(49.9, np.array([2.5, 0.0, 0.0]), np.eye(3), leds=[0, 2])


def sighting_of(pose: RelativePose | None, rays: LedRays) -> Detection:
    return Detection(49.9, pose, rays, NO_SPOTS, None, "2 of 5 LEDs seen.")


def test_a_few_leds_reach_control_without_a_pose_and_nothing_as_nothing(rig):
    rig.phone._sighted(CAMERA, sighting_of(None, NO_RAYS), SHOT)
    assert rig.to_control == []
    rig.phone._sighted(CAMERA, sighting_of(None, FEW), SHOT)
    (said,) = rig.to_control
    assert isinstance(said, VisionMeasurement)
    assert said.pose is None
    assert said.rays.led.tolist() == [0, 2]
    assert said.half_field == CAMERA.half_field


def test_only_a_pose_counts_as_seeing_the_robot(rig):
    pose = RelativePose(49.9, np.array([2.5, 0.0, 0.0]), np.eye(3), np.eye(6), 0.1, 5)
    rig.phone._sighted(CAMERA, sighting_of(None, FEW), SHOT)
    assert rig.phone.meters["pose"].age(rig.t) > STALE_S
    rig.phone._sighted(CAMERA, sighting_of(pose, FEW), SHOT)
    assert rig.phone.meters["pose"].age(rig.t) < STALE_S
    assert rig.to_control[-1].pose.leds == 5


def test_a_picture_that_comes_again_is_no_news(rig):
    pose = RelativePose(49.9, np.array([2.5, 0.0, 0.0]), np.eye(3), np.eye(6), 0.1, 5)
    rig.phone._sighted(CAMERA, sighting_of(pose, FEW), SHOT)
    told = list(rig.to_control)
    rig.t += 2.0 * STALE_S
    rig.phone._sighted(CAMERA, replace(sighting_of(None, NO_RAYS), comes_again=True), SHOT)
    assert rig.to_control == told
    assert rig.phone.detection.pose is pose
    assert rig.phone.meters["pose"].age(rig.t) > STALE_S


def test_a_camera_that_is_not_the_calibrated_one_keeps_the_robot_disarmed():
    rig = Rig(DEVICE)
    try:
        rig.settle()
        rig.say(JPEG)
        assert rig.phone.vision is not None
        assert not [why for why in rig.why() if "stabilisation" in why]
        rig.phone.vision.front_end.monitor.complaint = camera_verdict.STABILISED
        assert rig.why()[-1] == camera_verdict.STABILISED
        rig.phone.vision.front_end.check.complaint = camera_lies.SHIFTED
        assert rig.why()[-1] == camera_lies.SHIFTED
        rig.phone.vision.front_end.repeats.complaint = repeated_frames.STANDS
        assert rig.why()[-1] == repeated_frames.STANDS
    finally:
        rig.phone.close()


SMALL = replace(JPEG, width=960, height=540, shrunk=1)


def test_pictures_that_the_page_made_smaller_are_those_of_the_same_camera():
    rig = Rig(DEVICE)
    try:
        rig.synchronise()
        rig.say(JPEG)
        full = rig.phone.vision._frame_pipeline.camera
        rig.say(SMALL, 2)
        small = rig.phone.vision._frame_pipeline.camera
        assert (small.width, small.height) == (960, 540)
        points = np.array([[1.0, 0.2, -0.1], [2.0, -0.5, 0.3]])
        np.testing.assert_allclose(
            small.pixels(points) + 0.5, 0.75 * (full.pixels(points) + 0.5), rtol=1e-12
        )
    finally:
        rig.phone.close()


def said_of_the_next_eyes(rig, *records):
    """What is said of the camera after `records`; that the lens zooms was said before."""
    rig.settle()
    rig.say(JPEG, 1)
    eyes = rig.phone.vision.front_end
    eyes.monitor.complaint = eyes.check.complaint = "It zooms."
    for k, record in enumerate(records, 2):
        rig.t += 0.02
        rig.say(record, k)
    front_end = rig.phone.vision.front_end
    assert front_end is not eyes
    return front_end.monitor.complaint, front_end.check.complaint


ASIDE = (replace(FLAT, screen_angle_deg=90), replace(JPEG, screen_angle_deg=90))


@pytest.mark.parametrize("records", [ASIDE, (SMALL,), (replace(JPEG, screen_angle_deg=180),)])
def test_what_is_wrong_with_a_lens_is_not_forgotten_as_its_picture_turns_or_shrinks(records):
    rig = Rig(DEVICE)
    try:
        assert said_of_the_next_eyes(rig, *records) == ("It zooms.", "It zooms.")
    finally:
        rig.phone.close()


def test_a_calibration_that_was_left_mends_no_camera(tmp_path):
    rig = Rig(DEVICE)
    rig.phone._profiles = tmp_path
    try:
        rig.settle()
        rig.say(JPEG, 1)
        rig.phone.vision.front_end.monitor.complaint = "It zooms."
        for what in ("start", "stop"):
            rig.phone.calibrate(Calibrate(what))
        rig.say(JPEG, 2)
        assert rig.phone.vision.front_end.complaint == "It zooms."
    finally:
        rig.phone.close()


def test_another_calibration_is_judged_by_itself():
    rig = Rig(DEVICE)
    try:
        other = replace(JPEG, width=640, height=480)
        assert said_of_the_next_eyes(rig, other) == ("", "")
    finally:
        rig.phone.close()


@pytest.mark.parametrize("size", [{"shrunk": 0}, {"shrunk": 2}, {"height": 528}])
def test_pictures_of_a_size_nobody_calibrated_are_refused_until_the_size_is_right_again(size):
    rig = Rig(DEVICE)
    try:
        rig.synchronise()
        rig.say(JPEG)
        for sequence in (2, 3):
            with pytest.raises(WireError, match="no calibration") as refused:
                rig.say(replace(SMALL, **size), sequence)
            assert refused.value.code == "calibration"
            assert rig.phone.vision is None
        assert any("The camera is not calibrated" in why for why in rig.why())
        rig.say(JPEG, 4)
        assert rig.phone.vision is not None
        assert not any("not calibrated" in why for why in rig.why())
    finally:
        rig.phone.close()


def test_a_recording_is_not_told_of_a_calibration_that_its_pictures_have_not(rig):
    rig.phone.device = DEVICE
    rig.synchronise()
    rig.say(JPEG)
    assert rig.phone.camera_text != ""
    with pytest.raises(WireError, match="no calibration"):
        rig.say(replace(JPEG, width=640, height=200), 2)
    assert rig.phone.camera_text == ""


class OpenableScreen:
    """A place of a screen that only says whether one is there."""

    is_open, is_shown, why = False, False, ""

    def __init__(self) -> None:
        self.lens: SimpleLens | None = None
        self.time_offset: StampOffset | None = None

    def add_imu(self, sample: object) -> None:
        """Nothing of it."""

    def add_detection(self, *seen: object) -> None:
        """Nothing of it."""

    def lens_of(self, camera: object) -> SimpleLens | None:
        """Whatever a test says."""
        return self.lens


def test_only_before_a_screen_a_camera_without_a_calibration_may_be_guessed() -> None:
    rig, screen = Rig("nobody's phone"), OpenableScreen()
    rig.phone._screen = screen  # type: ignore[assignment]
    rig.synchronise()
    with pytest.raises(WireError):
        rig.say(JPEG, 1)
    assert "no calibration" in rig.phone.camera_problem
    screen.is_open = True
    rig.say(JPEG, 2)
    assert rig.phone.camera_problem == ""
    assert rig.phone.vision is not None
    focal_px = rig.phone.vision.front_end.camera.focal_px
    assert focal_px == SimpleLens().focal * JPEG.width
    screen.lens = SimpleLens(0.7)
    rig.say(JPEG, 3)
    eyes = rig.phone.vision
    assert eyes.front_end.camera.focal_px == 0.7 * JPEG.width
    screen.lens = None
    rig.say(JPEG, 4)
    assert rig.phone.vision is eyes
    rig.say(replace(JPEG, screen_angle_deg=90), 5)  # the same lens
    assert rig.phone.vision is not eyes
    assert rig.phone.vision.front_end.camera.focal_px == 0.7 * JPEG.width
    rig.phone.close()


def test_why_a_screen_shows_no_robot_yet_is_told_in_place_of_not_seeing_it() -> None:
    rig = Rig(DEVICE)
    rig.synchronise()
    rig.settle()
    rig.say(JPEG)
    rig.phone._screen = screen = OpenableScreen()  # type: ignore[assignment]
    assert rig.why() == ["The robot is not seen."]
    screen.why = "Hold the phone still: measuring how late this screen is."
    assert rig.why() == [screen.why]
    rig.phone.close()


def test_eyes_are_told_when_pictures_were_taken_by_the_glass_that_they_film() -> None:
    rig, screen = Rig(DEVICE), OpenableScreen()
    rig.phone._screen = screen  # type: ignore[assignment]
    rig.synchronise()
    rig.say(JPEG)
    assert rig.phone.vision is not None
    eyes = rig.phone.vision.front_end
    screen.time_offset = StampOffset(0.008, 0.001)
    rig.t += 0.02
    rig.say(FLAT)
    assert eyes.offset_s == 0.0  # it films a robot that is there, if any
    screen.is_shown = True
    for screen.time_offset in (None, StampOffset(0.004, 0.001), None):
        rig.t += 0.02
        rig.say(FLAT)
        assert eyes.offset_s == (screen.time_offset.value if screen.time_offset else 0.0)
    rig.phone.close()


def test_eyes_that_know_motion_in_other_axes_look_anew() -> None:
    rig = Rig(DEVICE)
    rig.synchronise()
    eyes = []
    for k, angle in enumerate((0, 0, 90, 90)):
        rig.t += 0.02
        rig.say(replace(FLAT, screen_angle_deg=angle), k)
        rig.say(JPEG, k)
        eyes.append(rig.phone.vision)
    assert eyes[0] is eyes[1] is not eyes[2] is eyes[3]
    assert None not in eyes
    rig.phone.close()


def test_the_page_is_told_what_its_picture_shows_as_often_as_it_is_drawn() -> None:
    rig = Rig(DEVICE)
    assert rig.phone.sight(control_status(), rig.t) is None  # no picture yet: no size
    rig.synchronise()
    rig.say(JPEG)
    said = [rig.phone.sight(control_status(), rig.t + 0.02 * k) for k in range(100)]
    rig.phone.close()
    told = [one for one in said if one is not None]
    assert (told[0].width, told[0].height) == (JPEG.width, JPEG.height)
    assert 24 <= len(told) <= 31


def test_eyes_hear_the_twist_of_a_robot_that_has_no_motion_sensors() -> None:
    """Without it no picture can be held against how such a robot moves."""
    rig, heard, twist = Rig(DEVICE), [], (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    rig.synchronise()
    rig.say(JPEG)
    assert rig.phone.vision is not None
    rig.phone.vision.front_end.add_imu = lambda *samples: heard.extend(samples)
    rows = [(t, *6 * [0.0]) for t in (1.0, 1.005)]
    rig.phone.add_status(control_status(body_samples=rows, body_twists=[(1.005, *twist)]))
    rig.phone.close()
    before, last = heard
    assert (before.twist_m_bf_in_b, last.t) == (None, 1.005)
    assert tuple(last.twist_m_bf_in_b) == twist
