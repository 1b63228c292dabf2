"""One axis of a body in a closed loop, in steps of 0.5 ms, whatever frequency responses may say."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from pipeline.control.dynamics import Dynamics

H, FINE = 0.005, 0.0005
FAR = 1e3


def grows(
    plant: Dynamics, axis: int, late: float, control: Callable[[float, float], float]
) -> bool:
    """Whether a body that is 0.01 m or rad off goes off more and more.

    Args:
        plant: The body and its thrusters.
        axis: 0 to 5.
        late: The thrusters' delay beside the plant's [s].
        control: Force or torque by place and rate, called each `H`.
    """
    waiting = deque([0.0] * round((late + plant.delay) / FINE))
    m, c, k = plant.inertia[axis], plant.damping[axis], plant.stiffness[axis]
    x, v, force, command, sizes = 0.01, 0.0, 0.0, 0.0, []
    for step in range(round(24.0 / FINE)):
        if step % round(H / FINE) == 0:
            command = control(x, v)
        waiting.append(command)
        force += FINE / plant.lag * (waiting.popleft() - force)
        v += FINE * (force - c * v - k * x) / m
        x += FINE * v
        sizes.append(abs(x))
        if sizes[-1] > FAR:
            return True
    third = len(sizes) // 3
    return max(sizes[-third:]) > max(sizes[third : 2 * third])
