"""A phone's eyes in the paper's experiments: spots with noise, or pictures through a codec."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from pipeline.frames import Array
from pipeline.signals import PhoneImu, VisionMeasurement
from pipeline.vision_config import GatesConfig
from server.experiments.paper.setup import flight
from server.experiments.paper.setup.measure import ExperimentSetup, cell_of
from server.experiments.paper.setup.variants import VariantRequest, ours
from server.simulation.leader_sensor_model import LeaderSensorModel
from server.simulation.sensors import Leader, Pictures, phone

AMES = load_robot("ames")
AT = np.array([0.02, -0.01, 0.03])


def robot(t: float) -> tuple[Array, Array]:
    """It hangs still."""
    return np.eye(3), AT


def looked(leader: Leader, seconds: float = 0.7) -> tuple[list[PhoneImu], list[VisionMeasurement]]:
    """All that reaches control of a phone at rest, in periods of 5 ms."""
    hand = make_hand("still", seed=1, start=AMES.start)
    rig = LeaderSensorModel(leader, hand, AMES.robot, GatesConfig(), seed=1)
    motions: list[PhoneImu] = []
    pictures: list[VisionMeasurement] = []
    for k in range(round(seconds / 0.005)):
        felt, seen = rig.arrivals(0.005 * k, 0.005 * (k + 1), robot)
        motions += felt
        pictures += seen
    return motions, pictures


@pytest.mark.parametrize("pictures", ["spots", "h264", "vp8", "jpeg"])
def test_the_robot_is_seen_where_it_is(pictures: Pictures) -> None:
    _, seen = looked(phone(pictures=pictures))
    poses = [one.pose for one in seen if one.pose is not None]
    assert len(poses) >= 8
    p_bf_in_f = np.mean([pose.p_bc_in_c for pose in poses], axis=0) - [AMES.start.distance, 0, 0]
    np.testing.assert_allclose(p_bf_in_f, AT, atol=0.003)


def test_sensors_and_times_are_the_same_whatever_looks() -> None:
    (felt, spots), (filmed_felt, film) = looked(phone()), looked(phone(pictures="jpeg"))
    assert [one.t for one in film] == [one.t for one in spots][-len(film) :]
    for one, other in zip(felt, filmed_felt, strict=True):
        np.testing.assert_array_equal(one.a_m_cf_in_c, other.a_m_cf_in_c)


def test_pictures_that_arrive_at_once_are_all_decoded_and_the_newest_is_looked_at() -> None:
    crowded = phone(120.0, (0.02, 0.15), "h264")  # a late one holds up those behind it
    _, film = looked(crowded)
    _, spots = looked(replace(crowded, pictures="spots"))
    assert len(spots) < 0.9 * 120.0 * 0.6
    assert {one.t for one in film} <= {one.t for one in spots}
    assert len(film) > 0.8 * len(spots)


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
