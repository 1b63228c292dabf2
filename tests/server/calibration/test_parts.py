"""The parts of a calibration: lens, board, views, choice, rates, bundle."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from hardware.camera_file import TIME_OFFSETS_S
from pipeline.frames import exp
from server.calibration.board import Board, BoardError, Detector, parse
from server.calibration.camera_imu import GyroSpline, ImuError, align, gyro_of
from server.calibration.choice import choose, farthest_first
from server.calibration.lens import normalised, project
from server.calibration.motion import rates
from server.calibration.projection import rotated
from server.calibration.views import BoardView, aspect, edge_width, look
from server.tools.calibrate.draw_board import MARGIN, PNG_SQUARE_PX, pdf, png, svg, write_board
from tests.server.calibration.filming import BOARD, Motion, Phone, at_rows, corner_film

LENSES = {
    "plumb_bob": (930.0, 934.0, 646.0, 352.0, 0.08, -0.15, 0.0008, -0.0006, 0.02),
    "rational_polynomial": (930.0, 934.0, 646.0, 352.0, 0.3, 0.1, 1e-3, 1e-3, 0.01, 0.2, 0.1, 0.01),
    "equidistant": (480.0, 481.0, 640.0, 357.0, 0.05, -0.02, 0.01, -0.002),
}


@pytest.mark.parametrize("model", LENSES)
def test_derivatives_of_a_lens_are_those_of_differences(model):
    lens, points = np.array(LENSES[model]), np.array([[0.3, -0.2, 1.1], [-0.4, 0.1, 0.9]])
    _, by_point, by_lens = project(model, lens, points)

    def slope(at, step):
        return (at(step) - at(-step)) / (2.0 * step)

    for k in range(3):
        moved = slope(lambda s, k=k: project(model, lens, points + s * np.eye(3)[k])[0], 1e-6)
        assert by_point[:, :, k] == pytest.approx(moved, abs=1e-3)
    for k in range(len(lens)):
        one = np.eye(len(lens))[k]
        moved = slope(lambda s, one=one: project(model, lens + s * one, points)[0], 1e-5)
        assert by_lens[:, :, k] == pytest.approx(moved, abs=1e-3)


@pytest.mark.parametrize("model", LENSES)
def test_a_pixel_undistorted_is_the_ray_it_came_from(model):
    lens, points = np.array(LENSES[model]), np.array([[0.3, -0.2, 1.0], [-0.4, 0.1, 1.0]])
    flat = normalised(model, lens, project(model, lens, points)[0])
    assert flat == pytest.approx(points[:, :2], abs=1e-4)


def test_many_rotations_at_once_are_each_its_own():
    rng = np.random.default_rng(0)
    theta, x = rng.normal(0, 1, (5, 3)), rng.normal(0, 1, (5, 3))
    theta[0] = 0.0
    expected = np.array([exp(a) @ b for a, b in zip(theta, x, strict=True)])
    assert rotated(theta, x) == pytest.approx(expected, abs=1e-12)


BOARDS = [Board(), Board(8, 8, legacy=True), Board(6, 9, dictionary="6X6_250"), Board(5, 4)]


@pytest.mark.parametrize("board", BOARDS, ids=str)
def test_a_drawn_board_is_found_where_it_was_drawn(board):
    image = cv2.imdecode(np.frombuffer(png(board), np.uint8), cv2.IMREAD_GRAYSCALE)
    ids, pixels = Detector(board).find(image)
    assert len(ids) == (board.columns - 1) * (board.rows - 1)
    squares = board.corners()[ids, :2] / board.square_m + MARGIN
    assert pixels == pytest.approx(PNG_SQUARE_PX * squares - 0.5, abs=0.05)


def test_our_corners_are_opencvs():
    theirs = BOARD.drawn_by_opencv().getChessboardCorners()
    assert BOARD.corners() == pytest.approx(np.array(theirs).reshape(-1, 3))


def test_the_boards_page_shows_the_board_that_is_looked_for():
    file = Path(__file__).resolve().parents[3] / "web_client/board.svg"
    assert file.read_text() == svg(Board())


def test_a_pdfs_table_points_at_its_objects():
    data = pdf(BOARD)
    start = int(re.search(rb"startxref\n(\d+)", data)[1])
    assert data[start:].startswith(b"xref")
    for number, place in enumerate(re.findall(rb"(\d{10}) 00000 n", data), 1):
        assert data[int(place) :].startswith(b"%d 0 obj" % number)
    width = float(re.search(rb"MediaBox \[0 0 ([\d.]+)", data)[1])
    assert width / 72.0 * 0.0254 == pytest.approx(10 * BOARD.square_m, abs=1e-6)


@pytest.mark.parametrize(
    ("words", "allowed"),
    [
        (("9by6", 25.0, None, "5X5_250", False), "9x6"),
        (("2x6", 25.0, None, "5X5_250", False), "3 to 20"),
        (("9x6", 0.0, None, "5X5_250", False), "1 to 1000 mm"),
        (("9x6", 25.0, 26.0, "5X5_250", False), "0.3 to 1"),
        (("9x6", 25.0, None, "7X7", False), "5X5_250"),
        (("20x20", 25.0, None, "4X4_50", False), "50 markers"),
    ],
)
def test_a_board_that_cannot_be_is_refused_with_what_is_allowed(words, allowed):
    with pytest.raises(BoardError, match=allowed):
        parse(*words)


def test_a_board_file_of_another_kind_is_refused(tmp_path):
    with pytest.raises(BoardError, match=r"\.svg, \.pdf or \.png"):
        write_board(BOARD, tmp_path / "board.jpg")


def picture(blur_px=0.0):
    image = BOARD.drawn_by_opencv().generateImage((540, 360), marginSize=20)
    return image if blur_px == 0.0 else cv2.blur(image, (blur_px, 1))


def test_edges_get_as_wide_as_the_motion_that_blurs_them():
    detector = Detector(BOARD)
    sharp, moved = (look(picture(n), 0.0, BOARD, detector) for n in (0, 5))
    assert sharp.blur_px < 2.5
    assert moved.blur_px == pytest.approx(5.0, rel=0.1)


def test_a_picture_without_a_board_is_no_view():
    empty = np.full((360, 540), 90, np.uint8)
    assert look(empty, 0.0, BOARD, Detector(BOARD)) is None
    assert edge_width(empty, np.array([0]), np.zeros((1, 2)), BOARD) == np.inf


@pytest.mark.parametrize(("turn", "slope"), [((0, 0.5, 0), (-1, 0)), ((0.5, 0, 0), (0, 1))])
def test_tilt_is_the_slope_of_the_depth_wherever_the_board_stands(turn, slope):
    phone, R = Phone(), exp(np.array(turn, dtype=float))
    lens = np.array([960.0, 960.0, 640.0, 360.0, *np.zeros(5)])
    for place in ((-0.1, -0.1, 0.5), (0.02, 0.05, 0.6)):
        pixels = project("plumb_bob", lens, BOARD.corners() @ R.T + place)[0]
        view = BoardView(0.0, np.arange(len(pixels)), pixels, 2.0)
        one = aspect(view, BOARD, phone.size, 960.0)
        assert one.tilt == pytest.approx(np.tan(0.5) * np.array(slope), abs=0.02)
        assert one.tilt_deg == pytest.approx(np.rad2deg(0.5), abs=1.0)


def test_farthest_first_takes_the_outermost_and_no_twins():
    rows = np.array([[0, 0, 1, 0, 0], [0, 0, 1, 0, 0], [1, 0, 0, 0, 0], [0.5, 0, 0.5, 0, 0]], float)
    assert farthest_first(rows, 9) == [0, 2, 3]
    assert farthest_first(np.zeros((0, 5)), 9) == []


def test_blurred_views_are_not_chosen():
    views = corner_film(Phone(), Motion(), seconds=2.0, fps=15.0)
    bad = [BoardView(v.t + 100.0, v.ids, v.pixels, 20.0) for v in views]
    choice = choose(views + bad, BOARD, Phone().size)
    assert len(choice.sharp) == len(views)
    assert all(view.t < 50.0 for view in choice.fit + choice.held_out)


def test_rates_are_the_derivatives_of_the_poses():
    phone, motion = Phone(), Motion(tremor=0.0)
    t = np.arange(9) / 30.0
    poses = [motion.pose(one, phone) for one in t]
    R, p = (np.array(part) for part in zip(*poses, strict=True))
    found = rates(t, R, p, np.full((9, 6), 1e-5))
    assert found.known.tolist() == [False, *[True] * 7, False]
    phone.readout_s = 1e-3
    _, turns, places = at_rows(phone, motion, t[4], np.array([-0.5, 0.5]))
    slope = np.concatenate((turns[1] - turns[0], places[1] - places[0])) / 1e-3
    assert found.value[4] == pytest.approx(slope, abs=2e-3)


def test_views_far_apart_in_time_have_no_rates():
    t = np.arange(5.0)
    found = rates(t, np.tile(np.eye(3), (5, 1, 1)), np.zeros((5, 3)), np.full((5, 6), 1e-5))
    assert not found.known.any()


def test_too_little_motion_for_the_sensors_is_told_with_what_to_do():
    with pytest.raises(ImuError, match="at least"):
        gyro_of(np.zeros((3, 7)))
    t = np.arange(90) / 30.0
    still = GyroSpline(t, np.zeros((90, 3)))
    with pytest.raises(ImuError, match="about all three axes"):
        align(t, np.tile(np.eye(3), (90, 1, 1)), still)
    with pytest.raises(ImuError, match="start both together"):
        align(t + 500.0, np.tile(np.eye(3), (90, 1, 1)), still)


SWINGS = (1.1, 1.7, 2.3)


def turning(late_s, felt=SWINGS):
    """A camera that turns about three axes [rad/s], and a gyroscope that feels `felt`."""
    t, fine = np.arange(0.0, 12.0, 1.0 / 30.0), np.arange(-2.0, 14.0, 0.005)
    R_og = [np.eye(3)]
    for turn in np.diff(0.5 * np.sin(np.outer(t, SWINGS)), axis=0):
        R_og.append(exp(-turn) @ R_og[-1])
    rate = 0.5 * np.array(felt) * np.cos(np.outer(fine, felt))
    return t, np.array(R_og), GyroSpline(fine + late_s, rate)


@pytest.mark.parametrize("late_s", [0.49, 0.53])
def test_a_delay_that_no_camera_file_may_hold_is_refused_in_words(late_s):
    """The nearest one that is tried is half a second, and the fit goes on from there."""
    if late_s < TIME_OFFSETS_S[1]:
        assert align(*turning(late_s)).time_offset_s == pytest.approx(late_s, abs=0.003)
        return
    with pytest.raises(ImuError, match="do not fit each other"):
        align(*turning(late_s))


@pytest.mark.parametrize("felt", [(0.7, 1.2, 3.1), (1.1, 1.7, 4.3), (1.1, 1.7, 0.0)])
def test_a_gyroscope_that_felt_another_motion_is_refused(felt):
    with pytest.raises(ImuError, match="do not fit each other"):
        align(*turning(0.03, felt))


def test_a_cut_in_the_film_does_not_move_the_delay():
    t, R_og, gyro = turning(0.03)
    R_og[180:] = R_og[180:] @ exp(np.array([1.0, 0.5, -1.0]))
    assert align(t, R_og, gyro).time_offset_s == pytest.approx(0.03, abs=0.001)
