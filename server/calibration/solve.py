"""From views of a board to a camera: lens, readout, how the gyroscope sits, and how sure all is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens import COLUMNS, ROWS
from pipeline.frames import Array, R_co
from server.calibration.board import Board
from server.calibration.bundle import BoardFit, ParameterPrior, by_view, fit
from server.calibration.camera_imu import CameraImu, GyroSpline, ImuError, align
from server.calibration.choice import Choice, choose
from server.calibration.lens import normalised, prior_sigma, project
from server.calibration.motion import Rates, rates
from server.calibration.projection import BoardCorners, Guess, film_of
from server.calibration.start import first_guess, plain_lens, poses
from server.calibration.views import BoardView

FEWEST_VIEWS = 8
"""For a fit at all; `verdict` asks for more."""
FEWEST_MOVING = 8
"""Views whose rates are known, for the readout."""
READOUT_SIGMA_S = 0.05
"""Of readouts of phones, before anything is known; negative where a picture was turned round."""
ROUNDS = 3
"""Rates come from poses, poses from the readout, the readout from rates."""
OUTLIER = 3.0
"""A view whose error is so many times the median one was named or measured wrongly."""
RATES_SHARE = 0.02
"""Share by which the rates of all views may be too slow or too fast alike."""
GYRO_FLOOR = 0.005
"""Error of a gyroscope's rate at one moment [rad/s]."""
GRID = (17, 11)
"""Columns, rows of the points at which the lens's uncertainty is looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationSolution:
    """A calibrated camera and what it rests on."""

    model: str
    size: tuple[int, int]
    """Width and height [px]."""
    choice: Choice
    left_out: int
    """Chosen views that do not fit the others: named or measured wrongly."""
    fit: BoardFit
    film: BoardCorners
    """Of the fit."""
    held_out_px: float
    """RMS distance of corners in views that the fit never saw; nan without such views."""
    fitted_px: float
    """The same of the views it did see."""
    readout_known: bool
    readout_axis: int
    """As of `Camera`."""
    imu: CameraImu | None
    imu_complaint: str
    """Why there is none, "" if nobody asked."""

    @property
    def shared(self) -> Array:
        """Lens and readout (5 + k,)."""
        return self.fit.guess.shared

    @property
    def sigma(self) -> Array:
        """(5 + k,) of the same; the readout's counts that all rates may be a little wrong alike."""
        sigma = np.sqrt(np.diag(self.fit.covariance))
        sigma[-1] = np.hypot(sigma[-1], RATES_SHARE * abs(self.shared[-1]))
        return sigma


def solve(
    views: Sequence[BoardView],
    board: Board,
    size: tuple[int, int],
    model: str,
    gyro: GyroSpline | None = None,
    timed: bool = True,
) -> CalibrationSolution | None:
    """Calibrate; None with less than `FEWEST_VIEWS` sharp, different views.

    `views` are in order of time; without `timed` their times mean nothing (single photographs).
    """
    choice = choose(views, board, size)
    if len(choice.fit) < FEWEST_VIEWS:
        return None
    work = _Work(board, size, model, gyro, timed)
    still = work.without_motion(choice.fit)
    kept = [v for v, good in zip(choice.fit, _believable(still, work.film), strict=True) if good]
    if len(kept) < FEWEST_VIEWS:
        kept = choice.fit
    if len(kept) < len(choice.fit):
        still = work.without_motion(kept)
    found, known = work.with_motion(still, kept, views) if timed else (still, False)
    if known:  # a phone held upright: the picture's columns are the sensor's rows
        other = work.along(COLUMNS, kept)
        turned, known_too = other.with_motion(still, kept, views)
        if known_too and turned.sigma_px < found.sigma_px:
            work, found = other, turned
    return CalibrationSolution(
        model,
        size,
        replace(choice, fit=kept),
        len(choice.fit) - len(kept),
        found,
        work.film,
        work.judged(found, choice.held_out),
        _rms(found.residuals),
        known,
        work.axis,
        work.imu,
        work.imu_complaint,
    )


def _believable(found: BoardFit, film: BoardCorners) -> npt.NDArray[np.bool_]:
    """Whether (n,) a view's error is an ordinary one."""
    errors = np.sqrt(by_view(film, (found.residuals**2).sum(axis=1)))
    errors = errors / np.sqrt(np.diff(np.append(film.starts, len(film.view))))
    return np.asarray(errors <= max(OUTLIER * float(np.median(errors)), 0.3))


def _rms(residuals: Array) -> float:
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))


class _Work:
    """State of one calibration."""

    def __init__(
        self, board: Board, size: tuple[int, int], model: str, gyro: GyroSpline | None, timed: bool
    ) -> None:
        self._board, self._size, self._model, self._gyro = board, size, model, gyro
        self._middle = plain_lens(model, size, 0.75 * max(size))
        self._by_time: dict[float, int] = {}
        self._rates: Rates | None = None
        self.axis = ROWS
        self.film: BoardCorners
        self.imu: CameraImu | None = None
        untimed = "imu: the pictures have no times: add times.csv or --fps"
        self.imu_complaint = untimed if gyro is not None and not timed else ""

    def along(self, axis: int, views: Sequence[BoardView]) -> _Work:
        """The same with lines read along the other axis; before it moves, nothing depends on it."""
        other = _Work(self._board, self._size, self._model, self._gyro, timed=True)
        other.axis = axis
        other.film = film_of(views, self._board, self._model, self._size, axis)
        return other

    def without_motion(self, views: Sequence[BoardView]) -> BoardFit:
        """Solve as if the shutter opened all rows at once."""
        self.film = film_of(views, self._board, self._model, self._size, self.axis)
        guess = first_guess(self._model, views, self._board, self._size)
        nothing = np.zeros((len(views), 6))
        return fit(self.film, guess, self._prior(nothing, nothing, 0.0), with_rates=False)

    def with_motion(
        self, still: BoardFit, views: Sequence[BoardView], everything: Sequence[BoardView]
    ) -> tuple[BoardFit, bool]:
        """Rates by the neighbours in time, then all together; whether a readout could be told."""
        found = still
        for _ in range(ROUNDS):
            self._rates = self._rates_of_all(found.guess.shared, everything)
            self._by_time = {view.t: k for k, view in enumerate(everything)}
            at = [self._by_time[view.t] for view in views]
            if int(self._rates.known[at].sum()) < FEWEST_MOVING:
                return still, False
            value, sigma = self._rates.value[at], self._rates.sigma[at]
            start = replace(found.guess, rates=value)
            prior = self._prior(value, sigma, READOUT_SIGMA_S)
            found = fit(self.film, start, prior, with_rates=True)
        return found, True

    def _rates_of_all(self, shared: Array, views: Sequence[BoardView]) -> Rates:
        """Poses of all views with the lens as it stands, and their derivatives."""
        film = film_of(views, self._board, self._model, self._size, self.axis)
        R, p = poses(self._model, shared[:-1], views, self._board)
        now = self._rates
        value = np.zeros((len(views), 6)) if now is None else now.value
        held = ParameterPrior(shared, np.zeros(len(shared)), value, np.ones((len(views), 6)))
        found = fit(film, Guess(shared, R, p, value), held, with_rates=False)
        t = np.array([view.t for view in views])
        R, p = found.guess.R_og, found.guess.p_go_in_o
        return self._with_gyro(t, R, rates(t, R, p, found.pose_sigma))

    def _with_gyro(self, t: Array, R_og: Array, seen: Rates) -> Rates:
        """The turn rates by the gyroscope, where there is one."""
        if self._gyro is None:
            return seen
        try:
            imu = align(t, R_og, self._gyro)
        except ImuError as error:
            self.imu, self.imu_complaint = None, str(error)
            return seen
        self.imu, self.imu_complaint = imu, ""
        at = t + imu.time_offset_s
        there = self._gyro.covers(at)
        omega_co_in_c = (self._gyro.rate(at) - imu.bias_in_i) @ imu.R_ci.T
        value, sigma = seen.value.copy(), seen.sigma.copy()
        value[there, :3] = -(omega_co_in_c @ R_co)[there]
        sigma[there, :3] = GYRO_FLOOR
        return Rates(value, sigma, seen.known | there)

    def _prior(self, value: Array, sigma: Array, readout_sigma_s: float) -> ParameterPrior:
        lens = prior_sigma(self._model, max(self._size))
        return ParameterPrior(
            np.append(self._middle, 0.0), np.append(lens, readout_sigma_s), value, sigma
        )

    def judged(self, found: BoardFit, views: Sequence[BoardView]) -> float:
        """RMS error of believable views that were kept out, each with its own pose [px]."""
        if len(views) == 0:
            return float("nan")
        shared, n = found.guess.shared, len(views)
        film = film_of(views, self._board, self._model, self._size, self.axis)
        R, p = poses(self._model, shared[:-1], views, self._board)
        value, sigma = np.zeros((n, 6)), np.ones((n, 6))
        if self._rates is not None:
            at = [self._by_time[view.t] for view in views]
            value, sigma = self._rates.value[at], self._rates.sigma[at]
        prior = ParameterPrior(shared, np.zeros(len(shared)), value, sigma)
        start = Guess(shared, R, p, value)
        placed = fit(film, start, prior, with_rates=self._rates is not None)
        return _rms(placed.residuals[_believable(placed, film)[film.view]])


def ray_sigma(solution: CalibrationSolution) -> Array:
    """Uncertainty (rows, columns) of the pixel of a given direction, over the picture [px].

    A turn of the whole camera is free: what it could explain is no error of the lens.
    """
    columns, rows = GRID
    width, height = solution.size
    u, v = np.meshgrid(np.linspace(0, width - 1.0, columns), np.linspace(0, height - 1.0, rows))
    pixels = np.column_stack((u.ravel(), v.ravel()))
    lens = solution.shared[:-1]
    rays = np.column_stack((normalised(solution.model, lens, pixels), np.ones(len(pixels))))
    _, by_point, by_lens = project(solution.model, lens, rays)
    turns = np.stack([np.cross(axis, rays) for axis in np.eye(3)], axis=2)
    by_turn = (by_point @ turns).reshape(-1, 3)
    J = by_lens.reshape(len(by_turn), -1)
    J = J - by_turn @ np.linalg.lstsq(by_turn, J, rcond=None)[0]
    variances = np.einsum("ij,jk,ik->i", J, solution.fit.covariance[:-1, :-1], J)
    sigma: Array = np.sqrt(np.maximum(variances, 0.0).reshape(-1, 2).sum(axis=1))
    return sigma.reshape(rows, columns)
