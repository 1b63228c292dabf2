"""The camera that is guessed of a stream's images, however the phone is held."""

import pytest

from pipeline.camera.lens import COLUMNS, ROWS
from pipeline.camera.simple_lens import SimpleLens
from server.media.image_format import ImageFormat


@pytest.mark.parametrize(
    ("width", "height", "angle_deg", "axis", "sign"),
    [
        (1280, 720, 90, ROWS, 1.0),  # a phone on its right side
        (1280, 720, 270, ROWS, -1.0),
        (720, 1280, 0, COLUMNS, -1.0),  # upright: the line that was the upper one is on the right
        (720, 1280, 180, COLUMNS, 1.0),
        (1280, 720, 0, ROWS, 1.0),  # a tablet's, or a webcam
        (720, 1280, 90, COLUMNS, 1.0),
    ],
)
def test_a_guessed_camera_has_the_pictures_size_and_its_lines_the_phones_way(
    width: int, height: int, angle_deg: int, axis: int, sign: float
) -> None:
    camera = ImageFormat(width, height, angle_deg).guessed(SimpleLens(0.7, readout_s=0.02))
    assert (camera.width, camera.height) == (width, height)
    assert camera.focal_px == pytest.approx(0.7 * 1280)
    assert camera.readout_axis == axis
    assert camera.readout_s == sign * 0.02
