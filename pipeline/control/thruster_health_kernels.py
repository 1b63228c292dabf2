"""One period of `thruster_health`, compiled: which single thruster explains what is measured?"""

from __future__ import annotations

import numpy as np

from pipeline.frames import Array
from pipeline.linear_kernels import cholesky, solve_by
from pipeline.so3_kernels import kernel


@kernel
def put_row(
    rows: Array, k: int, A: Array, inertia: Array, omega: Array, f: Array, u: Array, h: float
) -> None:
    """Row k of (n, 16 + 2 m), after row k − 1: what has been measured and predicted until now.

    Sums since the beginning of h [s]; of the measured wrench, of the same less the thrusters', (6,)
    each [N s, N m s]; of thrusts (m,) [N s]; then the thrusts of now (m,) [N], and the sum of the
    gyroscopic torque (3,) [N m s].

    Args:
        rows: The ring.
        k: Where in it.
        A: (6, m) wrench of thrusts.
        inertia: (6,) mass [kg], moments [kg m²].
        omega: Gyroscope (3,) [rad/s].
        f: Specific force (3,) [m/s²].
        u: Thrusts that the model has now (m,) [N].
        h: Since the row before [s].
    """
    n, m = rows.shape[0], u.shape[0]
    before = (k - 1) % n
    J, w = inertia[3:], omega
    row, last = rows[k], rows[before]
    row[0] = last[0] + h
    for i in range(3):
        row[1 + i] = last[1 + i] + inertia[i] * f[i] * h
    # ∫(J ω̇ + ω × J ω): the gyroscopic part is a sum of its own, in the last three columns
    gyroscopic = 13 + 2 * m
    row[gyroscopic] = last[gyroscopic] + (w[1] * J[2] * w[2] - w[2] * J[1] * w[1]) * h
    row[gyroscopic + 1] = last[gyroscopic + 1] + (w[2] * J[0] * w[0] - w[0] * J[2] * w[2]) * h
    row[gyroscopic + 2] = last[gyroscopic + 2] + (w[0] * J[1] * w[1] - w[1] * J[0] * w[0]) * h
    for i in range(3):
        row[4 + i] = J[i] * w[i] + row[gyroscopic + i]
    for j in range(m):
        row[13 + j] = last[13 + j] + u[j] * h
        row[13 + m + j] = u[j]
    for i in range(6):
        row[7 + i] = row[1 + i]
        for j in range(m):
            row[7 + i] -= A[i, j] * row[13 + j]


@kernel
def judge(
    rows: Array,
    k: int,
    windows: tuple[int, int, int],
    A: Array,
    usual: Array,
    errors: tuple[float, float, float],
    ratios: Array,
    lost: Array,
) -> float:
    """2 ln of the likelihood of nothing but what is usual, negative; `ratios` and `lost` are set.

    Args:
        rows: As `put_row` leaves them; row k is the newest.
        k: Where in them.
        windows: Rows of now, of now and the pause before, of all.
        A: (6, m).
        usual: (6,) variance of what else may have changed [N², N² m²].
        errors: Standard deviations of the thrusters' lag [s], of what each gives and of mass and
            moments of inertia, as shares.
        ratios: (m,) becomes 2 ln of the likelihood that this one has failed, to none.
        lost: (m,) becomes the likeliest share that it does not give.
    """
    n, m = rows.shape[0], A.shape[1]
    now, since = rows[k], rows[(k - windows[0]) % n]
    until, begin = rows[(k - windows[1]) % n], rows[(k - windows[2]) % n]
    h_now, h_before = now[0] - since[0], until[0] - begin[0]
    S, apart = np.zeros((6, 6)), np.empty(6)
    for i in range(6):
        measured = (now[1 + i] - since[1 + i]) / h_now - (until[1 + i] - begin[1 + i]) / h_before
        apart[i] = (now[7 + i] - since[7 + i]) / h_now - (until[7 + i] - begin[7 + i]) / h_before
        S[i, i] = usual[i] + (errors[2] * measured) ** 2
    thrust, change = np.empty(m), np.empty(m)
    for j in range(m):
        thrust[j] = (now[13 + j] - since[13 + j]) / h_now
        change[j] = thrust[j] - (until[13 + j] - begin[13 + j]) / h_before
        rate = (now[13 + m + j] - since[13 + m + j]) / h_now
        spread = (errors[1] * change[j]) ** 2 + (errors[0] * rate) ** 2
        for i in range(6):
            for c in range(i + 1):
                S[i, c] += spread * A[i, j] * A[c, j]
    ratios[:], lost[:] = 0.0, 0.0
    if not cholesky(S, 0.0):
        return 0.0
    white = apart.copy()
    solve_by(S, white)
    total = 0.0
    for i in range(6):
        total += apart[i] * white[i]
    column = np.empty(6)
    for j in range(m):
        column[:] = A[:, j]
        solve_by(S, column)
        along, size = 0.0, 0.0
        for i in range(6):
            along -= white[i] * A[i, j]
            size += column[i] * A[i, j]
        for past in range(2):  # it failed in the pause between the windows, or before them
            u = change[j] if past else thrust[j]
            if u * along <= 0.0 or size == 0.0:
                continue
            share = min(along / (u * size), 1.0)
            ratio = 2.0 * share * u * along - (share * u) ** 2 * size
            if ratio > ratios[j]:
                ratios[j], lost[j] = ratio, share
    return total
