"""The filter in plain numpy, measurements in order: what the compiled one must agree with."""

import numpy as np

from pipeline.estimation.relative_model import H_POSE, N, States, rk4_step, transition
from pipeline.frames import wrap


def predict(x, P, h, walk, tau_delta):
    """One step of `h` seconds, half of the process noise before the motion and half after it."""
    Phi, Q = transition(x, h), 0.5 * h * np.diag(walk)
    P = Phi @ (P + Q) @ Phi.T + Q
    fade = np.ones(N)
    fade[States.delta_cf_in_c] = np.exp(-h / tau_delta)
    return fade * rk4_step(x, h), np.outer(fade, fade) * P


def fuse(x, P, H, y, R):
    """Kalman update in one block."""
    residual = y - H @ x
    if H is H_POSE:
        residual[3:] = wrap(residual[3:])
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    return x + K @ residual, P - K @ S @ K.T, float(residual @ np.linalg.solve(S, residual))
