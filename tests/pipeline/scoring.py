"""How far a filter is from the truth of a `scenario.World`, and whether it knows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.pipeline.scenario import World, feed, log_each


@dataclass(frozen=True)
class Score:
    """RMS errors at now over the ticks of one run, or of several (see `together`)."""

    position_mm: float
    attitude_deg: float
    u_mm_s: float
    nees: float
    """Mean of the normalised squared error of (p, θ), 6 when the filter is honest."""
    held_position_mm: float
    """Of p seen in the frame of the phone's last sample: what a virtual camera works with."""


def score(ekf, world: World, start: float = 5.0, stop: float = np.inf) -> Score:
    """Run `ekf` through `world` and judge every state at start ≤ now < stop [s]."""
    rows = []
    for now, state in feed(ekf, world):
        if start <= now < stop and state is not None:
            last = ekf._filter.history.newest[1]
            rows.append((now, last, state, ekf.pose_covariance))
    now, last, states, C = zip(*rows, strict=True)
    i, j = world.index(now), world.index(last)
    p = np.array([s.p_bc_in_c for s in states])
    R = np.array([s.R_cb for s in states])
    u = np.array([s.u_bf_in_c for s in states])
    R_ic = np.array([s.R_ic for s in states])
    e_p = world.p[i] - p
    e_theta = log_each(R.transpose(0, 2, 1) @ world.R[i])
    e = np.concatenate((e_p, e_theta), axis=1)
    nees = np.einsum("ni,ni->n", e, np.linalg.solve(np.array(C), e[..., None])[..., 0])
    R_ic_true = world.R_fc[j].transpose(0, 2, 1) @ world.R_fc[i]
    held = np.einsum("nij,nj->ni", R_ic_true, world.p[i]) - np.einsum("nij,nj->ni", R_ic, p)
    return Score(
        1e3 * _rms(e_p),
        np.rad2deg(_rms(e_theta)),
        1e3 * _rms(world.u[i] - u),
        float(nees.mean()),
        1e3 * _rms(held),
    )


def together(scores: list[Score]) -> Score:
    """Root mean square of the errors, mean of the NEES."""
    table = np.array(
        [(s.position_mm, s.attitude_deg, s.u_mm_s, s.nees, s.held_position_mm) for s in scores]
    )
    rms = np.sqrt(np.square(table).mean(axis=0))
    rms[3] = table[:, 3].mean()
    return Score(*map(float, rms))


def assert_same(a, b, tolerance=1e-9):
    """Two relative states are equal."""
    for name in ("p_bc_in_c", "R_cb", "u_bf_in_c", "omega_bf_in_b", "omega_cf_in_c", "R_ic"):
        assert np.abs(getattr(a, name) - getattr(b, name)).max() < tolerance, name
    assert abs(a.sigma_p - b.sigma_p) < tolerance
    assert abs(a.sigma_theta - b.sigma_theta) < tolerance


def _rms(e):
    return float(np.sqrt(np.square(e).sum(axis=1).mean()))
