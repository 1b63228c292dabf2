"""What leads in the paper's experiments: its clock is known, LEDs or pictures show the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from pipeline.config import TeleopConfig
from pipeline.signals import Mode, PhoneImu, VisionMeasurement
from server.control.ipc_inputs import Input, encode
from server.experiments.paper.setup import flight
from server.experiments.paper.setup.measure import ExperimentSetup, cell_of
from server.experiments.paper.setup.variants import VariantRequest, config_of, ours
from server.simulation.sensors import PAPER, Leader, Pictures, phone, prompt
from server.simulation.virtual_time import VirtualTimeSimulation

AMES = load_robot("ames")


def looked(leader: Leader, seconds: float = 0.7) -> tuple[list[PhoneImu], list[VisionMeasurement]]:
    """All that reaches control of a phone at rest; the robot hangs, as nobody presses."""
    nobody = prompt()
    nobody.leaving = True
    hand = make_hand("still", seed=1, start=AMES.start)
    loop = VirtualTimeSimulation(AMES, TeleopConfig(), leader.scene(1), nobody, hand)
    came: list[Input] = []

    def keep(messages: Sequence[Input]) -> list[Input]:
        came.extend(messages)
        return list(messages)

    loop.tamper = keep
    while loop.t < seconds:
        loop.advance()
    seen = [one for one in came if isinstance(one, VisionMeasurement)]
    return [one for one in came if isinstance(one, PhoneImu)], seen


def times(seen: Sequence[VisionMeasurement | PhoneImu]) -> list[float]:
    """As the wire has them: in microseconds, rounded."""
    return [round(one.t, 5) for one in seen]


@pytest.mark.parametrize("pictures", ["spots", "h264", "vp8", "jpeg"])
def test_the_robot_is_seen_where_it_is(pictures: Pictures) -> None:
    _, seen = looked(phone(pictures=pictures))
    poses = [one.pose for one in seen if one.pose is not None]
    assert len(poses) >= 8
    p_bf_in_f = np.mean([pose.p_bc_in_c for pose in poses], axis=0) - [AMES.start.distance, 0, 0]
    np.testing.assert_allclose(p_bf_in_f, 0.0, atol=0.003)


def test_sensors_and_times_are_the_same_whatever_looks() -> None:
    (felt, spots), (filmed_felt, film) = looked(phone()), looked(phone(pictures="jpeg"))
    assert times(film) == times(spots)[-len(film) :]
    assert len(film) >= 8
    assert list(map(encode, felt)) == list(map(encode, filmed_felt))


def test_pictures_that_arrive_at_once_are_all_decoded_and_the_newest_is_looked_at() -> None:
    crowded = phone(120.0, (0.02, 0.15), "h264")  # a late one holds up those behind it
    _, film = looked(crowded)
    _, spots = looked(replace(crowded, pictures="spots"))
    assert len(spots) < 0.9 * 120.0 * 0.6
    assert set(times(film)) <= set(times(spots))
    assert len(film) > 0.8 * len(spots)


def test_its_clock_is_known_before_it_could_be_asked() -> None:
    felt, seen = looked(PAPER, 0.1)
    assert felt[0].t < 0.01
    assert seen[0].t < 0.02
    np.testing.assert_allclose(np.diff([one.t for one in felt]), 1.0 / 400.0, atol=3e-6)


def test_somebody_prompt_leads_within_a_second() -> None:
    loop = VirtualTimeSimulation(
        AMES, config_of(AMES, ours(PAPER, VariantRequest()), PAPER), PAPER.scene(1), prompt()
    )
    while loop.t < 1.0:
        mode = loop.advance().failsafe.mode
    assert mode is Mode.TRACK
    assert not loop.trace.left


@pytest.mark.slow
@pytest.mark.parametrize(("fps", "latency_s"), [(30.0, (0.06, 0.12)), (60.0, (0.2, 0.2))])
def test_a_codec_costs_less_than_a_fifth_of_the_error(
    fps: float, latency_s: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flight, "HOVER_S", 4.0)
    spots, film = phone(fps, latency_s), phone(fps, latency_s, "h264")
    way = ours(film, VariantRequest())
    near, far = (
        cell_of("ours", "y", 1.0, ExperimentSetup(AMES, leader, (1,)).fly(way, "step_y", 1.5))
        for leader in (spots, film)
    )
    assert not far.ended
    assert far.true < 1.2 * near.true
