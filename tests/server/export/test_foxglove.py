"""Foxglove's MCAP, as `mcap`, protobuf and FFmpeg read it: none of our code reads here."""

import av
import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from server.export.command import main
from tests.server.export.recordings import (
    CHROMIUM,
    FLIGHT,
    TWIST_IN_B,
    ZERO_NS,
    film,
    on_a_known_day,
    spot_at,
    told_a_twist,
    with_a_battery,
)


class Export:
    """What a stranger finds in an exported file."""

    def __init__(self, source, folder, *arguments):
        assert main([str(source), "--to", "foxglove", "--out", str(folder), *arguments]) == 0
        (self.path,) = folder.glob("*.foxglove.mcap")
        self.topics, self.log_times, self.schemas = {}, {}, {}
        with self.path.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
            for schema, channel, message, decoded in reader.iter_decoded_messages():
                self.topics.setdefault(channel.topic, []).append(decoded)
                self.log_times.setdefault(channel.topic, []).append(message.log_time)
                self.schemas[channel.topic] = schema.name
            self.attachments = {one.name: one.data for one in reader.iter_attachments()}
            self.metadata = {one.name: one.metadata for one in reader.iter_metadata()}


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    return Export(on_a_known_day(folder), folder, "--task", "follow the hand")


def seconds(stamp):
    return (stamp.ToNanoseconds() - ZERO_NS) * 1e-9


def decoded_lumas(messages):
    """Pictures as FFmpeg decodes them, one for each message."""
    context = av.CodecContext.create("h264", "r")
    pictures = []
    for message in messages:
        (frame,) = context.decode(av.Packet(message.data))
        assert not frame.is_corrupt
        pictures.append(frame.to_ndarray(format="gray"))
    return pictures


def test_every_picture_is_decoded_by_ffmpeg(flight):
    videos = flight.topics["/phone/video"]
    assert flight.schemas["/phone/video"] == "foxglove.CompressedVideo"
    assert {(video.format, video.frame_id) for video in videos} == {("h264", "optical")}
    lumas = decoded_lumas(videos)
    assert len(lumas) == 107
    assert {luma.shape for luma in lumas} == {(720, 1280)}
    assert all(luma.max() > 200 for luma in lumas)  # LEDs


def test_pictures_stand_at_the_times_they_were_taken(flight):
    """The virtual phone films each 50 ms, and sends what it filmed 60 to 120 ms later."""
    times = np.array([seconds(video.timestamp) for video in flight.topics["/phone/video"]])
    assert np.diff(times) == pytest.approx(0.05, abs=2e-3)
    known = flight.topics["/phone/picture_time"]
    assert times.tolist() == [seconds(one.timestamp) for one in known]
    latencies = np.array([seconds(one.received) - seconds(one.timestamp) for one in known])
    assert 0.05 < latencies.min() < 0.07
    assert 0.11 < latencies.max() < 0.13
    sigmas = np.array([one.sigma_s for one in known])
    assert np.all(np.diff(sigmas[40:]) < 2e-4)
    assert 0.0 < sigmas[-1] < sigmas[0] <= 0.03


@pytest.mark.parametrize("topic", ["/phone/video", "/phone/imu", "/robot/imu", "/robot/pose"])
def test_message_times_are_the_calendars_and_those_in_the_messages(flight, topic):
    stamps = [message.timestamp.ToNanoseconds() for message in flight.topics[topic]]
    assert flight.log_times[topic] == sorted(stamps)
    assert stamps == sorted(stamps)
    assert all(abs(stamp - ZERO_NS) < 6e9 for stamp in stamps)


def test_the_robots_leds_are_where_its_poses_say(flight):
    """Pose, calibration and LEDs are of one mind with the film: OpenCV projects, FFmpeg decodes."""
    calibration = flight.topics["/phone/calibration"][0]
    K, D = np.array(calibration.K).reshape(3, 3), np.array(calibration.D)
    assert calibration.distortion_model == "plumb_bob"
    (scene,) = flight.topics["/robot/leds"]
    assert scene.entities[0].frame_id == "base_link"
    leds = np.array([vector(sphere.pose.position) for sphere in scene.entities[0].spheres])
    assert leds.shape == (5, 3)
    moments = [one.transforms for one in flight.topics["/tf"]]
    times = np.array([seconds(transforms[0].timestamp) for transforms in moments if transforms])
    videos = flight.topics["/phone/video"]
    lumas = decoded_lumas(videos)
    errors = []
    for k in range(80, len(videos), 5):
        transforms = moments[int(np.abs(times - seconds(videos[k].timestamp)).argmin())]
        poses = {one.child_frame_id: (one.parent_frame_id, matrix(one)) for one in transforms}
        assert (poses["base_link"][0], poses["optical"][0]) == ("phone", "phone")
        T_ob = np.linalg.inv(poses["optical"][1]) @ poses["base_link"][1]
        pixels, _ = cv2.projectPoints(leds, cv2.Rodrigues(T_ob[:3, :3])[0], T_ob[:3, 3], K, D)
        seen = np.argwhere(lumas[k] > 150)[:, ::-1]
        errors += [np.linalg.norm(seen - pixel, axis=1).min() for pixel in pixels[:, 0]]
    assert np.median(errors) < 3.0


def test_a_command_has_thrusts_or_a_twist(flight, tmp_path):
    thrusts = flight.topics["/robot/command"][-1]
    assert len(thrusts.thrusts_n) == 8
    assert not thrusts.HasField("velocity_in_body_m_s")
    twist = Export(told_a_twist(tmp_path), tmp_path).topics["/robot/command"][-1]
    assert len(twist.thrusts_n) == 0
    told = (*vector(twist.velocity_in_body_m_s), *vector(twist.angular_velocity_in_body_rad_s))
    assert told == TWIST_IN_B


def test_a_robot_that_tells_of_itself_has_a_topic_for_it(flight, tmp_path):
    assert "/robot/health" not in flight.topics
    told = Export(with_a_battery(tmp_path), tmp_path).topics["/robot/health"]
    assert len(told) == 138
    assert {(one.battery, one.battery_v, one.e_stop, *one.words) for one in told} == {
        ("low", 10.25, "released", "The robot's battery is low.")
    }


def vector(v):
    return np.array([v.x, v.y, v.z])


def matrix(transform):
    q = transform.rotation
    w, v = q.w, vector(q)
    T = np.eye(4)
    cross = np.cross(np.eye(3), v)
    T[:3, :3] = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    T[:3, 3] = vector(transform.translation)
    return T


def test_the_odometry_has_the_covariance_that_a_pose_has_no_room_for(flight):
    poses, odometry = flight.topics["/robot/pose"], flight.topics["/robot/odometry"]
    assert [str(one.pose) for one in poses] == [str(one.pose) for one in odometry]
    assert {(one.frame_id, one.body_frame_id) for one in odometry} == {("phone", "base_link")}
    C = np.array(odometry[-1].pose_covariance).reshape(6, 6)
    state = flight.topics["/robot/state"][-1]
    assert np.sqrt(np.diag(C)) == pytest.approx(
        3 * [state.sigma_position_m] + 3 * [state.sigma_attitude_rad]
    )
    assert 1e-5 < state.sigma_position_m < 0.02


def test_motion_has_its_gravity_in_the_axes_of_its_frame(flight):
    """Phone and robot are nearly level: up is z in both."""
    for topic, frame in (("/phone/imu", "phone"), ("/robot/imu", "base_link")):
        samples = flight.topics[topic]
        assert {sample.frame_id for sample in samples} == {frame}
        force = np.mean([vector(sample.specific_force_m_s2) for sample in samples], axis=0)
        assert force == pytest.approx([0.0, 0.0, 9.8], abs=1.0)
    assert len(flight.topics["/robot/imu"]) == 1098


def test_the_log_tells_of_modes_and_wishes(flight):
    lines = [(one.name, one.message) for one in flight.topics["/log"]]
    assert ("phone", "wishes: arm") in lines
    modes = [text.split(":")[0] for source, text in lines if source == "control"]
    assert modes == ["DISARMED", "ARMED", "TRACK"]


def test_the_episode_is_the_press_with_its_task(flight):
    (episode,) = flight.topics["/episodes"]
    told = {pair.key: pair.value for pair in episode.metadata}
    assert told == {"episode": "0", "task": "follow the hand", "keep": "true"}
    touches = flight.topics["/phone/touch"]
    held = [seconds(touch.timestamp) for touch in touches if touch.held]
    assert seconds(episode.start_time) == pytest.approx(held[0])
    assert seconds(episode.end_time) == pytest.approx(held[-1])


def test_robot_and_camera_are_attached(flight):
    assert {"robot.toml", "camera.yaml"} <= set(flight.attachments)
    assert b"ames" in flight.attachments["robot.toml"]
    assert "robot_file" not in flight.metadata["lightleash"]


@pytest.mark.slow
def test_a_real_browsers_film_begins_at_its_first_key_picture(tmp_path):
    """Its first picture leans on one that came before the record began."""
    export = Export(CHROMIUM, tmp_path)
    assert len(export.topics["/phone/picture_time"]) == 210
    assert len(decoded_lumas(export.topics["/phone/video"])) == 209
    said = [one.message for one in export.topics["/log"] if one.name == "server"]
    assert said.count("page: pictures go by WebRTC") == 1


def test_a_recording_that_knows_no_day_says_so(tmp_path, capsys):
    export = Export(FLIGHT, tmp_path)
    assert "1970" in capsys.readouterr().out
    assert all(t < 6e9 for t in export.log_times["/robot/pose"])


@pytest.mark.parametrize("codec", ["jpeg", "vp8"])
def test_what_is_no_h264_becomes_jpeg(tmp_path, codec):
    export = Export(film(tmp_path, codec), tmp_path)
    assert "/phone/video" not in export.topics
    images = export.topics["/phone/image"]
    assert {image.format for image in images} == {"jpeg"}
    lumas = [cv2.imdecode(np.frombuffer(one.data, np.uint8), 0) for one in images]
    places = [spot_at(luma) for luma in lumas]
    assert places == pytest.approx([40.0 + 10.0 * k for k in range(6)], abs=1.5)
    assert "/phone/calibration" not in export.topics  # nobody knows that phone
