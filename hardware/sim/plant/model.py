"""A robot's parameters as a MuJoCo model: a free body, its thrusters, and what carries it."""

from __future__ import annotations

import numpy as np

from hardware.plant_parameters import PlantParameters, StandParameters, SuspensionParameters
from hardware.sim.plant.obstacle import Obstacle
from pipeline.frames import GRAVITY, UP, Array, R_between, wxyz_from_R

STEP_MS = 1
FOOT_RADIUS_M = 0.005


def mjcf(parameters: PlantParameters, obstacle: Obstacle | None = None, scenery: str = "") -> str:
    """The robot as a MuJoCo model, with something before it to touch if requested.

    `scenery` stands in the world, in MuJoCo's words.
    """
    suspension, stand = parameters.suspension, parameters.stand
    directions = parameters.thruster_directions_in_b
    contact = "disable" if stand is None and obstacle is None else "enable"
    wall, tool = (obstacle.wall_mjcf(), obstacle.tool_mjcf()) if obstacle else ("", "")
    sites = "".join(
        f'<site name="thruster{i}" pos="{text_of(position)}" '
        f'quat="{text_of(wxyz_from_R(R_between(UP, direction / np.linalg.norm(direction))))}"/>'
        for i, (position, direction) in enumerate(
            zip(parameters.thruster_positions_in_b, directions, strict=True)
        )
    )
    actuators = "".join(
        f'<general site="thruster{i}" gear="0 0 1 0 0 {torque:.9g}" dyntype="filterexact" '
        f'dynprm="{parameters.lag:.9g}" ctrllimited="true" ctrlrange="0 {parameters.f_max:.9g}"/>'
        for i, torque in enumerate(parameters.thruster_torques)
    )
    return f"""<mujoco model="robot">
      <compiler inertiafromgeom="false"/>
      <option timestep="{1e-3 * STEP_MS}" gravity="0 0 {-GRAVITY}" integrator="implicitfast"
              cone="elliptic">
        <flag contact="{contact}" midphase="disable"/>
      </option>
      <worldbody>
        {_anchor(suspension)}{_floor(stand)}{wall}{scenery}
        <body name="b">
          <freejoint/>
          <inertial pos="0 0 0" mass="{parameters.mass:.9g}"
                    diaginertia="{text_of(parameters.inertia)}"/>
          <site name="com"/>
          {_hook(suspension)}{sites}{_contacts(parameters)}{tool}
        </body>
      </worldbody>
      {_cable(suspension, parameters.mass)}
      <actuator>{actuators}</actuator>
      <sensor><gyro site="com"/><accelerometer site="com"/></sensor>
    </mujoco>"""


def _anchor(suspension: SuspensionParameters | None) -> str:
    if suspension is None:
        return ""
    height = suspension.hook_above_com + suspension.length
    return f'<site name="anchor" pos="0 0 {height:.9g}"/>'


def _hook(suspension: SuspensionParameters | None) -> str:
    if suspension is None:
        return ""
    return f'<site name="hook" pos="0 0 {suspension.hook_above_com:.9g}"/>'


def _cable(suspension: SuspensionParameters | None, mass: float) -> str:
    if suspension is None:
        return ""
    return f"""<tendon>
        <spatial name="cable" stiffness="{suspension.stiffness:.9g}"
                 springlength="0 {suspension.rest_length(mass):.12g}">
          <site site="anchor"/><site site="hook"/>
        </spatial>
      </tendon>"""


def _floor(stand: StandParameters | None) -> str:
    """A plane under the feet; of two things that touch, MuJoCo takes the larger friction.

    It is moved after the model is made (`Plant`), which the tree of a midphase would not notice.
    """
    if stand is None:
        return ""
    height = float(stand.feet_in_b[:, 2].min())
    return f'<geom name="floor" type="plane" size="0 0 1" pos="0 0 {height:.9g}" friction="0 0 0"/>'


def _contacts(parameters: PlantParameters) -> str:
    """Feet, and the thrusters should it tip over."""
    stand = parameters.stand
    if stand is None:
        return ""
    feet = stand.feet_in_b + FOOT_RADIUS_M * UP
    return "".join(
        f'<geom type="sphere" size="{FOOT_RADIUS_M}" pos="{text_of(place)}" '
        f'friction="{stand.friction:.9g} 0 0"/>'
        for place in (*feet, *parameters.thruster_positions_in_b)
    )


def text_of(values: Array | tuple[float, ...]) -> str:
    """MuJoCo's words for numbers."""
    return " ".join(f"{value:.12g}" for value in values)
