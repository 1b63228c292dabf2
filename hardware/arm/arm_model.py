"""An arm by its MuJoCo model: which joints it has from its base to its tip, and what they move.

Base axes k: the model's own, z up. Body axes b: those of the tip's site.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt

from hardware.plant_parameters import ArmParameters
from pipeline.frames import Array

KINDS: Final = {
    mujoco.mjtObj.mjOBJ_SITE: "site",
    mujoco.mjtObj.mjOBJ_GEOM: "geom",
    mujoco.mjtObj.mjOBJ_JOINT: "joint",
}
"""What robot files name of a model."""


class ArmError(ValueError):
    """An arm that can't be used; says which key of `[arm]`, and what would be allowed."""

    def __init__(self, key: str, allowed: str) -> None:
        super().__init__(": ".join((f"arm.{key}" if key else "arm", allowed)))
        self.key, self.allowed = key, allowed


def jacobian_rates(jacobian: Array) -> Array:
    """How a tip's Jacobian in b (6, n) changes with each joint's angle: (n, 6, n), base first.

    A joint moves what is behind it alone: seen from the tip, only the joints before it change, its
    own among the columns of a twist's Lie bracket.
    """
    n = jacobian.shape[1]
    v, omega, rates = jacobian[:3].T, jacobian[3:].T, np.zeros((n, 6, n))
    i, j = _before(n)
    rates[j, :3, i] = _crosses(omega[i], v[j]) + _crosses(v[i], omega[j])
    rates[j, 3:, i] = _crosses(omega[i], omega[j])
    return rates


@cache
def _before(n: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Each pair of n joints, the one nearer to the base first."""
    i, j = np.triu_indices(n, 1)
    return i, j


def _crosses(a: Array, b: Array) -> Array:
    """a × b row by row (m, 3), two hundred times a second: np.cross costs twice as much."""
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    return np.stack((a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0), axis=1)


class ArmModel:
    """Joints in a row from base to tip; all others of the model stay where they are."""

    def __init__(self, parameters: ArmParameters) -> None:
        """At home.

        Raises:
            ArmError: the model is none, or lacks what the robot file names.
        """
        self.parameters = parameters
        try:
            self.model = mujoco.MjModel.from_xml_path(str(parameters.model))
        except ValueError as error:
            raise ArmError("model", str(error)) from error
        self._data = mujoco.MjData(self.model)
        self._tip = self._id(mujoco.mjtObj.mjOBJ_SITE, "tip", parameters.tip)
        joints = self._joints_before_tip()
        self.dofs: npt.NDArray[np.intp] = self.model.jnt_dofadr[joints].astype(np.intp)
        """(n,) of the joints, base first."""
        self._places = self.model.jnt_qposadr[joints]
        self.names = tuple(self.model.joint(joint).name for joint in joints)
        """Of them."""
        self.low: Array = self.model.jnt_range[joints, 0]
        """Least angles (n,) [rad] ..."""
        self.high: Array = self.model.jnt_range[joints, 1]
        """... and largest ones."""
        self.pairs = tuple(
            (self._geom(one), self._geom(other)) for one, other in parameters.keeps_apart
        )
        """Geoms that are kept apart."""
        joint = parameters.tool_joint
        self.tool = self._id(mujoco.mjtObj.mjOBJ_JOINT, "tool_joint", joint) if joint else None
        """Number of the joint that opens its tool."""
        if self.tool is not None and (self.tool in joints or not self.model.jnt_limited[self.tool]):
            raise ArmError("tool_joint", "a joint behind the tip's, with a range")
        home = parameters.home
        if home.shape != (len(joints),):
            raise ArmError("home_deg", f"{len(joints)} angles: of {', '.join(self.names)}")
        if bool((home < self.low).any() or (home > self.high).any()):
            raise ArmError("home_deg", f"within {self.ranges}")

    def configuration(self, q: Array) -> Array:
        """Of all of the model's joints, of which these have the angles `q` (n,) [rad]."""
        whole: Array = self.model.qpos0.copy()
        whole[self._places] = q
        return whole

    def angles(self, configuration: Array) -> Array:
        """(n,) [rad]: back from `configuration`."""
        angles: Array = configuration[self._places]
        return angles

    def tip(self, q: Array) -> tuple[Array, Array]:
        """(R_kb (3, 3), p_bk_in_k (3,) [m]) with joints at `q` (n,) [rad]."""
        self._place(q)
        data = self._data
        return data.site_xmat[self._tip].reshape(3, 3).copy(), data.site_xpos[self._tip].copy()

    def jacobian(self, q: Array) -> Array:
        """Twist of the tip in b per rate of each joint (6, n) [m, 1] at `q` (n,) [rad]."""
        self._place(q)
        rows = np.zeros((2, 3, self.model.nv))
        mujoco.mj_jacSite(self.model, self._data, rows[0], rows[1], self._tip)
        R_kb = self._data.site_xmat[self._tip].reshape(3, 3)
        in_b: Array = np.vstack((R_kb.T @ rows[0], R_kb.T @ rows[1]))[:, self.dofs]
        return in_b

    @property
    def ranges(self) -> str:
        """Of its joints, in words [°]."""
        rows = zip(self.names, np.degrees(self.low), np.degrees(self.high), strict=True)
        return ", ".join(f"{name} {low:.0f} to {high:.0f}" for name, low, high in rows)

    def _place(self, q: Array) -> None:
        self._data.qpos[:] = self.configuration(q)
        mujoco.mj_kinematics(self.model, self._data)
        mujoco.mj_comPos(self.model, self._data)

    def _joints_before_tip(self) -> list[int]:
        model, joints = self.model, list[int]()
        body = int(model.site_bodyid[self._tip])
        while body > 0:
            first, many = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            joints[:0] = range(first, first + many)
            body = int(model.body_parentid[body])
        kinds = set(model.jnt_type[joints].tolist())
        if not joints or kinds != {int(mujoco.mjtJoint.mjJNT_HINGE)}:
            raise ArmError("tip", "a site that hinges move, and nothing else")
        if not model.jnt_limited[joints].all():
            raise ArmError("model", "a range for each joint before the tip")
        return joints

    def _geom(self, name: str) -> int:
        return self._id(mujoco.mjtObj.mjOBJ_GEOM, "keeps_apart", name)

    def _id(self, kind: mujoco.mjtObj, key: str, name: str) -> int:
        found = int(mujoco.mj_name2id(self.model, kind, name))
        if found < 0:
            file = self.parameters.model.name
            raise ArmError(key, f"{KINDS[kind]}s of {file}, which has none that is called {name!r}")
        return found
