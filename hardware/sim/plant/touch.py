"""Ground truth of contact: what a wall does to a tool, step by step of MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from pipeline.frames import Array


@dataclass(frozen=True, slots=True, eq=False)
class ContactForce:
    """Contact force in the plant's last step."""

    force_in_f: Array
    """(3,) that the wall puts on the robot, its mean [N]."""
    peak_n: float
    """The largest, whatever its direction."""
    pushes: tuple[bool, ...]
    """Whether they pressed against each other, millisecond by millisecond."""


class ContactForceSensor:
    """Adds up the forces of all contacts of the geom `tool`."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Watch a model with an obstacle."""
        self._model, self._data = model, data
        self._tool = model.geom("tool").id
        self._six = np.zeros(6)
        self._forces: list[Array] = []

    def start(self) -> None:
        """A step of the plant begins."""
        self._forces.clear()

    def sample(self) -> None:
        """After each step of MuJoCo: what acted in it."""
        total = np.zeros(3)
        for k in range(self._data.ncon):  # the list's own iterator takes 0.5 ms to find its end
            contact = self._data.contact[k]
            if self._tool not in (contact.geom1, contact.geom2):
                continue
            mujoco.mj_contactForce(self._model, self._data, k, self._six)
            force_in_f = contact.frame.reshape(3, 3).T @ self._six[:3]
            total += force_in_f if contact.geom2 == self._tool else -force_in_f
        self._forces.append(total)

    def touched(self) -> ContactForce:
        """Contact force since `start`; none before the first step."""
        if not self._forces:
            return ContactForce(np.zeros(3), 0.0, ())
        forces = np.array(self._forces)
        sizes = np.linalg.norm(forces, axis=1)
        return ContactForce(
            forces.mean(axis=0), float(sizes.max()), tuple(bool(n > 0) for n in sizes)
        )
