"""The page's calibration at the server: who may, when, and what becomes of the film."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from hardware.camera_file import CAMERAS, load_camera
from pipeline.signals import Mode
from server.calibration.job import CalibrationOutcome
from server.calibration.verdict import Verdict
from server.phone.calibration_control import CalibrationControl
from server.phone.calibration_session import CalibrationSession
from server.phone.ingest import EncodedFrame
from server.phone.phone_session import PhoneSession
from server.protocol.calibration_messages import Calibrate, Calibration
from server.protocol.messages import Hello, decode_from_server, encode_message
from server.protocol.wire import MAX_MESSAGE_BYTES, VERSION, WireError
from server.protocol.wire_records import Codec, Picture
from tests.server.calibration.filming import Motion, Phone, Studio, corner_film, scaled
from tests.server.house import ROBOT, control_status

SMALL = scaled(Phone(), 640)
SHAPE = (640, 360, 90)


def frame(sequence, luma, shape=SHAPE):
    data = cv2.imencode(".jpg", luma)[1].tobytes()
    picture = Picture(Codec.JPEG, True, *shape, data)  # type: ignore[call-arg]
    return EncodedFrame(10.0 + sequence / 30.0, 10.0, sequence, picture)


@pytest.fixture(scope="module")
def board():
    return Studio(SMALL).picture(Motion(), 1.0)


@pytest.fixture
def wizard(tmp_path):
    wanted = []
    made: Any = CalibrationSession(
        "a phone", SHAPE, tmp_path, lambda _n: None, lambda: wanted.append(1)
    )
    made.wanted = wanted
    yield made
    made.stop()


def test_pictures_of_the_board_fill_the_map(wizard, board):
    assert sum(wizard.state().cells) == 0
    wizard._look([frame(1, board)], False)
    state = wizard.state()
    assert state.phase == "filming"
    assert sum(state.cells) > 0
    assert len(state.outline) == 8
    assert (state.width, state.height, state.columns * 6) == (640, 360, len(state.cells))


def test_what_cannot_be_decoded_asks_for_a_key_frame(wizard):
    bad = EncodedFrame(1.0, 1.0, 1, Picture(Codec.JPEG, True, *SHAPE, b"\xff\xd8 not really"))
    wizard._look([bad], False)
    assert wizard.wanted == [1]
    assert wizard.undecodable == 1


def test_what_the_page_is_told_stays_small(wizard, board):
    wizard._look([frame(1, board)], False)
    text = encode_message(wizard.state())
    assert len(text) < MAX_MESSAGE_BYTES
    assert decode_from_server(text) == wizard.state()


def test_a_thread_that_died_is_a_refusal(wizard):
    wizard.failed = "calibration failed: …"
    state = wizard.state()
    assert (state.phase, state.verdict) == ("refused", "refused")


@pytest.mark.slow
def test_enough_is_solved_in_a_process_and_stored(tmp_path, board):
    phone, shape = Phone(), (1280, 720, 90)
    wizard = CalibrationSession("a phone", shape, tmp_path, lambda _n: None, lambda: None)
    try:
        for view in corner_film(phone, Motion(seed=1), 12.0, 15.0):
            wizard._guide.add(view.t, view)
        big = np.full((720, 1280), 60, np.uint8)
        wizard._look([frame(1, big, shape)], False)
        assert wizard.state().phase == "solving"
        assert wizard._solving._answer.poll(120.0)
        state = wizard.state()
        assert state.phase == "done", state.reasons
        assert wizard.stored == tmp_path / "a-phone-1280x720-at-90.yaml"
        _, camera = load_camera(wizard.stored)
        assert camera.K[0, 0] == pytest.approx(phone.lens[0], rel=0.005)
        assert state.figures[0].startswith("Focal length")
        assert wizard.state() is state
    finally:
        wizard.stop()


@pytest.mark.slow
def test_a_solver_that_dies_is_a_refusal_and_leaves_nothing(tmp_path):
    wizard = CalibrationSession("a phone", (1280, 720, 90), tmp_path, lambda _n: None, lambda: None)
    try:
        for view in corner_film(Phone(), Motion(seed=1), 12.0, 15.0):
            wizard._guide.add(view.t, view)
        big = np.full((720, 1280), 60, np.uint8)
        wizard._look([frame(1, big, (1280, 720, 90))], False)
        wizard._solving.stop()
        wizard._solving._process.join(10.0)
        assert wizard.state().phase == "refused"
        assert list(tmp_path.iterdir()) == []
    finally:
        wizard.stop()


def test_a_profile_that_could_not_be_read_again_is_a_refusal_in_words(tmp_path):
    wizard = CalibrationSession("a phone", (1280, 720, 90), tmp_path, lambda _n: None, lambda: None)
    text = (CAMERAS / "virtual_phone.yaml").read_text()
    try:
        told = wizard._finished(CalibrationOutcome(Verdict(), text.replace("1280", "-1280"), []))
        assert (told.phase, told.verdict) == ("refused", "refused")
        assert "image_width" in told.reasons[0]
        assert list(tmp_path.iterdir()) == []
        assert wizard.stored is None
        assert wizard._finished(CalibrationOutcome(Verdict(), text, [])).phase == "done"
    finally:
        wizard.stop()


def test_a_profile_that_the_disk_does_not_take_is_a_refusal_in_words(tmp_path):
    (folder := tmp_path / "cameras").write_text("a file where a folder should be")
    wizard = CalibrationSession("a phone", (1280, 720, 90), folder, lambda _n: None, lambda: None)
    text = (CAMERAS / "virtual_phone.yaml").read_text()
    try:
        told = wizard._finished(CalibrationOutcome(Verdict(), text, []))
        assert (told.phase, told.verdict) == ("refused", "refused")
        assert told.reasons == ["What was found can't be kept: File exists."]
        assert wizard.stored is None
    finally:
        wizard.stop()


class Front:
    """A phone that leads, a desk, and what its page was told."""

    def __init__(self, profiles):
        hello = Hello(VERSION, "operator", "Nobody's phone")
        self.taken = []
        self.phone = PhoneSession(
            hello,
            ROBOT,
            [profiles, CAMERAS],
            lambda _input: None,
            lambda: 50.0,
            self.taken.append,
            lambda: None,
            profiles,
        )
        self.told = []
        self.calibration_control = CalibrationControl(
            lambda text: self.told.append(decode_from_server(text))
        )

    def see(self, sequence, luma, shape=SHAPE):
        self.phone._see(frame(sequence, luma, shape), 50.0)

    def phases(self):
        return [message.phase for message in self.told]


@pytest.fixture
def front(tmp_path):
    made = Front(tmp_path)
    yield made
    made.phone.close()


CALM = control_status()
FLYING = control_status(mode=int(Mode.TRACK))


def test_a_camera_without_a_calibration_is_told_once(front, board):
    with pytest.raises(WireError, match="no calibration"):
        front.see(1, board)
    for _ in range(3):
        front.calibration_control.send(front.phone, CALM)
    assert front.phases() == ["needed"]


def test_a_phone_that_is_calibrated_is_told_nothing(front):
    front.calibration_control.send(front.phone, CALM)
    front.calibration_control.send(None, CALM)
    assert front.told == []


def test_nobody_calibrates_while_the_robot_is_led(front, board):
    with pytest.raises(WireError):
        front.see(1, board)
    for control in (FLYING, None):
        with pytest.raises(WireError, match="disarmed"):
            front.calibration_control.request(front.phone, Calibrate("start"), control)
    front.calibration_control.request(front.phone, Calibrate("start"), CALM)
    assert front.phone.wizard is not None
    front.calibration_control.send(front.phone, FLYING)
    assert front.phone.wizard is None


def test_before_the_first_picture_there_is_nothing_to_calibrate(front):
    with pytest.raises(WireError, match="when pictures come"):
        front.calibration_control.request(front.phone, Calibrate("start"), CALM)


def test_turning_the_phone_begins_anew_and_leaving_looks_again(front, board):
    with pytest.raises(WireError):
        front.see(1, board)
    front.phone.calibrate(Calibrate("start"))
    front.see(2, board)
    first = front.phone.wizard
    front.see(3, board.T.copy(), (360, 640, 0))
    assert front.phone.wizard is not first
    assert front.phone.wizard.screen_angle_deg == 0
    front.phone.calibrate(Calibrate("stop"))
    assert front.phone.wizard is None
    with pytest.raises(WireError, match="no calibration"):
        front.see(4, board)
    front.calibration_control.send(front.phone, CALM)
    assert isinstance(front.told[-1], Calibration)
    assert front.phases() == ["needed"]
