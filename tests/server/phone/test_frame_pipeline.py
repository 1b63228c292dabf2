from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

import hardware
from hardware.codec import Encoder
from hardware.robot_file import load_robot
from pipeline.camera.extrinsics import Extrinsics
from pipeline.frames import GRAVITY, exp
from pipeline.prediction import Prediction
from pipeline.signals import BodyImu, PhoneImu, StampOffset
from pipeline.vision_config import GatesConfig
from server.phone.frame_pipeline import FramePipeline
from server.phone.ingest import ARRIVAL_S, EncodedFrame
from server.protocol.wire_records import Codec, Picture
from tests.pipeline.seeing import CAMERA, is_wrong, moved, picture, truth_at

ROBOT = load_robot(Path(hardware.__file__).parent / "robots" / "ames.toml").robot
ZERO, UP = np.zeros(3), np.array([0.0, 0.0, 1.0])
DT = 1.0 / 30.0
GLASS_SAYS = StampOffset(0.004, 0.001)
CODECS = {"h264": Codec.H264, "vp8": Codec.VP8, "jpeg": Codec.JPEG}


def frame_pipeline(**gates):
    return FramePipeline(CAMERA, ROBOT, GatesConfig(**gates))


def encoder(codec="h264"):
    return Encoder(CAMERA.width, CAMERA.height, 30.0, 3_000_000, codec)


def sent(k, data, key, codec="h264", t=None):
    shot = Picture(CODECS[codec], key, CAMERA.width, CAMERA.height, 0, data)
    t = k * DT if t is None else t
    return EncodedFrame(t, t + 0.05, k, shot)


def shots(rng, n, codec="h264", with_=None, truth=None):
    """Encoded pictures of a robot, and what was true."""
    truth, camera_side = truth or truth_at(rng), with_ or encoder(codec)
    for k in range(n):
        yield sent(k, *camera_side.encode(picture(truth, rng)), codec), truth  # type: ignore[call-arg]
        truth = moved(truth, rng)


def hold(eye, t, up_in_c, up_in_b):
    """What motion sensors of the phone and of the robot feel when held still."""
    eye.front_end.add_imu(PhoneImu(t, ZERO, GRAVITY * up_in_c), BodyImu(t, ZERO, GRAVITY * up_in_b))


def look(eye, frames, truth):
    hold(eye, frames[-1].t, truth.prior().up_in_c, truth.prior().up_in_b)
    return eye.see(frames)


@pytest.mark.parametrize("codec", CODECS)
def test_encoded_pictures_become_poses(codec):
    rng = np.random.default_rng(80)
    eye = frame_pipeline()
    assert eye.needs_key
    for frame, truth in shots(rng, 5, codec):
        detection = look(eye, [frame], truth)
        assert detection.reason == ""
        assert detection.t == frame.t
        assert not is_wrong(detection.pose, truth)
    assert not eye.needs_key
    assert eye.undecodable == 0
    assert eye.luma.shape == (CAMERA.height, CAMERA.width)


def test_pictures_are_dated_as_the_profile_of_the_camera_says():
    rng = np.random.default_rng(80)
    camera = replace(CAMERA, extrinsics=Extrinsics(np.eye(3), time_offset_s=-0.02))
    eye = FramePipeline(camera, ROBOT, GatesConfig())
    frame, truth = next(iter(shots(rng, 1)))
    assert look(eye, [frame], truth).t == pytest.approx(frame.t - 0.02)


def test_of_several_pictures_all_are_decoded_and_the_newest_is_looked_at():
    rng = np.random.default_rng(81)
    frames, truths = zip(*shots(rng, 5), strict=True)
    eye = frame_pipeline()
    detection = look(eye, frames, truths[-1])
    assert detection.t == frames[-1].t
    assert not is_wrong(detection.pose, truths[-1])


def test_no_pictures_are_no_sighting():
    assert frame_pipeline().see([]) is None


def test_a_stream_begins_with_a_key_picture():
    rng = np.random.default_rng(82)
    camera_side = encoder()
    (_, second), truths = zip(*shots(rng, 2, with_=camera_side), strict=True)
    eye = frame_pipeline()
    assert look(eye, [second], truths[1]) is None
    assert eye.needs_key
    assert eye.undecodable == 0  # nobody tried
    again = sent(2, *camera_side.encode(picture(truths[1], rng), key=True))
    assert look(eye, [again], truths[1]).pose is not None


@pytest.mark.parametrize("garbage", [b"", b"\x00" * 500, b"not a picture", b"\xff\xd8\xff"])
def test_an_undecodable_picture_is_counted_and_the_stream_waits_for_a_key(garbage):
    rng = np.random.default_rng(83)
    camera_side, eye = encoder(), frame_pipeline()
    (first, second, third), truths = zip(*shots(rng, 3, with_=camera_side), strict=True)
    assert look(eye, [first], truths[0]).pose is not None
    assert (
        look(eye, [replace(second, picture=replace(second.picture, data=garbage))], truths[1])
        is None
    )
    assert eye.undecodable == 1
    assert eye.needs_key
    assert look(eye, [third], truths[2]) is None
    assert eye.undecodable == 1
    key = sent(3, *camera_side.encode(picture(truths[2], rng), key=True))
    assert not is_wrong(look(eye, [key], truths[2]).pose, truths[2])
    assert not eye.needs_key


def test_a_picture_of_another_size_is_undecodable():
    rng = np.random.default_rng(84)
    small, truth = Encoder(640, 480, 30.0, 1_000_000), truth_at(rng)
    eye = frame_pipeline()
    frame = sent(0, *small.encode(np.zeros((480, 640), np.uint8)))
    assert look(eye, [frame], truth) is None
    assert eye.undecodable == 1


def test_the_codec_may_change_at_a_key_picture():
    rng = np.random.default_rng(85)
    eye, truth = frame_pipeline(), truth_at(rng)
    for codec in ("h264", "jpeg", "vp8", "h264"):
        ((frame, _),) = shots(rng, 1, codec, truth=truth)
        assert not is_wrong(look(eye, [frame], truth).pose, truth)


def test_a_pose_that_gravity_contradicts_is_not_believed():
    rng = np.random.default_rng(86)
    eye = frame_pipeline()
    (first, second), (truth, after) = zip(*shots(rng, 2), strict=True)
    assert eye.see([first]).pose is not None  # nothing contradicts
    upset = exp(np.array([0.5, 0.0, 0.0])) @ truth.prior().up_in_b
    hold(eye, second.t, after.prior().up_in_c, upset)
    detection = eye.see([second])
    assert detection.pose is None
    assert detection.reason.startswith("Not believed: gravity disagrees by")


def test_a_pose_out_of_range_is_not_believed():
    rng = np.random.default_rng(87)
    ((frame, truth),) = shots(rng, 1)
    detection = look(frame_pipeline(max_range_m=1.0), [frame], truth)
    assert detection.pose is None
    assert "m away" in detection.reason


def test_why_nothing_is_seen_is_passed_on():
    rng = np.random.default_rng(88)
    dark = np.full((CAMERA.height, CAMERA.width), 40, np.uint8)
    detection = look(frame_pipeline(), [sent(0, *encoder().encode(dark))], truth_at(rng))
    assert detection.reason == "No light in the picture is bright enough."


def test_the_stages_are_timed():
    rng = np.random.default_rng(89)
    ticks = count()
    eye = FramePipeline(CAMERA, ROBOT, GatesConfig(), lambda: next(ticks))
    ((frame, truth),) = shots(rng, 1)
    assert set(look(eye, [frame], truth).took_s) == {"decode", "detect", "identify", "pose"}


def test_after_a_lost_picture_nothing_is_decoded_before_a_key():
    """FFmpeg hides a missing picture: the LEDs would stand where they were, without a word."""
    rng = np.random.default_rng(84)
    frames, truths = zip(*shots(rng, 3), strict=True)
    eye = frame_pipeline()
    assert look(eye, frames[:1], truths[0]).pose is not None
    assert look(eye, frames[2:], truths[2]) is None
    assert eye.needs_key


def test_a_few_leds_where_control_expects_them_are_rays_without_a_pose():
    """Also of a robot that is drawn on a glass, of whose lights the filter is told that."""
    rng = np.random.default_rng(90)
    eye, truth, camera_side = frame_pipeline(), truth_at(rng), encoder()
    for k in range(10):
        for t in (k * DT - 0.01, k * DT + 0.01):
            eye.front_end.add_prediction(Prediction(t, truth.p, truth.R, ZERO, 0.005, 0.005))
        if k == 8:
            eye.front_end.films_glass(GLASS_SAYS)
        covered = (0, 2, 4) if 3 <= k < 9 else ()
        shot = sent(k, *camera_side.encode(picture(truth, rng, covered=covered)))
        detection = look(eye, [shot], truth)
        assert (detection.pose is None) == bool(covered)
        if covered:
            assert sorted(detection.rays.led.tolist()) == [1, 3]
            assert detection.reason == "2 of 5 LEDs seen."
        seen = detection.seen(CAMERA)
        assert seen.is_drawn == (k >= 8)
        assert seen.offset == (GLASS_SAYS if k == 9 else None)
    eye.front_end.add_prediction(None)
    shot = sent(10, *camera_side.encode(picture(truth, rng, covered=(0, 2, 4))))
    assert len(look(eye, [shot], truth).rays) == 0


def test_rays_of_a_pose_that_is_not_believed_are_not_handed_on():
    rng = np.random.default_rng(91)
    ((frame, truth),) = shots(rng, 1)
    detection = look(frame_pipeline(max_range_m=1.0), [frame], truth)
    assert detection.match is not None
    assert len(detection.rays) == 0
    assert detection.seen(CAMERA) is None


@pytest.mark.parametrize(
    ("by_arrival", "offset"), [(True, StampOffset(0.0, ARRIVAL_S)), (False, None)]
)
def test_of_pictures_dated_by_their_arrival_the_filter_is_told_by_how_much(by_arrival, offset):
    eye = frame_pipeline()
    for frame, truth in shots(np.random.default_rng(83), 3):
        guessed = replace(frame.picture, by_arrival=by_arrival)
        detection = look(eye, [replace(frame, picture=guessed)], truth)
    assert detection.seen(CAMERA).offset == offset
