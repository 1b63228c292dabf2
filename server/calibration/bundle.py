"""Bundle adjustment of a filmed board: lens and readout shared, pose and rates of each view.

Views touch each other only through the shared parameters, so each view's own are eliminated by
themselves (Schur complement; Triggs et al., "Bundle adjustment: a modern synthesis", 2000).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array, exp
from server.calibration.projection import BOTH, POSE, BoardCorners, Guess, linear, residuals_of

HUBER = 2.5
"""Residuals beyond this many σ count less."""
STEPS, ROUNDS = 25, 2
SMALL = 1e-6
"""Relative fall of the cost that ends the search."""


@dataclass(frozen=True, slots=True, eq=False)
class ParameterPrior:
    """Prior of the parameters; standard deviation 0 holds a parameter."""

    shared: Array
    shared_sigma: Array
    rates: Array
    """(n, 6)."""
    rates_sigma: Array
    """(n, 6)."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardFit:
    """The likeliest parameters."""

    guess: Guess
    residuals: Array
    """(m, 2) [px]."""
    sigma_px: float
    """Of one coordinate of a corner, by the residuals and the parameters they had to spare."""
    covariance: Array
    """(5 + k, 5 + k) of the shared parameters: the larger of what the residuals' size and what
    their scatter from view to view says; a held one has 0."""
    pose_sigma: Array
    """(n, 6) of each view's turn [rad] and place [m], the lens taken as known."""


@dataclass(slots=True, eq=False)
class _Normal:
    """Normal equations, by view."""

    A: Array
    B: Array
    C: Array
    g_view: Array
    g_shared: Array
    """(n, s) each view's part, without the prior."""
    cost: float


def fit(film: BoardCorners, start: Guess, prior: ParameterPrior, with_rates: bool) -> BoardFit:
    """The likeliest parameters, sought from `start`; without rates they stay as they are."""
    free = np.flatnonzero(prior.shared_sigma > 0.0)
    width, guess = BOTH if with_rates else POSE, start
    for _ in range(ROUNDS):
        noise = _noise_of(residuals_of(film, guess))
        guess = _descended(film, guess, prior, width, free, noise)
    return _judged(film, guess, prior, width, free)


def _descended(
    film: BoardCorners,
    guess: Guess,
    prior: ParameterPrior,
    width: int,
    free: npt.NDArray[np.intp],
    noise: float,
) -> Guess:
    """Levenberg-Marquardt."""
    damping = 1e-4
    normal = _normal(film, guess, prior, width, free, noise)
    for _ in range(STEPS):
        trial = _stepped(guess, normal, width, free, damping, prior)
        better = _normal(film, trial, prior, width, free, noise)
        if better.cost < normal.cost:
            fall = (normal.cost - better.cost) / max(normal.cost, 1e-12)
            guess, normal, damping = trial, better, max(0.1 * damping, 1e-9)
            if fall < SMALL:
                break
        elif damping > 1e4:
            break
        else:
            damping *= 10.0
    return guess


def _weights(residuals: Array, noise: float) -> Array:
    """Huber's weights (m,)."""
    size = np.sqrt((residuals * residuals).sum(axis=1)) / (noise * np.sqrt(2.0))
    weights: Array = np.minimum(1.0, HUBER / np.maximum(size, 1e-12)) / noise**2
    return weights


def _noise_of(residuals: Array) -> float:
    """Robust σ of one coordinate [px]."""
    return max(1.4826 * float(np.median(np.abs(residuals))), 1e-3)


def _normal(
    film: BoardCorners,
    guess: Guess,
    prior: ParameterPrior,
    width: int,
    free: npt.NDArray[np.intp],
    noise: float,
) -> _Normal:
    r, J_view, J_shared = linear(film, guess, width)
    J_shared = J_shared[:, :, free]
    w = _weights(r, noise)
    weighted = w[:, None, None] * J_view
    A = by_view(film, np.einsum("mki,mkj->mij", weighted, J_view))
    B = by_view(film, np.einsum("mki,mkj->mij", weighted, J_shared))
    C_each = np.einsum("m,mki,mkj->ij", w, J_shared, J_shared)
    g_view = by_view(film, np.einsum("mki,mk->mi", weighted, r))
    g_shared = by_view(film, np.einsum("m,mki,mk->mi", w, J_shared, r))
    size2 = (r * r).sum(axis=1) / noise**2 / 2.0
    bound = HUBER**2
    cost = np.where(size2 < bound, size2, 2.0 * HUBER * np.sqrt(size2) - bound).sum()
    off = (prior.shared - guess.shared)[free]
    cost += 0.5 * float(((off / prior.shared_sigma[free]) ** 2).sum())
    if width == BOTH:
        information = 1.0 / prior.rates_sigma**2
        missing = prior.rates - guess.rates
        diagonal = np.arange(POSE, BOTH)
        A[:, diagonal, diagonal] += information
        g_view[:, POSE:] += information * missing
        cost += 0.5 * float((information * missing**2).sum())
    return _Normal(A, B, C_each, g_view, g_shared, float(cost))


def by_view(film: BoardCorners, rows: Array) -> Array:
    """Sums (n, ...) over each view's corners of `rows` (m, ...)."""
    sums: Array = np.add.reduceat(rows, film.starts, axis=0)
    return sums


def _reduced(
    normal: _Normal, damping: float, prior: ParameterPrior, free: npt.NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Schur complement (s, s), A⁻¹ B (n, w, s), A⁻¹ g (n, w)."""
    A = normal.A.copy()
    diagonal = np.arange(A.shape[1])
    A[:, diagonal, diagonal] *= 1.0 + damping
    solved = np.linalg.solve(A, np.concatenate((normal.B, normal.g_view[..., None]), axis=2))
    AB, Ag = solved[..., :-1], solved[..., -1]
    C = normal.C.copy()
    C[np.diag_indices_from(C)] *= 1.0 + damping
    known = np.diag(prior.shared_sigma[free] ** -2.0)
    S: Array = C - np.einsum("nwi,nwj->ij", normal.B, AB) + known
    return S, np.asarray(AB, dtype=np.float64), np.asarray(Ag, dtype=np.float64)


def _stepped(
    guess: Guess,
    normal: _Normal,
    width: int,
    free: npt.NDArray[np.intp],
    damping: float,
    prior: ParameterPrior,
) -> Guess:
    S, AB, Ag = _reduced(normal, damping, prior, free)
    off = (prior.shared - guess.shared)[free] / prior.shared_sigma[free] ** 2
    g = normal.g_shared.sum(axis=0) + off - np.einsum("nwi,nw->i", normal.B, Ag)
    by_shared = np.linalg.solve(S, g) if len(free) else np.zeros(0)
    by_view = Ag - AB @ by_shared
    shared = guess.shared.copy()
    shared[free] += by_shared
    turns = np.array([exp(theta) for theta in by_view[:, :3]])
    return replace(
        guess,
        shared=shared,
        R_og=turns @ guess.R_og,
        p_go_in_o=guess.p_go_in_o + by_view[:, 3:6],
        rates=guess.rates + by_view[:, 6:] if width == BOTH else guess.rates,
    )


def _judged(
    film: BoardCorners, guess: Guess, prior: ParameterPrior, width: int, free: npt.NDArray[np.intp]
) -> BoardFit:
    residuals = residuals_of(film, guess)
    spare = max(residuals.size - POSE * len(film) - len(free), 1) / residuals.size
    noise = _noise_of(residuals) / np.sqrt(spare)
    normal = _normal(film, guess, prior, width, free, noise)
    S, AB, _ = _reduced(normal, 0.0, prior, free)
    count = len(guess.shared)
    covariance = np.zeros((count, count))
    if len(free):
        bread = np.linalg.inv(S)
        scores = normal.g_shared - np.einsum("nwi,nw->ni", AB, normal.g_view)
        spread = len(film) / max(len(film) - len(free), 1)
        sandwich = spread * bread @ (scores.T @ scores) @ bread / spare
        larger = np.maximum(np.diag(sandwich) / np.diag(bread), 1.0)
        covariance[np.ix_(free, free)] = bread * np.sqrt(np.outer(larger, larger))
    poses = np.linalg.inv(normal.A)[:, :POSE, :POSE]
    pose_sigma = np.sqrt(np.maximum(np.diagonal(poses, axis1=1, axis2=2), 0.0))
    return BoardFit(guess, residuals, noise, covariance, pose_sigma)
