"""What OpenCV alone would do: threshold, connected components, nearest names, SQPNP."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from hardware.sim.scenes.video import RenderedFrame
from pipeline.camera.lens import Camera
from pipeline.frames import Array, R_co, exp
from pipeline.signals import Image, RelativePose
from pipeline.vision_config import MIN_LEDS
from server.common.clock import thread_cpu

THRESHOLD = 128  # grey, half of what there is
AREA_PX = (2, 2000)
REACH_PX = 20.0


class PlainTracker:
    """Follows as most scripts do; told the first pose, and again whenever it has lost the robot."""

    def __init__(self, camera: Camera, leds_in_b: Array) -> None:
        """No pose yet."""
        self._camera, self._leds_in_b = camera, np.ascontiguousarray(leds_in_b)
        self._mask: Image = np.zeros((camera.height, camera.width), dtype=np.uint8)
        self._last: tuple[Array, Array] | None = None
        self.took_s = 0.0
        """Of the last picture, CPU time."""

    def look(self, shot: RenderedFrame) -> RelativePose | None:
        """The pose in a shot's picture."""
        prior = self._last or (shot.p_bc_in_c, shot.R_cb)
        begin = thread_cpu()
        pose = self._pose(shot, *prior)
        self.took_s = thread_cpu() - begin
        self._last = (pose.p_bc_in_c, pose.R_cb) if pose is not None else None
        return pose

    def _pose(self, shot: RenderedFrame, p_bc_in_c: Array, R_cb: Array) -> RelativePose | None:
        cv2.threshold(shot.luma, THRESHOLD, 255, cv2.THRESH_BINARY, dst=self._mask)
        count, _, stats, centres = cv2.connectedComponentsWithStats(self._mask)
        area = stats[:count, cv2.CC_STAT_AREA]
        blobs = centres[1:][(area[1:] >= AREA_PX[0]) & (area[1:] <= AREA_PX[1])]
        places = p_bc_in_c + self._leds_in_b @ R_cb.T
        if len(blobs) < MIN_LEDS or float(places[:, 0].min()) < 0.1:
            return None
        apart = np.linalg.norm(self._camera.pixels(places)[:, None] - blobs[None], axis=2)
        leds, named = linear_sum_assignment(np.minimum(apart, REACH_PX))
        near = apart[leds, named] < REACH_PX
        if near.sum() < MIN_LEDS:
            return None
        return self._solved(shot.t, self._leds_in_b[leds[near]], blobs[named[near]])

    def _solved(self, t: float, leds: Array, pixels: Array) -> RelativePose | None:
        camera = self._camera
        found, turn, shift = cv2.solvePnP(
            leds, pixels, camera.K, camera.distortion, flags=cv2.SOLVEPNP_SQPNP
        )
        if not found:
            return None
        turned, shifted = (np.asarray(x, np.float64).ravel() for x in (turn, shift))
        R_cb, p = R_co @ exp(turned), R_co @ shifted
        return RelativePose(t, p, R_cb, np.eye(6), 0.0, len(leds))


def pass_s(luma: Image) -> float:
    """CPU time of one pass over a picture: less is impossible for who looks at all of it."""
    begin = thread_cpu()
    cv2.minMaxLoc(luma)
    return thread_cpu() - begin
