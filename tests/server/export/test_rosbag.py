"""rosbag2, as `rosbags` and `mcap` read it, with FFmpeg for the film."""

import json

import av
import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from server.export.command import main
from tests.server.export.recordings import (
    TWIST_IN_B,
    ZERO_NS,
    film,
    on_a_known_day,
    told_a_twist,
    with_a_battery,
)


def bag(source, folder, *arguments):
    """(topic → [(time [ns], message)], custom data)"""
    assert main([str(source), "--to", "rosbag2", "--out", str(folder), *arguments]) == 0
    found = {}
    with AnyReader([folder / f"{source.stem}.rosbag2"]) as reader:
        for connection, t, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((t, message))
    description = yaml.safe_load((folder / f"{source.stem}.rosbag2" / "metadata.yaml").read_text())
    return found, description["rosbag2_bagfile_information"]["custom_data"]


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    return bag(on_a_known_day(folder), folder, "--task", "follow")


def stamp_ns(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def test_the_film_is_decoded_from_the_bag(flight):
    videos = flight[0]["/phone/video"]
    context = av.CodecContext.create("h264", "r")
    for t, video in videos:
        (frame,) = context.decode(av.Packet(video.data.tobytes()))
        assert (frame.width, frame.height, frame.is_corrupt) == (1280, 720, False)
        assert t == stamp_ns(video.timestamp)
    times = np.array([t - ZERO_NS for t, _ in videos]) * 1e-9
    assert len(times) == 107
    assert np.diff(times) == pytest.approx(0.05, abs=2e-3)


def test_every_header_has_the_time_of_its_message(flight):
    topics = ("/phone/imu", "/robot/imu", "/robot/pose", "/robot/thrusters", "/phone/touch")
    for topic in topics:
        for t, message in flight[0][topic]:
            assert t == stamp_ns(message.header.stamp)
            assert abs(t - ZERO_NS) < 6e9
    assert [len(flight[0][topic]) for topic in topics[:2]] == [328, 1098]


def test_poses_and_transforms_say_the_same_and_the_covariance_is_there(flight):
    moved = {
        (t, one.header.frame_id, one.child_frame_id): one.transform
        for t, message in flight[0]["/tf"]
        for one in message.transforms
    }
    poses = flight[0]["/robot/pose"]
    assert len(poses) > 200
    for t, posed in poses:
        assert posed.header.frame_id == "phone"
        place = moved[t, "phone", "base_link"]
        position = posed.pose.pose.position
        assert (position.x, position.y, position.z) == (
            place.translation.x, place.translation.y, place.translation.z,
        )  # fmt: skip
        sigmas = np.sqrt(np.diag(posed.pose.covariance.reshape(6, 6)))
        assert np.all(sigmas > 0.0)
    assert sigmas[0] < 0.02
    ((_, fixed),) = flight[0]["/tf_static"]
    assert [one.child_frame_id for one in fixed.transforms] == [
        "optical", "led_0", "led_1", "led_2", "led_3", "led_4",
    ]  # fmt: skip
    optical = fixed.transforms[0].transform.rotation
    assert (optical.x, optical.y, optical.z, optical.w) == pytest.approx((-0.5, 0.5, -0.5, 0.5))


def test_camera_modes_log_thrusts_and_episode_are_there(flight):
    ((_, info),) = flight[0]["/phone/camera_info"]
    assert (info.width, info.height, info.distortion_model) == (1280, 720, "plumb_bob")
    assert len(info.d) == 5
    assert [message.data for _, message in flight[0]["/robot/mode"]] == [
        "DISARMED",
        "ARMED",
        "TRACK",
    ]
    assert "wishes: arm" in [line.msg for _, line in flight[0]["/rosout"]]
    assert np.abs(flight[0]["/robot/thrusters"][-1][1].effort).max() > 0.1
    ((t, told),) = flight[0]["/episodes"]
    episode = json.loads(told.data)
    assert (episode["task"], episode["keep"]) == ("follow", True)
    assert episode["begin_s"] == pytest.approx(1e-9 * t)
    assert 1.0 < episode["end_s"] - episode["begin_s"] < 5.0
    assert "ames" in flight[1]["robot_file"]


def test_a_twist_told_is_a_twist_in_the_bodys_axes(tmp_path):
    topics, _ = bag(told_a_twist(tmp_path), tmp_path)
    assert "/robot/thrusters" not in topics
    assert len(topics["/robot/twist"]) == 275
    for t, told in topics["/robot/twist"]:
        assert (t, told.header.frame_id) == (stamp_ns(told.header.stamp), "base_link")
        v, omega = told.twist.linear, told.twist.angular
        assert (v.x, v.y, v.z, omega.x, omega.y, omega.z) == TWIST_IN_B


def test_the_battery_is_there_while_it_is_told(flight, tmp_path):
    assert "/robot/battery" not in flight[0]
    told = bag(with_a_battery(tmp_path), tmp_path)[0]["/robot/battery"]
    assert len(told) == 138
    assert {one.voltage for _, one in told} == {10.25}
    assert all(np.isnan(one.percentage) for _, one in told)


def test_what_is_no_h264_becomes_a_compressed_image_and_plain_mcap_reads_the_bag(tmp_path):
    source = film(tmp_path, "vp8")
    found, _ = bag(source, tmp_path)
    assert {image.format for _, image in found["/phone/image/compressed"]} == {"jpeg"}
    (inside,) = (tmp_path / "vp8.rosbag2").glob("*.mcap")
    with inside.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        schemas = {c.topic: s.name for s, c, _ in reader.iter_messages()}
    assert schemas["/phone/image/compressed"] == "sensor_msgs/msg/CompressedImage"


def test_nothing_is_written_over(tmp_path, capsys):
    source = film(tmp_path, "jpeg")
    bag(source, tmp_path)
    assert main([str(source), "--to", "rosbag2", "--out", str(tmp_path)]) == 1
    assert "is there already" in capsys.readouterr().err
