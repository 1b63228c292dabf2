"""One flight against an obstacle, in virtual time: hover, go, press, come back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hardware.robot_file import RobotFile
from hardware.sim.plant.plant import PlantOptions
from pipeline.config import PERIOD_S
from pipeline.frames import Array
from server.experiments.contact.setting import FLIGHT_S, HOVER_S, ContactScene, Way
from server.simulation.sensors import Leader, prompt
from server.simulation.virtual_time import VirtualTimeSimulation


@dataclass(frozen=True, slots=True, eq=False)
class ContactTrace:
    """Rows since the hand's move, one a control period; the truth."""

    t: Array
    """(n,) since the hand's move [s]."""
    force_n: Array
    """(n,) that the tool presses along x_f with, mean over the period."""
    peak_n: Array
    """(n,) largest contact force of any direction within it."""
    pushes: npt.NDArray[np.bool_]
    """(5 n,), millisecond by millisecond: whether anything touches."""
    depth_m: Array
    """(n,) of the tip behind the wall's face."""
    side_m: Array
    """(n,) of the centre of mass from where it was at the start, along y and z."""
    ended: str
    """Why tracking ended early, or ""."""


def fly(
    robot_file: RobotFile,
    leader: Leader,
    scene: ContactScene,
    way: Way,
    seed: int,
    seconds: float = FLIGHT_S,
) -> ContactTrace:
    """Fly until `seconds` after the hand's move, or until tracking ends."""
    obstacle = scene.obstacle(seed)
    loop = VirtualTimeSimulation(
        robot_file,
        way.config(robot_file, leader),
        leader.scene(seed),
        prompt(),
        scene.hand(seed, robot_file),
        PlantOptions(obstacle=obstacle),
    )
    plant = loop.follower.plant
    rows: list[tuple[float, ...]] = []
    pushes: list[bool] = []
    while loop.t < HOVER_S + seconds and not loop.trace.left:
        loop.advance()
        if loop.t <= HOVER_S:
            continue
        p, touched = plant.p_bf_in_f, plant.touched
        depth, side = obstacle.depth_of_tip(p, plant.R_fb), float(np.hypot(p[1], p[2]))
        rows.append((loop.t - HOVER_S, -touched.force_in_f[0], touched.peak_n, depth, side))
        pushes += touched.pushes
    columns = np.array(rows).reshape(-1, 5).T
    why = loop.trace.left or ("" if loop.trace.t else "tracking never began")
    ended = f"{loop.t - HOVER_S:+.2f} s: {why}" if why else ""
    t_s, force_n, peak_n, depth_m, side_m = columns
    touches = np.array(pushes, dtype=np.bool_)
    return ContactTrace(t_s, force_n, peak_n, touches, depth_m, side_m, ended)


PER_PERIOD = round(1e3 * PERIOD_S)
"""Of `ContactTrace.pushes`, for each row of the others."""
