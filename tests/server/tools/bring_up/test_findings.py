"""What a bring-up tells is judged by its record alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.plant_parameters import SuspensionParameters
from hardware.robot_file import ROBOTS, load_robot
from hardware.robot_text import with_thrusters_reordered
from hardware.sim.plant.built import AsBuilt
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from hardware.system_identification.fit import IdentificationError
from pipeline.frames import GRAVITY
from server.control.robot_clock import RobotLink
from server.experiments import main
from server.tools.bring_up import session
from server.tools.bring_up.command import written
from server.tools.bring_up.findings import brought_up
from server.tools.bring_up.pulses import PulseProgramme


def brought(robot_file, said, hangs_from=None):
    """Statuses of a robot that is built otherwise than its file says."""
    built = AsBuilt.model_validate(said)
    plant = built.plant(robot_file.plant)
    if hangs_from is not None:
        plant = replace(plant, stand=None, suspension=hangs_from)
    real = replace(robot_file, plant=plant)
    follower = VirtualTimeFollower(real, 3, options=built.options())
    follower.plant.thruster_health[:] = built.thrust_gains(robot_file.robot.A.shape[1])

    def wait():
        follower.advance()
        return follower.t

    states, programme = [], PulseProgramme(robot_file)

    def keep(status, _):
        states.append(status)

    link = RobotLink(follower)
    session.run(programme, follower, link, wait, keep, lambda: "", lambda _: None)
    assert programme.is_done, programme.stopped
    return states


@pytest.mark.slow
@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, []),
        ({"order": [2, 1, 3, 4]}, ["Thrusters 1 and 2 are exchanged"]),
        ({"backward": [{"thruster": 3}]}, ["Thruster 3 pushes the other way"]),
        ({"imu_axes": ["y", "-x", "z"]}, ['along their axes "y", "-x", "z" lie']),
    ],
)
def test_a_robot_that_flies_is_told_its_thrusters_while_it_hangs(said, words):
    quadrotor = load_robot("quadrotor")
    mass = quadrotor.plant.mass
    rope = SuspensionParameters(1.0, mass * GRAVITY / 0.25, 2.0, 0.03)
    found = brought_up(quadrotor.plant, brought(quadrotor, said, rope))
    assert len(found.against) == len(words)
    assert all(word in found.against[k] for k, word in enumerate(words))
    assert found.identified is None
    assert not found.is_sound


@pytest.mark.slow
def test_margins_are_those_of_the_intervals_in_the_file_that_a_bring_up_writes(tmp_path, capsys):
    ames = load_robot("ames")
    found = brought_up(ames.plant, brought(ames, {}))
    text = written((ROBOTS / "ames.toml").read_text(), found, "ames-1.mcap")
    assert "}  # robot bring-up, ames-1.mcap" in text
    mine, bare = tmp_path / "mine.toml", tmp_path / "bare.toml"
    mine.write_text(text)
    bare.write_text(text.partition("\n[identified.")[0] + "\n")
    told = load_robot(mine).plant.intervals
    assert told.outdated == ()
    assert None not in (told.mass, *told.inertia, told.length, told.stiffness, told.lag, told.delay)
    worst = {}
    for robot in (mine, bare):
        assert main(["margins", str(robot), "--gains", "phone", "--estimator", "relative"]) == 0
        said = capsys.readouterr().out
        assert ("(identified ± " in said) == (robot == mine)
        assert ("mass ± 30 %, lag × 0.7-1.5, moments as mass, assumed" in said) != (robot == mine)
        rows = [line.split() for line in said.splitlines() if line.startswith("phone")]
        worst[robot] = [(float(row[-6]), float(row[-5])) for row in rows]
    assert len(worst[mine]) == 6
    for narrow, assumed in zip(worst[mine], worst[bare], strict=True):
        assert narrow[0] > assumed[0]
        assert narrow[1] > assumed[1]


@pytest.mark.slow
def test_a_record_that_ended_early_or_has_a_gap_is_refused():
    ames = load_robot("ames")
    states = brought(ames, {})
    with pytest.raises(IdentificationError, match="before thruster"):
        brought_up(ames.plant, states[:1500])
    with pytest.raises(IdentificationError, match="a gap of"):
        brought_up(ames.plant, states[:1500] + states[1530:])
    with pytest.raises(IdentificationError, match="no bring-up of a robot with 8"):
        brought_up(ames.plant, states[:100])


def test_thrusters_in_another_order_leave_all_else_of_a_file_as_it_is():
    text = (ROBOTS / "ames.toml").read_text()
    moved = with_thrusters_reordered(text, (0, 1, 3, 2, 4, 5, 6, 7), "why")
    old, new = text.splitlines(), moved.splitlines()
    changed = [k for k, line in enumerate(old) if line != new[k]]
    assert len(changed) == 2
    assert new[len(old) :] == ["# why"]
    again = with_thrusters_reordered(moved, (0, 1, 3, 2, 4, 5, 6, 7), "why")
    assert np.allclose(
        [float(x) for x in again.splitlines()[changed[0]].split("[")[1].split("]")[0].split(",")],
        [float(x) for x in old[changed[0]].split("[")[1].split("]")[0].split(",")],
    )
