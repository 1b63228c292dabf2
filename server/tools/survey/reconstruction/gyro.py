"""The camera's turn between frames, from its gyroscope."""

from __future__ import annotations

import numpy as np

from pipeline.camera.lens import Camera, points_of
from pipeline.frames import Array, R_co, exp
from server.tools.survey.reconstruction.errors import SurveyError

LONGEST_GAP_S = 0.1
STILL_S = 0.5
MOMENT_S = 1e-3


class GyroAttitude:
    """Attitudes of the camera over the film, as a gyroscope integrates them."""

    def __init__(self, samples: Array, times: Array) -> None:
        """Integrate over the film.

        Args:
            samples: (m, 7) t [s], rate [rad/s], specific force [m/s²] in c.
            times: (f,) of the frames [s], ascending.

        Raises:
            SurveyError: the samples leave out a part of the film.
        """
        t = samples[:, 0]
        within = t[(t > times[0] - LONGEST_GAP_S) & (t < times[-1] + LONGEST_GAP_S)]
        ends = np.concatenate(([times[0]], within, [times[-1]]))
        if len(within) < 2 or float(np.diff(np.sort(ends)).max()) > LONGEST_GAP_S:
            raise SurveyError(
                f"--imu: samples must cover the film from {times[0]:.3f} to {times[-1]:.3f} s"
                f" with no gap over {LONGEST_GAP_S:g} s"
            )
        self._samples, self._times = samples, times
        self.R_sc = self._integrated()
        """(f, 3, 3); s: the camera at the first frame."""

    def _integrated(self) -> Array:
        t = self._samples[:, 0]
        knots = np.union1d(t[(t > self._times[0]) & (t < self._times[-1])], self._times)
        rates = np.column_stack([np.interp(knots, t, self._samples[:, k]) for k in (1, 2, 3)])
        R, at = np.eye(3), {float(knots[0]): np.eye(3)}
        for k in range(1, len(knots)):
            R = R @ exp(0.5 * (rates[k] + rates[k - 1]) * (knots[k] - knots[k - 1]))
            at[float(knots[k])] = R
        return np.array([at[float(t)] for t in self._times])

    @property
    def R_os(self) -> Array:
        """(f, 3, 3) the same in optical axes, s those of the first frame."""
        attitudes: Array = R_co.T @ self.R_sc.transpose(0, 2, 1) @ R_co
        return attitudes

    def turned(self, camera: Camera, a: int, b: int, pixels: Array) -> Array:
        """Where pixels (n, 2) of frame a are in frame b but for the camera's way."""
        R_ba = self.R_sc[b].T @ self.R_sc[a]
        return camera.pixels(points_of(camera.normalised(pixels)) @ R_ba.T)

    def flow(self, camera: Camera, frame: int, pixel: Array) -> Array:
        """How fast (2,) a pixel moves by the camera's turning [px/s] as a frame is taken."""
        t = self._samples[:, 0]
        rate = np.array([np.interp(self._times[frame], t, self._samples[:, k]) for k in (1, 2, 3)])
        ray = points_of(camera.normalised(pixel[None]))
        both = np.vstack((ray @ exp(rate * MOMENT_S), ray @ exp(-rate * MOMENT_S)))
        after, before = camera.pixels(both)
        speed: Array = (after - before) / (2.0 * MOMENT_S)
        return speed

    def up_in_c(self, frame: int) -> Array:
        """(3,) Unit vector up in a frame's camera, from the specific force about it.

        Forces of half a second are turned into that frame, where the hand's motion evens out.
        """
        t = self._samples[:, 0]
        near = np.abs(self._times - self._times[frame]) < STILL_S
        ups = []
        for k in np.flatnonzero(near):
            force = [np.interp(self._times[k], t, self._samples[:, c]) for c in (4, 5, 6)]
            ups.append(self.R_sc[frame].T @ self.R_sc[k] @ np.array(force))
        up = np.mean(ups, axis=0)
        unit: Array = up / np.linalg.norm(up)
        return unit
