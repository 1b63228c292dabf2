"""A frame with what was seen in it."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.camera.lens import Camera
from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.frames import Array
from pipeline.signals import Image, RelativePose
from server.tools.locate.work import Located

Picture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]
FOUND, OTHER, PLACED, WORDS = (120, 255, 80), (60, 160, 255), (255, 255, 0), (255, 255, 255)
AXES = ((60, 60, 255), (60, 255, 60), (255, 120, 60))
"""x red, y green, z blue; all colours are in OpenCV's order."""
AXIS_M = 0.15


def draw(luma: Image, located: Located, camera: Camera, leds_in_b: Array) -> Picture:
    """(height, width, 3) BGR.

    Named spots are green with the LED's number in the robot file, from 0; other lights orange.
    Crosses are the LEDs and lines the body's axes as the pose has them at the middle row.
    """
    picture = np.asarray(cv2.cvtColor(luma, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    _draw_spots(picture, located)
    if located.pose is not None:
        _draw_pose(picture, located.pose, camera, leds_in_b)
    _write(picture, _words(located), (8, picture.shape[0] - 10), WORDS)
    return picture


def _draw_spots(picture: Picture, located: Located) -> None:
    detection = located.detection
    if detection is None:
        return
    match = detection.match
    names = dict(zip(match.spot.tolist(), match.led.tolist(), strict=True)) if match else {}
    for index, (u, v) in enumerate(detection.spots.pixels.tolist()):
        radius = round(6.0 + 0.6 * float(detection.spots.area[index]) ** 0.5)
        colour = FOUND if index in names else OTHER
        cv2.circle(picture, (round(u), round(v)), radius, colour, 1, cv2.LINE_AA)
        if index in names:
            _write(picture, str(names[index]), (round(u) + radius + 2, round(v) - radius), FOUND)


def _draw_pose(picture: Picture, pose: RelativePose, camera: Camera, leds_in_b: Array) -> None:
    places = _projected(pose, leds_in_b, camera)
    for u, v in places[np.isfinite(places).all(axis=1)].tolist():
        cv2.drawMarker(picture, (round(u), round(v)), PLACED, cv2.MARKER_CROSS, 7, 1)
    ends = _projected(pose, np.vstack((np.zeros(3), AXIS_M * np.eye(3))), camera)
    if np.isfinite(ends).all():
        origin = (round(ends[0, 0]), round(ends[0, 1]))
        for (u, v), colour in zip(ends[1:].tolist(), AXES, strict=True):
            cv2.line(picture, origin, (round(u), round(v)), colour, 2, cv2.LINE_AA)


def _projected(pose: RelativePose, points_in_b: Array, camera: Camera) -> Array:
    """Pixels (n, 2); NaN behind the camera or far outside the picture."""
    points = pose.p_bc_in_c + points_in_b @ pose.R_cb.T
    pixels = np.full((len(points), 2), np.nan)
    ahead = points[:, 0] > NEAREST_M
    pixels[ahead] = camera.pixels(points[ahead])
    far = np.abs(pixels) > 4 * max(camera.width, camera.height)
    return np.where(far, np.nan, pixels)


def _words(located: Located) -> str:
    """OpenCV's letters are ASCII."""
    name = f"{located.shot.name}  {located.shot.t:.3f} s  "
    pose = located.pose
    if pose is None:
        return name + located.reason.replace("°", " deg").encode("ascii", "replace").decode()
    distance = float(np.linalg.norm(pose.p_bc_in_c))
    return f"{name}{pose.leds} LEDs  {distance:.3f} m  {pose.reprojection_px:.2f} px"


def _write(picture: Picture, words: str, place: tuple[int, int], colour: Colour) -> None:
    for ink, width in (((0, 0, 0), 3), (colour, 1)):
        cv2.putText(picture, words, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, ink, width, cv2.LINE_AA)
