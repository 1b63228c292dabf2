"""The compiled arithmetic of `relative_filter`.

State: x (19,) = p, u, four biases in the order of the inputs (ω_b, f_b, ω_c, f_c), time offset;
R (3, 3) beside it. Error state (22): δp, θ, δu, the biases, the offset. Between two pictures only
the moving part changes, so F (9, 9), G (9, 12) and the noise Q (9, 9) are gathered step by step
and the covariance is touched once.

Of a body without motion sensors, samples say beside rates and the force at rest (6,) its velocity
(3,) in b and how far each of the three is doubted (3,), as square roots of noise densities:
`told_velocity_kernels` says what u is then.

While the body's sensors have a tone, both are longer by its amplitudes: of the cosine (6,) in ω_b
and f_b, and of the sine (6,); G has so many columns more.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from pipeline.estimation.gravity_free_kernels import step
from pipeline.estimation.hand_motion_kernels import PREDICTED_S, forecast_at
from pipeline.estimation.imu_interpolation_kernels import put_noise, sample_at
from pipeline.estimation.told_velocity_kernels import doubt, move
from pipeline.frames import Array
from pipeline.so3_kernels import kernel, put_exp

N, MOVING, INPUTS = 22, 9, 12
"""Error states; those that move; inputs."""
BIASES, OFFSET = 9, 21
"""First error state of the biases; of the time offset."""
X, X_BIASES, X_OFFSET = 19, 6, 18
"""Length of x, and where the same stand there."""
TONE, X_TONE, BODY = N, X, 6
"""Where a tone's amplitudes stand, if there is one; inputs of the body."""
MAX_STEP_S = 0.01
SAID, TOLD = 9, 12
"""Of a body without motion sensors: numbers that it says, and those of a sample with its doubts."""


@kernel
def gather(
    F: Array,
    G: Array,
    Q: Array,
    f: Array,
    g: Array,
    s: Array,
    h: float,
    w: Array,
    swing: tuple[float, float] = (0.0, 0.0),
) -> None:
    """Put a step (f, g) behind F, G, Q; s (12,) are the noise densities of its inputs [unit²/Hz].

    f is zero but for (p: p θ u), (θ: θ), (u: θ u); w (9, columns of G) is scratch memory. `swing`
    are cosine and sine of a tone's phase, if G has columns for its amplitudes.
    """
    for A, n in ((F, MOVING), (G, G.shape[1])):
        _times_step(f, A, n, w)
        for i in range(MOVING):
            for j in range(n):
                A[i, j] = w[i, j]
    for i in range(MOVING):
        for j in range(INPUTS):
            G[i, j] += g[i, j]
        for j in range(INPUTS, G.shape[1]):
            column = (j - INPUTS) % BODY
            G[i, j] += g[i, column] * swing[(j - INPUTS) // BODY]
    _times_step(f, Q, MOVING, w)
    for i in range(MOVING):
        for j in range(i + 1):
            q = 0.0
            if j < 3:
                for k in range(MOVING):
                    q += w[i, k] * f[j, k]
            elif j < 6:
                for k in range(3, 6):
                    q += w[i, k] * f[j, k]
            else:
                for k in range(3, MOVING):
                    q += w[i, k] * f[j, k]
            for k in range(INPUTS):
                q += g[i, k] * g[j, k] * (s[k] / h)
            Q[i, j] = q
    for i in range(MOVING):
        for j in range(i):
            Q[j, i] = Q[i, j]


@kernel
def _times_step(f: Array, A: Array, n: int, w: Array) -> None:
    """w = f A over n columns."""
    for i in range(MOVING):
        first, last = (0, 9) if i < 3 else (3, 6) if i < 6 else (3, 9)
        for j in range(n):
            w[i, j] = 0.0
        for k in range(first, last):
            fik = f[i, k]
            if fik != 0.0:
                for j in range(n):
                    w[i, j] += fik * A[k, j]


@kernel
def apply(P: Array, F: Array, G: Array, Q: Array, walks: Array, span: float, w: Array) -> None:
    """Carry P (22, 22) over a transition; walks (13,) densities of biases and offset [unit²/s].

    Inputs are samples *less* biases, so biases act with −G; w (2, 9, 22) is scratch memory. Where
    there is a tone, P, walks and w have 12 more for its amplitudes, which act as biases do.
    """
    U, V = w[0], w[1]
    n = P.shape[0]
    for i in range(MOVING):  # U = [F −G] P
        for j in range(n):
            U[i, j] = 0.0
        for k in range(MOVING):
            fik = F[i, k]
            for j in range(n):
                U[i, j] += fik * P[k, j]
        for k in range(G.shape[1]):
            gik, row = G[i, k], BIASES + k if k < INPUTS else TONE - INPUTS + k
            for j in range(n):
                U[i, j] -= gik * P[row, j]
    for i in range(MOVING):
        for j in range(i + 1):
            v = Q[i, j]
            for k in range(MOVING):
                v += U[i, k] * F[j, k]
            for k in range(G.shape[1]):
                v -= U[i, BIASES + k if k < INPUTS else TONE - INPUTS + k] * G[j, k]
            V[i, j] = v
    for i in range(MOVING):
        for j in range(i + 1):
            P[i, j] = P[j, i] = V[i, j]
        for j in range(BIASES, n):
            P[i, j] = P[j, i] = U[i, j]
    for k in range(n - BIASES):
        P[BIASES + k, BIASES + k] += walks[k] * span


@kernel
def take_errors(
    t: float, x: Array, tone: tuple[float, float], inputs: Array
) -> tuple[float, float]:
    """Take biases and tone off the inputs (12,) at `t`; gives cosine and sine of its phase."""
    for k in range(INPUTS):
        inputs[k] -= x[X_BIASES + k]
    if x.shape[0] == X:
        return 0.0, 0.0
    phase = tone[0] * (t - tone[1])
    along, across = cos(phase), sin(phase)
    for k in range(BODY):
        inputs[k] -= along * x[X_TONE + k] + across * x[X_TONE + BODY + k]
    return along, across


@kernel
def transit(
    x: Array,
    R: Array,
    R_ic: Array,
    F: Array,
    G: Array,
    Q: Array,
    span: tuple[float, float],
    t_b: Array,
    v_b: Array,
    t_c: Array,
    v_c: Array,
    noise: Array,
    hand: Array,
    w: Array,
    tone: tuple[float, float] = (0.0, 0.0),
) -> int:
    """Carry x, R from span[0] to span[1] through both IMUs' samples; gather F, G, Q from nothing.

    `noise` (2, 4, 3) by (body, phone) and (gyroscope, accelerometer, velocity): standard deviation
    of a sample, density by which the truth wanders between and after samples, its drift after the
    last one, full scale. `hand` (n, 6): forecast of `hand_predictor` beyond the phone's last
    sample; empty: that is held. `tone`: angular rate [rad/s] of the one whose amplitudes x has, and
    a time at which its phase is nought [s]. R_ic (3, 3) goes on gathering the camera's rotation
    since the phone's last sample. Gives the count of steps.
    """
    F[:], G[:], Q[:] = 0.0, 0.0, 0.0
    for k in range(MOVING):
        F[k, k] = 1.0
    s, turn_c = np.empty(INPUTS), np.empty((3, 3))
    inputs, f, g = np.empty(INPUTS), np.empty((9, 9)), np.empty((9, 12))
    scratch = np.empty(G.shape)
    is_told, said = v_b.shape[1] == TOLD, np.zeros(v_b.shape[1])
    of_body = np.empty(SAID if is_told else BODY)
    ahead, begun = np.empty(6), np.empty(6)
    t, t_end = span
    b = int(np.searchsorted(t_b, t, side="right")) - 1
    c = int(np.searchsorted(t_c, t, side="right")) - 1
    last, steps = t_c.shape[0] - 1, 0
    if c < last:
        R_ic[:] = np.eye(3)
    while t < t_end:
        until = min(t_end, t + MAX_STEP_S)
        if b + 1 < t_b.shape[0]:
            until = min(until, t_b[b + 1])
        if c < last:
            until = min(until, t_c[c + 1])
        h, middle = until - t, 0.5 * (t + until)
        if h > 0.0:
            beyond = sample_at(t_b, v_b, b, middle, said)
            put_noise(t_b, v_b, b, middle, beyond, noise[0], h, of_body)
            if is_told:
                for k in range(SAID):
                    of_body[k] += said[SAID + k // 3] ** 2
            inputs[0:6], s[0:6] = said[0:6], of_body[0:6]
            beyond = sample_at(t_c, v_c, c, middle, inputs[6:12])
            put_noise(t_c, v_c, c, middle, beyond, noise[1], h, s[6:12])
            if c == last and hand.shape[0] > 0:
                forecast_at(hand, t - t_c[last], begun)
                forecast_at(hand, until - t_c[last], ahead)
                unpredicted = max(beyond - PREDICTED_S, 0.0)
                for k in range(3):  # in place of the drift
                    s[6 + k] += noise[1, 2, 0] ** 2 * (unpredicted**3 - beyond**3)
                    s[6 + k] += (ahead[3 + k] * ahead[3 + k] - begun[3 + k] * begun[3 + k]) / h
                forecast_at(hand, middle - t_c[last], ahead)
                inputs[6:9] = ahead[0:3]
            swing = take_errors(middle, x, tone, inputs)
            step(x, R, inputs, h, w, f, g)
            if is_told:
                move(x, R, inputs, said[6:9], h, w, f, g)
            gather(F, G, Q, f, g, s, h, scratch, swing)
            if is_told:
                doubt(Q, R, of_body[6:9], h)
            if c == last:
                put_exp(h * inputs[6], h * inputs[7], h * inputs[8], turn_c)
                R_ic[:] = R_ic @ turn_c
            steps += 1
        t = until
        while b + 1 < t_b.shape[0] and t_b[b + 1] <= t:
            b += 1
        while c < last and t_c[c + 1] <= t:
            c += 1
    return steps


@kernel
def inputs_at(
    t: float,
    x: Array,
    t_b: Array,
    v_b: Array,
    t_c: Array,
    v_c: Array,
    hand: Array,
    tone: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """The inputs (12,) at time `t`, biases and tone removed."""
    inputs = np.empty(INPUTS)
    b = int(np.searchsorted(t_b, t, side="right")) - 1
    c = int(np.searchsorted(t_c, t, side="right")) - 1
    sample_at(t_b, v_b, b, t, inputs[0:6])
    sample_at(t_c, v_c, c, t, inputs[6:12])
    if c == t_c.shape[0] - 1 and hand.shape[0] > 0:
        ahead = np.empty(6)
        forecast_at(hand, t - t_c[c], ahead)
        inputs[6:9] = ahead[0:3]
    take_errors(t, x, tone, inputs)
    return inputs
