"""MCAP with Foxglove's protobuf messages: Foxglove, Lichtblick and Rerun show it as it is.

| topic | message | when |
|---|---|---|
| /phone/video | CompressedVideo: H.264 as it came, from the first key picture on | capture |
| /phone/image | CompressedImage: JPEG as it came; VP8, not known there, as JPEG | capture |
| /phone/calibration | CameraCalibration, where the camera is known | capture |
| /phone/picture_time | `schemas.PictureTime`: how well the capture is known; arrival | capture |
| /phone/imu, /robot/imu | `schemas.Imu` | sampling |
| /phone/touch | `schemas.Touch` | touch |
| /tf | FrameTransforms: inertial → phone → optical and base_link | tick |
| | and inertial → virtual → reference | |
| /robot/pose | PoseInFrame: base_link in phone | tick |
| /robot/odometry | Odometry: the same with its covariance | tick |
| /robot/state, /robot/command | `schemas.State`, `schemas.Command` | tick |
| /robot/health | `schemas.Health`, of a robot that tells of itself | tick |
| /robot/leds | SceneUpdate: LEDs in base_link | once |
| /log | Log | event |
| /episodes | Event: from press to release, with task and keep | press |

Of phone and virtual camera the directions alone are known: inertial is drawn where they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.Event_pb2 import Event
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.KeyValuePair_pb2 import KeyValuePair
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.writer import Writer

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.signals import BodyImu, PhoneImu
from server.export import schemas
from server.export.decoded import (
    DatedPicture,
    DatedTouch,
    DecodedRecording,
    LogLine,
    RecordedState,
)
from server.export.episodes import Episode
from server.export.pictures import PicturePacker, coefficients
from server.export.transforms import BODY, FILMED, OPTICAL, PHONE, FramePlace, covariance, places
from server.recording.writer import CAMERA_KEY, ROBOT_KEY, SETTINGS_KEY

MODELS = {"equidistant": "kannala_brandt"}
"""Lens models that go by other names there."""
LED_M = 0.03
"""Diameter of an LED as drawn."""
LED_COLOUR = Color(r=1.0, g=0.2, b=0.1, a=1.0)
ATTACHED = {
    ROBOT_KEY: ("robot.toml", "application/toml"),
    CAMERA_KEY: ("camera.yaml", "application/yaml"),
    SETTINGS_KEY: ("settings.txt", "text/plain"),
}
"""Files within the record's metadata, and what they are called as attachments."""


def write(decoded: DecodedRecording, episodes: Sequence[Episode], path: Path) -> str:
    """Write `path`; gives a line about it.

    Raises:
        RecordingError: the recording is damaged.
        OSError: the file can't be written.
    """
    with path.open("wb") as file, Writer(file, profile="") as writer:
        film = _Film(decoded, writer)
        film.begin(episodes)
        for item in decoded.items():
            film.put(item)
    return film.packer.summary()


class _Film:
    """The file while it is written."""

    def __init__(self, decoded: DecodedRecording, writer: Writer) -> None:
        self._decoded, self._writer = decoded, writer
        self._camera: Camera | None = None
        self.packer = PicturePacker()

    def begin(self, episodes: Sequence[Episode]) -> None:
        recording = self._decoded.recording
        t = recording.t_first
        ns = self._decoded.unix_ns(t)
        self._writer.add_metadata("lightleash", _plain(recording.metadata))
        for key, (name, media_type) in ATTACHED.items():
            if text := recording.metadata.get(key):
                self._writer.add_attachment(0, ns, name, media_type, text.encode())
        self._put("/robot/leds", t, SceneUpdate(entities=[self._leds(t)]))
        for episode in episodes:
            self._put("/episodes", episode.t_begin, self._episode(episode))

    def put(self, item: object) -> None:
        match item:
            case DatedPicture():
                self._picture(item)
            case PhoneImu(t, rate, force):
                self._imu("/phone/imu", PHONE, t, rate, force)
            case BodyImu(t, rate, force):
                self._imu("/robot/imu", BODY, t, rate, force)
            case DatedTouch(t, held, visible, press):
                touch = schemas.Touch(
                    timestamp=self._stamp(t), held=held, visible=visible, press=press
                )
                self._put("/phone/touch", t, touch)
            case LogLine(t, source, text, alarms):
                level = Log.WARNING if alarms else Log.INFO
                log = Log(timestamp=self._stamp(t), level=level, message=text, name=source)
                self._put("/log", t, log)
            case RecordedState():
                self._state(item)

    def _put(self, topic: str, t: float, message: Message) -> None:
        ns = self._decoded.unix_ns(t)
        self._writer.write_message(topic, message, log_time=ns, publish_time=ns)

    def _stamp(self, t: float) -> Timestamp:
        stamp = Timestamp()
        stamp.FromNanoseconds(self._decoded.unix_ns(t))
        return stamp

    def _picture(self, item: DatedPicture) -> None:
        picture, stamp = item.picture, self._stamp(item.t)
        self._calibrate(item)
        times = schemas.PictureTime(
            timestamp=stamp,
            sigma_s=item.sigma_s,
            received=self._stamp(item.t_received),
            sequence=item.sequence,
            codec=picture.codec.name,
            key=picture.key,
        )
        self._put("/phone/picture_time", item.t, times)
        match self.packer.packed(item):
            case "h264", data:
                video = CompressedVideo(timestamp=stamp, frame_id=OPTICAL, data=data, format="h264")
                self._put("/phone/video", item.t, video)
            case "jpeg", data:
                image = CompressedImage(timestamp=stamp, frame_id=OPTICAL, data=data, format="jpeg")
                self._put("/phone/image", item.t, image)

    def _calibrate(self, item: DatedPicture) -> None:
        """Tell of the camera whenever it is another one."""
        camera = self._decoded.camera(item.picture)
        if camera is None or camera is self._camera:
            return
        self._camera = camera
        calibration = CameraCalibration(
            timestamp=self._stamp(item.t),
            frame_id=OPTICAL,
            width=camera.width,
            height=camera.height,
            distortion_model=MODELS.get(camera.model, camera.model),
            D=coefficients(camera).tolist(),
            K=camera.K.ravel().tolist(),
            R=np.eye(3).ravel().tolist(),
            P=np.column_stack((camera.K, np.zeros(3))).ravel().tolist(),
        )
        self._put("/phone/calibration", item.t, calibration)

    def _imu(self, topic: str, frame: str, t: float, rate: Array, force: Array) -> None:
        imu = schemas.Imu(
            timestamp=self._stamp(t),
            frame_id=frame,
            angular_velocity_rad_s=_vector(rate.tolist()),
            specific_force_m_s2=_vector(force.tolist()),
        )
        self._put(topic, t, imu)

    def _state(self, state: RecordedState) -> None:
        t, stamp = state.t, self._stamp(state.t)
        transforms = [_transform(place, stamp) for place in (FILMED, *places(state))]
        self._put("/tf", t, FrameTransforms(transforms=transforms))
        pose = _pose(state.p_bc_in_c, state.R_cb_wxyz)
        if pose is not None:
            self._put("/robot/pose", t, PoseInFrame(timestamp=stamp, frame_id=PHONE, pose=pose))
            odometry = Odometry(
                timestamp=stamp,
                frame_id=PHONE,
                body_frame_id=BODY,
                pose=pose,
                pose_covariance=covariance(state).ravel().tolist(),
            )
            self._put("/robot/odometry", t, odometry)
        u, twist = state.u_bf_in_c, state.twist_in_b
        self._put(
            "/robot/state",
            t,
            schemas.State(
                timestamp=stamp,
                mode=state.mode_name,
                reason=state.reason,
                pose_age_s=state.pose_age,
                body_in_phone=pose,
                body_velocity_in_phone_m_s=_vector(u) if u is not None else None,
                sigma_position_m=state.sigma_p,
                sigma_attitude_rad=state.sigma_theta,
                picture_delay_s=state.time_offset,
                picture_delay_sigma_s=state.time_offset_sigma,
            ),
        )
        self._put(
            "/robot/command",
            t,
            schemas.Command(
                timestamp=stamp,
                mode=state.mode_name,
                reference_in_virtual=_pose(state.reference_p_in_v, state.reference_R_wxyz),
                error_m=state.error_m,
                error_rad=state.error_rad,
                thrusts_n=state.thrusts,
                saturated=state.saturated,
                velocity_in_body_m_s=_vector(twist[:3]) if twist is not None else None,
                angular_velocity_in_body_rad_s=_vector(twist[3:]) if twist is not None else None,
            ),
        )

        health = state.health
        if health is not None and (health.battery, health.e_stop) != ("untold", "untold"):
            told = schemas.Health(
                timestamp=stamp,
                battery=health.battery,
                battery_v=health.battery_v,
                words=health.words,
                e_stop=health.e_stop,
            )
            self._put("/robot/health", t, told)

    def _leds(self, t: float) -> SceneEntity:
        size = Vector3(x=LED_M, y=LED_M, z=LED_M)
        spheres = [
            SpherePrimitive(pose=_pose(led, (1.0, 0.0, 0.0, 0.0)), size=size, color=LED_COLOUR)
            for led in self._decoded.robot.robot.leds_in_b.tolist()
        ]
        return SceneEntity(
            timestamp=self._stamp(t), frame_id=BODY, id="leds", frame_locked=True, spheres=spheres
        )

    def _episode(self, episode: Episode) -> Event:
        metadata = {
            "episode": str(episode.number),
            "task": episode.task,
            "keep": str(episode.keep).lower(),
        }
        return Event(
            start_time=self._stamp(episode.t_begin),
            end_time=self._stamp(episode.t_end),
            metadata=[KeyValuePair(key=key, value=value) for key, value in metadata.items()],
        )


def _plain(metadata: dict[str, str]) -> dict[str, str]:
    """Metadata without what is attached."""
    return {key: text for key, text in metadata.items() if key not in ATTACHED}


def _vector(v: Sequence[float]) -> Vector3:
    return Vector3(x=v[0], y=v[1], z=v[2])


def _quaternion(wxyz: Sequence[float]) -> Quaternion:
    w, x, y, z = wxyz
    return Quaternion(w=w, x=x, y=y, z=z)


def _pose(p: Sequence[float] | None, wxyz: Sequence[float] | None) -> Pose | None:
    if p is None or wxyz is None:
        return None
    return Pose(position=_vector(p), orientation=_quaternion(wxyz))


def _transform(place: FramePlace, stamp: Timestamp) -> FrameTransform:
    return FrameTransform(
        timestamp=stamp,
        parent_frame_id=place.parent,
        child_frame_id=place.child,
        translation=_vector(place.p),
        rotation=_quaternion(place.wxyz),
    )
