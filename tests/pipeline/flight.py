"""The default estimator in a `World`: fed and asked as the control loop does, and lied to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hardware.sim.world.sensors import give
from hardware.sim.world.world import LEDS_IN_B
from pipeline.estimation.relative_filter import RelativeFilter
from pipeline.estimator_config import RelativeConfig
from pipeline.signals import VisionMeasurement


def new():
    return RelativeFilter(RelativeConfig(), LEDS_IN_B)


class Flight:
    """A filter that is fed and asked every 5 ms, and compared with the truth."""

    def __init__(self, world, arriving):
        self.filter, self.now, self._world = new(), 0.1, world
        self._queue = list(arriving)
        self.outcomes = []
        """(picture, what became of it)."""

    def to(self, until, change=lambda sample: sample, ask=True):
        """The state at `until`; `change` may change a sample, or give None for none."""
        state = None
        while self.now < until - 1e-9:
            self.now = round(self.now + 0.005, 9)
            while self._queue and self._queue[0][0] <= self.now:
                sample = change(self._queue.pop(0)[1])
                if sample is not None:
                    self.give(sample)
            state = self.filter.state(self.now) if ask else None
        return state

    def give(self, sample):
        fusion = give(self.filter, sample, self.now)
        if isinstance(sample, VisionMeasurement):
            self.outcomes.append((sample, fusion))
        return fusion

    def error(self, state):
        """Of the place [m]."""
        e = state.p_bc_in_c - self._world.p[self._world.index(state.t)]
        return float(np.sqrt(e @ e))


def is_finite(state):
    parts = (state.p_bc_in_c, state.R_cb, state.u_bf_in_c, state.omega_bf_in_b, state.omega_cf_in_c)
    rest = (state.R_ic, state.sigma_p, state.sigma_theta, state.age)
    return all(np.isfinite(part).all() for part in (*parts, *rest))


def shifted(seen, dp=(0.0, 0.0), of=(0, 1, 2, 3, 4), dt=0.0):
    """The picture of a robot that is `dp` [m] beside its place, or of some LEDs that are, and
    stamped `dt` [s] later."""
    rays, pose = seen.rays, seen.pose
    q_x = pose.p_bc_in_c[0] + LEDS_IN_B[rays.led] @ pose.R_cb[0]
    moved = np.isin(rays.led, of)[:, None] * np.array(dp) / q_x[:, None]
    p = pose.p_bc_in_c + np.array((0.0, *dp)) * (len(of) == len(LEDS_IN_B))
    return VisionMeasurement(
        seen.t + dt,
        replace(rays, t=rays.t + dt, tangents=rays.tangents + moved),
        replace(pose, t=pose.t + dt, p_bc_in_c=p),
    )
