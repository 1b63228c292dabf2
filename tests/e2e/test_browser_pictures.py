"""What a real Chromium makes of a picture costs the LEDs' places next to nothing."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.sim.scenes.scene import HD, SCENES, at_reference
from hardware.sim.scenes.video import RenderedVideo
from pipeline.vision.visual_front_end import warm_up
from server.common.settings import VideoSettings
from tests.bench.browser_eyes import CHROMIUM, RAW, WAYS, Seen, look, row
from tests.bench.browser_film import Speed, studio
from tests.bench.y4m_camera import BITS, number_of, numbered

FRAMES, SLOWER = 40, 3


@pytest.mark.parametrize("brighter", [0, 9])
def test_a_picture_says_its_number_in_its_colour(brighter: int) -> None:
    grain = np.random.default_rng(1).normal(0.0, 6.0, (360, 640))
    for k in (0, 1, 2, 77, 255, 256, (1 << BITS) - 1):
        chroma = np.clip(numbered(k, 360, 640) + grain + brighter, 0, 255).astype(np.uint8)
        assert number_of(chroma) == k
    assert number_of(np.full((360, 640), 128, dtype=np.uint8)) is None


@pytest.mark.e2e
@pytest.mark.page
def test_centroids_of_delivered_pictures_are_those_of_raw_ones(chromium: str) -> None:
    warm_up()
    film = RenderedVideo(at_reference(SCENES["typical"]), 7, HD, FRAMES)
    shots = list(film)
    with studio(chromium, Speed(SLOWER, VideoSettings().bitrate_bps)) as films:
        got = films.filmed([shot.luma for shot in shots])
    seen = {way: Seen() for way in WAYS}
    look(film, shots, got, seen)
    came = row("typical", CHROMIUM, seen[CHROMIUM], seen[RAW])
    assert came.frames >= FRAMES // 3  # a busy machine loses some
    assert came.wrong == 0
    assert came.found_percent == 100.0
    assert came.added_px <= 0.1
