"""What a screen is told: of a phone that films it, and of a simulated robot."""

import contextlib
import re
import socket
import threading
from collections import deque
from pathlib import Path

import cv2
import numpy as np
import pytest

from hardware.follower import FollowerState
from hardware.robot_file import load_robot
from hardware.sim.truth import ahead_of, encode_truth
from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.frames import GRAVITY, R_from_rpy
from pipeline.glass.display_lag import BORNE_S, MOST_LAG_S, SWEEP_SHARE, DisplayLag, swept
from pipeline.glass.fiducials import glass_seen
from pipeline.glass.lens_meter import TILT, GlassCorners
from pipeline.glass.robot_of_light import MEASURES
from pipeline.glass.window import CELLS, MARKER_IDS, TILE_SHARE, Glass, on_glass
from pipeline.signals import PhoneImu
from server.protocol.screen_messages import ScreenSize
from server.view.glass_watch import GlassLook
from server.view.screen import LightsThread, NewCamera, Screen

LEDS_IN_B = load_robot("screen").robot.leds_in_b
GLASS = Glass(0.53, 0.30)
K = np.array([[950.0, 0.0, 639.5], [0.0, 950.0, 359.5], [0.0, 0.0, 1.0]])
CAMERA = Camera(1280, 720, K, "plumb_bob", np.zeros(5))
AWAY = np.array([0.6, 0.0, 0.0])
"""The glass from the camera, which looks straight at it [m]."""
STRAIGHT = np.eye(3)
NO_CORNERS = GlassCorners(0.0, np.zeros(0, dtype=np.intp), np.zeros((0, 2)))


@pytest.fixture
def truth_port():
    """Of a robot that hangs still at its rest; it tells each request what it asks."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", 0))

        def answer():
            while (request := robot.recvfrom(100))[0] != b"end":
                ahead_s = ahead_of(request[0])
                times = np.arange(0.0, ahead_s + 1e-9, 0.005)
                poses = [(t, np.array([1.0, 0, 0, 0]), np.zeros(3)) for t in times]
                robot.sendto(
                    encode_truth(request[0], poses, np.zeros(8), FollowerState.IDLE), request[1]
                )

        thread = threading.Thread(target=answer)
        thread.start()
        yield robot.getsockname()[1]
        robot.sendto(b"end", robot.getsockname())
        thread.join()


@pytest.fixture
def make(truth_port):
    """Makes what tells one screen, not started."""
    with contextlib.ExitStack() as made:

        def thread(leds_in_b=LEDS_IN_B):
            one = LightsThread(truth_port, leds_in_b, GLASS, lambda _: None)
            made.callback(one.close)
            return one

        yield thread


def filmed(thread, seconds, lag_s, since=0.0, R_cg=STRAIGHT, late_s=0.0):
    """What the thread says at last, of a phone that holds still and films.

    Pictures come `late_s` after they were taken.
    """
    pixels, still, looks = CAMERA.pixels(AWAY + GLASS.fiducials() @ R_cg.T), np.zeros(3), deque()
    for k in range(int(60 * seconds)):
        t = since + k / 60.0
        thread.add(PhoneImu(t, still, np.array([0.0, 0.0, GRAVITY])))
        if k % 2 == 0:
            seen = glass_seen(CAMERA, GLASS, np.arange(16), pixels, t)
            right = SWEEP_SHARE * GLASS.width_m * float(swept(np.array(t - lag_s)))
            light = AWAY + on_glass(np.array([[right, 0.0]])) @ R_cg.T
            looks.append(GlassLook(seen, light, GlassCorners(t, np.arange(16), pixels)))
        while looks and looks[0].seen.t + late_s <= t:
            thread.add(looks.popleft())
        lights = thread.step(t + 0.01)
    return lights


def test_a_phone_that_films_is_shown_a_sweep_and_then_the_robot(make):
    thread = make()
    assert thread.step(0.0).phase == "search"
    assert "four corners" in thread.why
    assert filmed(thread, 1.0, 0.03, since=1.0).phase == "sweep"
    assert thread.why == MEASURES
    assert not thread.is_shown
    lights = filmed(thread, 2.5, 0.03, since=2.0)
    assert lights.phase == "robot"
    assert thread.is_shown
    assert lights.lag_ms == pytest.approx(30.0, abs=1.0)
    assert lights.why == ""
    assert lights.t_ms == pytest.approx(1e3 * (2.0 + 149 / 60.0 + 0.01) + lights.lag_ms)
    shown = np.array(lights.places_mm[0]).reshape(-1, 2)
    at = LEDS_IN_B - LEDS_IN_B.mean(axis=0)
    perspective = 0.6 / (0.6 + at[:, 0])
    wanted = 1e3 * perspective[:, None] * np.column_stack((-at[:, 1], at[:, 2]))
    assert np.abs(shown - wanted).max() < 1.0


def test_a_lens_that_was_guessed_is_measured_before_the_robot_is_shown(make):
    thread = make()
    guessed = SimpleLens(0.78).camera(1280, 720)
    thread.add(NewCamera(guessed, is_guessed=True))
    lights = filmed(thread, 4.0, 0.03)
    assert (lights.phase, thread.why) == ("search", TILT)
    assert thread.lens_of(guessed) is None
    filmed(thread, 5.0, 0.03, since=4.0, R_cg=R_from_rpy(np.array([0.0, -0.2, 0.0])))
    lens = thread.lens_of(guessed)
    assert lens.focal == pytest.approx(950.0 / 1280.0, rel=0.01)
    assert thread.lens_of(SimpleLens(0.78).camera(1280, 720)) is None  # another phone's
    thread.add(NewCamera(lens.camera(1280, 720), is_guessed=False))
    assert filmed(thread, 1.0, 0.03, since=9.0).phase == "robot"


@pytest.mark.parametrize(("lag_s", "why"), [(0.09, "90 ms late"), (-0.06, "before it is drawn")])
def test_a_screen_that_is_too_late_is_told_so_and_measured_until_it_is_not(make, lag_s, why):
    thread = make()
    lights = filmed(thread, 3.5, lag_s)
    assert lights.phase == "sweep"
    assert why in lights.why
    assert lights.places_mm == []
    lights = filmed(thread, 5.5, 0.03, since=3.5)  # it has another mode now
    assert lights.phase == "robot"
    assert lights.lag_ms == pytest.approx(30.0, abs=10.0)  # the rest is seen by the robot's lights


def test_a_lag_that_is_corrected_beyond_what_is_fit_is_borne_a_little_by_who_leads(make):
    """Light that goes out because its lag is known better would be worse than one so late."""
    thread = make()
    robot = thread._robot
    assert filmed(thread, 3.5, 0.075).phase == "robot"
    for since, lag_s, phase in (
        (3.5, MOST_LAG_S + 0.8 * BORNE_S, "robot"),
        (3.6, MOST_LAG_S + 1.2 * BORNE_S, "sweep"),
        (3.7, MOST_LAG_S + 0.8 * BORNE_S, "sweep"),
        (3.8, MOST_LAG_S - 0.001, "robot"),
    ):
        robot.dated_lag = DisplayLag(lag_s, 0.001)
        assert filmed(thread, 0.1, 0.075, since=since).phase == phase
    robot.dated_lag = DisplayLag(MOST_LAG_S + 0.8 * BORNE_S, 0.001)
    thread.add(NewCamera(CAMERA, is_guessed=False))
    assert filmed(thread, 1.0, 0.075, since=3.9).phase == "sweep"


def test_who_films_a_glass_that_stands_still_tells_when_pictures_are_taken(make):
    thread = make()
    filmed(thread, 3.0, 0.03)
    assert thread.time_offset is None  # a phone that holds still tells nothing of time
    for k in range(240):
        t, yaw, rate = 3.0 + k / 60.0, *(0.1 * f(0.1 * k) for f in (np.sin, np.cos))
        thread.add(PhoneImu(t, np.array([0.0, 0.0, 6.0 * rate]), np.array([0.0, 0.0, GRAVITY])))
        if k % 2 == 0:
            R_gc = R_from_rpy(np.array([0.0, 0.0, yaw]))
            pixels = CAMERA.pixels((AWAY + GLASS.fiducials()) @ R_gc)
            seen = glass_seen(CAMERA, GLASS, np.arange(16), pixels, t + 0.008)
            thread.add(GlassLook(seen, np.zeros((0, 3)), NO_CORNERS))
        thread.step(t + 0.01)
    assert thread.time_offset is not None
    assert thread.time_offset.value == pytest.approx(-0.008, abs=1e-3)


def test_a_phone_that_looks_away_loses_the_light(make):
    thread = make()
    assert filmed(thread, 3.5, 0.03).phase == "robot"
    assert thread.step(3.6).phase == "robot"
    assert thread.step(3.85).phase == "search"
    assert "four corners" in thread.why


@pytest.mark.parametrize(("late_s", "phase"), [(0.2, "robot"), (0.4, "search")])
def test_pictures_may_be_late_and_that_they_are_too_late_is_told(make, late_s, phase):
    thread = make()
    assert filmed(thread, 3.5, 0.03, late_s=late_s).phase == phase
    assert bool(re.search("pictures come 4[0-9]{2} ms late", thread.why)) == (phase == "search")
    thread.step(4.5)
    assert "four corners" in thread.why  # none come any more


def test_a_robot_larger_than_the_screen_is_not_shown_on_it(make):
    thread = make(load_robot("ames").robot.leds_in_b)
    assert "--robot screen" in thread.step(0.0).why


def test_why_there_is_no_glass_is_told_for_a_while(make):
    thread = make()
    thread.add(GlassLook(None, np.zeros((0, 3)), NO_CORNERS, "The picture is mirrored."))
    assert thread.step(1.0).why == thread.why == "The picture is mirrored."
    assert "four corners" in thread.step(5.0).why


def test_one_place_for_one_screen(truth_port):
    screen = Screen(truth_port, LEDS_IN_B)
    mine, others = object(), object()
    assert screen.enter(mine)
    assert not screen.enter(others)
    screen.measure(others, ScreenSize(500.0, 300.0))
    screen.leave(others)
    assert screen.is_open
    assert screen.why == ""
    screen.leave(mine)
    assert not screen.is_open


def test_the_page_draws_the_markers_that_the_phone_looks_for():
    script = Path(__file__).resolve().parents[3] / "web_client/src/screen/glass.js"
    text = script.read_text(encoding="utf-8")
    codes = re.findall(r"^  \['([01]{4})', '([01]{4})', '([01]{4})', '([01]{4})'\]", text, re.M)
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    for name, rows in zip(MARKER_IDS, codes, strict=True):
        inside = cv2.aruco.generateImageMarker(family, name, 6)[1:5, 1:5] > 0
        assert rows == tuple("".join("1" if light else "0" for light in row) for row in inside)
    assert f"CELLS = {CELLS};" in text
    assert f"TILE_SHARE = {TILE_SHARE};" in text
