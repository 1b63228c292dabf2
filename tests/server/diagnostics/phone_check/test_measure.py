"""From what came of a phone to figures: windows, losses, heat, whose lag it is."""

from __future__ import annotations

from dataclasses import replace
from math import isnan

import numpy as np
import pytest

from pipeline.camera.extrinsics import Extrinsics
from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.glass.display_lag import DisplayLag
from pipeline.glass.lens_meter import GlassViews
from pipeline.glass.robot_of_light import GlassSeen
from pipeline.glass.window import Glass
from server.diagnostics.link_log import LinkLog
from server.diagnostics.phone_check.figures import PhoneFigures
from server.diagnostics.phone_check.measure import figures
from server.diagnostics.phone_check.phone_watch import (
    LONG_S,
    ClockFacts,
    PhoneFacts,
    PhoneWatch,
    PixelLook,
)
from server.protocol.wire_records import Codec, Picture

AGE_S = 0.08
CAMERA = SimpleLens().camera(1280, 720)
FACTS = PhoneFacts("A phone", 0.0, ClockFacts(), "all", CAMERA, True, None, (), None)
PICTURE = Picture(Codec.H264, True, 1280, 720, 90, bytes(1000))


class Filming:
    """A phone that is watched from 0 s on."""

    def __init__(self) -> None:
        self.link = LinkLog(0.0)
        self.watch = PhoneWatch(self.link)
        self.t = 0.0

    def film(self, seconds: float, hz: float = 30.0, look: PixelLook | None = None) -> None:
        for _ in range(round(seconds * hz)):
            self.t += 1.0 / hz
            self.link.came("pictures", self.t, self.t + AGE_S)
            self.watch.add_picture(self.t, self.t + AGE_S, PICTURE)
            if look is not None:
                self.watch.add_look(replace(look, t=self.t))

    def told(self, seconds: float, facts: PhoneFacts = FACTS) -> PhoneFigures:
        return figures(self.watch.series(self.t + AGE_S, seconds, facts))


FOUND = PixelLook(0.0, True, (0, 1, 2, 3, 4), (0.2,) * 5, 0.1)


def test_pictures_are_told_of_the_last_minute_and_their_rate_of_five() -> None:
    phone = Filming()
    phone.film(60.0, hz=30.0)
    phone.film(180.0, hz=24.0)
    phone.film(60.0, hz=20.0)
    found = phone.told(LONG_S)
    assert found.seconds == pytest.approx(60.0)
    assert found.picture_hz == pytest.approx(20.0, rel=0.01)
    assert (found.begin_hz, found.end_hz) == pytest.approx((30.0, 20.0), rel=0.01)
    assert found.long_s == pytest.approx(300.0, abs=0.2)
    assert found.age_ms == pytest.approx((80.0, 80.0, 80.0))
    assert found.kbit_s == pytest.approx(8.0 * 20.0, rel=0.01)


def test_of_one_minute_nothing_is_said_of_heat() -> None:
    phone = Filming()
    phone.film(300.0)
    assert isnan(phone.told(60.0).begin_hz)


def test_what_could_not_be_decoded_is_lost_also_where_a_decoder_begins_anew() -> None:
    phone = Filming()
    phone.watch.count(7)  # they leant on pictures of before
    phone.film(1.0, look=FOUND)
    phone.watch.count(10)
    phone.watch.count(0)
    phone.watch.count(2)
    phone.film(9.0, look=FOUND)
    assert phone.told(60.0).lost_pct == pytest.approx(100.0 * 5 / 300)


def test_noise_counts_what_a_pose_takes_up_and_names_the_worst_led() -> None:
    phone = Filming()
    phone.film(10.0, look=replace(FOUND, off_px=(0.2, 0.2, 0.2, 0.2, 0.4)))
    found = phone.told(60.0)
    assert found.noise_px == pytest.approx(np.sqrt((4 * 0.04 + 0.16) / 4))
    assert found.dots_px == pytest.approx([np.sqrt(5 / 4) * off for off in (0.2,) * 4 + (0.4,)])
    assert found.codec_pct == pytest.approx(100.0 * (1.0 - 0.01 / 0.08))


@pytest.mark.parametrize(("every", "counts"), [(2, True), (4, True), (20, False)])
def test_of_pictures_from_which_an_led_was_left_out_the_noise_is_not_told(
    every: int, counts: bool
) -> None:
    """They were chosen for how well they fit; those with all LEDs tell, if there are enough."""
    phone = Filming()
    whole = replace(FOUND, off_px=(0.2,) * 5)
    fits = PixelLook(0.0, True, (0, 1, 2, 3), (0.05,) * 4, 0.1)
    for k in range(100):
        phone.film(0.1, look=fits if k % every else whole)
    noise_px = np.sqrt(5 * 0.04 / 4) if counts else np.sqrt(4 * 0.0025 / 2)
    assert phone.told(60.0).noise_px == pytest.approx(noise_px)


def test_three_leds_leave_no_error_to_be_seen() -> None:
    phone = Filming()
    phone.film(10.0, look=PixelLook(0.0, True, (0, 1, 2), (0.0,) * 3, 0.1))
    found = phone.told(60.0)
    assert isnan(found.noise_px)
    assert found.dots_px == ()


def test_a_robot_counts_as_lost_only_once_it_was_found() -> None:
    phone = Filming()
    phone.film(10.0, look=PixelLook(0.0, False))
    assert phone.told(60.0).found_pct == 0.0
    phone.film(9.0, look=FOUND)
    phone.film(1.0, look=PixelLook(0.0, False))
    assert phone.told(60.0).found_pct == pytest.approx(90.0)


def seen(lag_s: float, t: float = 5.0, camera: Camera = CAMERA) -> GlassSeen:
    return GlassSeen(DisplayLag(lag_s, 0.001), t, GlassViews(camera, Glass(0.53, 0.30)), None)


@pytest.mark.parametrize("told_s", [0.0, 0.02])
def test_light_to_server_is_the_lag_and_the_age_from_the_date_at_which_the_lag_ends(
    told_s: float,
) -> None:
    phone = Filming()
    phone.film(10.0)
    camera = replace(CAMERA, extrinsics=Extrinsics(time_offset_s=told_s))
    found = phone.told(60.0, replace(FACTS, camera=camera, glass=seen(0.040)))
    assert found.glass is not None
    assert found.glass.light_ms == pytest.approx([80.0 + 40.0 - 1e3 * told_s] * 3)


def test_a_lag_that_was_measured_through_another_phone_is_not_this_ones() -> None:
    phone = Filming()
    phone.film(10.0)
    found = phone.told(60.0, replace(FACTS, since=6.0, glass=seen(0.040)))
    assert found.glass is not None
    assert isnan(found.glass.lag_ms)
    assert isnan(found.glass.light_ms[0])


def test_what_was_heard_is_no_longer_than_the_phone_was_there() -> None:
    phone = Filming()
    phone.film(30.0)
    series = phone.watch.series(30.0, 60.0, replace(FACTS, since=20.0))
    assert series.heard_s == pytest.approx(10.0)
