"""Bundle adjustment: places of few points and poses of many frames, poses eliminated first.

Elimination by Schur complement (Triggs, McLauchlan, Hartley & Fitzgibbon, "Bundle adjustment: a
modern synthesis", 2000), here of the poses, for they are the many.

Frames' poses turn points of the survey's frame s into optical axes o: q = R X + p.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array, exp

HUBER = 3.0
"""Standard deviations beyond which an observation counts less."""
ITERATIONS = 60  # at most, of Levenberg and Marquardt
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Rays of named points."""

    frame: Indices
    """(m,)."""
    point: Indices
    """(m,)."""
    tangents: Array
    """(m, 2) right and down, one metre ahead."""
    whiten: Array
    """(m, 2, 2): turns an error of tangents into standard deviations."""


@dataclass(frozen=True, slots=True)
class DistanceConstraint:
    """A measured distance of two points."""

    a: int
    b: int
    metres: float
    sigma_m: float


@dataclass(frozen=True, slots=True, eq=False)
class PointsAndPoses:
    """Points and poses."""

    points: Array
    """(n, 3) in s."""
    R: Array
    """(f, 3, 3)."""
    p: Array
    """(f, 3)."""

    def scaled(self, scale: float) -> PointsAndPoses:
        """Points and poses of something larger in the same images."""
        return PointsAndPoses(scale * self.points, self.R, scale * self.p)


@dataclass(frozen=True, slots=True, eq=False)
class BundleSolution:
    """Where it ended."""

    scene: PointsAndPoses
    cost: float
    """Robust sum of squares."""
    residuals: Array
    """(m, 2) in standard deviations."""
    information: Array
    """(3 n, 3 n) of the points, poses eliminated."""


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """Residuals and normal equations."""

    residuals: Array
    cost: float
    H_pp: Array
    H_px: Array
    H_xx: Array
    g_p: Array
    g_x: Array


def solve(
    start: PointsAndPoses, seen: Observations, tapes: tuple[DistanceConstraint, ...] = ()
) -> BundleSolution:
    """Maximum likelihood with outliers toned down, by Levenberg-Marquardt."""
    scene, damping = start, 1e-4
    linear = linearised(scene, seen, tapes)
    for _ in range(ITERATIONS):
        moved = _stepped(scene, linear, damping)
        tried = linearised(moved, seen, tapes)
        if not tried.cost < linear.cost:
            damping *= 10.0
            if damping > 1e8:
                break
            continue
        gained = linear.cost - tried.cost
        scene, linear, damping = moved, tried, max(0.1 * damping, 1e-9)
        if gained < 1e-8 * linear.cost + 1e-12:
            break
    return BundleSolution(scene, linear.cost, linear.residuals, _reduced(linear, 0.0)[0])


def residuals(scene: PointsAndPoses, seen: Observations) -> Array:
    """(m, 2) of the tangents."""
    q = np.einsum("mij,mj->mi", scene.R[seen.frame], scene.points[seen.point]) + scene.p[seen.frame]
    off: Array = seen.tangents - q[:, :2] / q[:, 2:]
    return off


def _errors(scene: PointsAndPoses, seen: Observations) -> tuple[Array, Array, Array]:
    """Whitened residuals (m, 2), points turned (m, 3) and their places in o (m, 3)."""
    turned = np.einsum("mij,mj->mi", scene.R[seen.frame], scene.points[seen.point])
    q = turned + scene.p[seen.frame]
    depth = np.where(q[:, 2] > 1e-6, q[:, 2], 1e-6)
    off = seen.tangents - q[:, :2] / depth[:, None]
    return np.einsum("mij,mj->mi", seen.whiten, off), turned, q


def _skews(v: Array) -> Array:
    zero = np.zeros(len(v))
    x, y, z = v.T
    return np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=1).reshape(-1, 3, 3)


def squares(scene: PointsAndPoses, seen: Observations) -> Array:
    """(f,) robust sum of squares of each frame; inf with a point behind the camera."""
    r, _, q = _errors(scene, seen)
    cost = np.zeros(len(scene.R))
    np.add.at(cost, seen.frame, np.where(q[:, 2] > 1e-6, _robust(r)[1], np.inf))
    return cost


def _robust(r: Array) -> tuple[Array, Array]:
    """Weights and robust squares of whitened residuals (m, 2). Huber."""
    size = np.linalg.norm(r, axis=1)
    weight = np.where(size > HUBER, HUBER / np.maximum(size, 1e-12), 1.0)
    return weight, np.where(size > HUBER, 2.0 * HUBER * size - HUBER**2, size**2)


def linearised(
    scene: PointsAndPoses, seen: Observations, tapes: tuple[DistanceConstraint, ...]
) -> Linear:
    """Normal equations of steps (δp, φ) of poses, R ← Exp(φ) R, and of points."""
    frames, points = len(scene.R), len(scene.points)
    r, turned, q = _errors(scene, seen)
    depth = np.where(q[:, 2] > 1e-6, q[:, 2], 1e-6)
    flat = np.zeros((len(q), 2, 3))
    flat[:, 0, 0] = flat[:, 1, 1] = 1.0 / depth
    flat[:, :, 2] = -q[:, :2] / depth[:, None] ** 2
    J_q = seen.whiten @ flat
    J_p = np.concatenate((J_q, -J_q @ _skews(turned)), axis=2)
    J_x = J_q @ scene.R[seen.frame]
    weight, robust = _robust(r)
    cost = float(robust.sum()) if q[:, 2].min() > 1e-6 else np.inf
    WJ_p, WJ_x = weight[:, None, None] * J_p, weight[:, None, None] * J_x
    H_pp, H_px = np.zeros((frames, 6, 6)), np.zeros((frames, points, 6, 3))
    H_xx, g_p, g_x = np.zeros((points, 3, 3)), np.zeros((frames, 6)), np.zeros((points, 3))
    np.add.at(H_pp, seen.frame, np.einsum("mki,mkj->mij", J_p, WJ_p))
    np.add.at(H_px, (seen.frame, seen.point), np.einsum("mki,mkj->mij", J_p, WJ_x))
    np.add.at(H_xx, seen.point, np.einsum("mki,mkj->mij", J_x, WJ_x))
    np.add.at(g_p, seen.frame, np.einsum("mki,mk->mi", WJ_p, r))
    np.add.at(g_x, seen.point, np.einsum("mki,mk->mi", WJ_x, r))
    all_xx = np.zeros((3 * points, 3 * points))
    for k in range(points):
        all_xx[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = H_xx[k]
    cost += add_tapes(scene.points, tapes, all_xx, g_x)
    wide = H_px.transpose(0, 2, 1, 3).reshape(frames, 6, 3 * points)
    return Linear(r, cost, H_pp, wide, all_xx, g_p, g_x.ravel())


def add_tapes(points: Array, tapes: tuple[DistanceConstraint, ...], H: Array, g: Array) -> float:
    """Adds tapes to normal equations of points H (3 n, 3 n), g (n, 3); their squares."""
    cost = 0.0
    for tape in tapes:
        arm = points[tape.a] - points[tape.b]
        length = float(np.linalg.norm(arm))
        off = (tape.metres - length) / tape.sigma_m
        row = np.zeros(g.shape)
        row[tape.a], row[tape.b] = arm / (length * tape.sigma_m), -arm / (length * tape.sigma_m)
        H += np.outer(row, row)
        g += off * row
        cost += off * off
    return cost


def _reduced(linear: Linear, damping: float) -> tuple[Array, Array, Array, Array]:
    """The points' own normal equations, and what gives the poses back."""
    extra = damping * np.einsum("fii->fi", linear.H_pp)
    H_pp = linear.H_pp + np.einsum("fi,ij->fij", extra + 1e-12, np.eye(6))
    inverse = np.linalg.inv(H_pp)
    K = inverse @ linear.H_px
    S = linear.H_xx - np.einsum("fij,fik->jk", linear.H_px, K)
    g = linear.g_x - np.einsum("fij,fi->j", K, linear.g_p)
    return S, g, K, np.einsum("fij,fj->fi", inverse, linear.g_p)


def _stepped(scene: PointsAndPoses, linear: Linear, damping: float) -> PointsAndPoses:
    S, g, K, alone = _reduced(linear, damping)
    diagonal = np.diag(linear.H_xx)
    d_x = np.linalg.solve(S + np.diag(damping * diagonal + 1e-9 * diagonal.max()), g)
    d_p = alone - K @ d_x
    turns = np.array([exp(turn) for turn in d_p[:, 3:]])
    return replace(
        scene,
        points=scene.points + d_x.reshape(-1, 3),
        R=turns @ scene.R,
        p=scene.p + d_p[:, :3],
    )


def covariance(scene: PointsAndPoses, information: Array) -> Array:
    """(3 n, 3 n) of the points, fitted onto any other layout as a rigid body.

    Where the whole is and how it is turned nobody knows: that part is taken out.
    """
    away = scene.points - scene.points.mean(axis=0)
    moves = np.tile(np.eye(3), (len(away), 1))
    turns = -_skews(away).reshape(-1, 3)
    basis, _ = np.linalg.qr(np.hstack((moves, turns)))
    inner = np.eye(len(basis)) - basis @ basis.T
    scale = float(np.trace(information)) / len(information)
    full = np.linalg.inv(information + scale * basis @ basis.T)
    result: Array = inner @ full @ inner
    return 0.5 * (result + result.T)
