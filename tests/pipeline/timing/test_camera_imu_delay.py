"""Coarse time offset beside vision: of a robot's LEDs, and of light on a glass."""

from __future__ import annotations

from hardware.sim.world.sensors import events
from hardware.sim.world.world import World, WorldOptions
from pipeline.imu_stream import ImuStreams
from pipeline.signals import BodyImu, PhoneImu, StampOffset
from pipeline.timing.camera_imu_delay import CameraImuDelay


def test_light_on_a_glass_dates_no_picture_whatever_it_showed_before():
    imus = ImuStreams()
    stamps, of_glass = CameraImuDelay(imus), CameraImuDelay(imus)
    of_glass.films_glass(None)
    for _, sample in events(World(WorldOptions(seed=3, duration=5.0, time_offset=0.03))):
        if isinstance(sample, PhoneImu | BodyImu):
            imus.add(sample)
        elif sample.pose is not None:
            stamps.add_pose(sample.pose)
            of_glass.add_pose(sample.pose)
    assert abs(stamps.offset.value - 0.03) < 0.01
    assert of_glass.offset is None
    stamps.films_glass(None)
    assert stamps.offset is None
    by_fiducials = StampOffset(0.002, 1e-3, 4.0)
    stamps.films_glass(by_fiducials)
    assert stamps.offset == by_fiducials
