"""rosbag2 with MCAP inside, for ROS 2 from Jazzy on and for `rosbags`; written without ROS.

| topic | type | stamped with |
|---|---|---|
| /phone/video | foxglove_msgs/CompressedVideo: H.264 as it came | capture |
| /phone/image/compressed | sensor_msgs/CompressedImage: JPEG, VP8 as JPEG | capture |
| /phone/camera_info | sensor_msgs/CameraInfo | capture |
| /phone/imu, /robot/imu | sensor_msgs/Imu, without attitude | sampling |
| /phone/touch | sensor_msgs/Joy: buttons held, visible; axes press | touch |
| /tf, /tf_static | tf2_msgs/TFMessage: as for Foxglove; static optical and led_0 … | tick |
| /robot/pose | geometry_msgs/PoseWithCovarianceStamped: base_link in phone | tick |
| /robot/velocity | geometry_msgs/Vector3Stamped: in space, in the axes of phone | tick |
| /robot/thrusters | sensor_msgs/JointState: effort [N] | tick |
| /robot/twist | geometry_msgs/TwistStamped: told, of a robot that takes one | tick |
| /robot/battery | sensor_msgs/BatteryState: voltage alone, while the robot tells it | tick |
| /robot/mode | std_msgs/String | its change |
| /rosout | rcl_interfaces/Log | event |
| /episodes | std_msgs/String: JSON with begin_s, end_s (since 1970), task, keep | press |

The bag's custom data have the robot's and the camera's file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pipeline.camera.lens import Camera
from pipeline.frames import Array, Triple
from pipeline.signals import BodyImu, PhoneImu
from server.export.decoded import (
    DatedPicture,
    DatedTouch,
    DecodedRecording,
    Item,
    LogLine,
    Quaternion,
    RecordedState,
)
from server.export.episodes import Episode
from server.export.pictures import PicturePacker, coefficients
from server.export.transforms import BODY, FILMED, OPTICAL, PHONE, FramePlace, covariance, places

BAG_VERSION: Final = 9
"""Of the bag's own description: Jazzy's."""
VIDEO = "foxglove_msgs/msg/CompressedVideo"
VIDEO_FIELDS = "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n"
INFO, WARN = 20, 30
"""Levels of rcl_interfaces/Log."""
UNKNOWN = -1.0
"""In the first cell of a covariance: the measurement isn't there."""


def write(decoded: DecodedRecording, episodes: Sequence[Episode], folder: Path) -> str:
    """Write the bag `folder`; gives a line about it.

    Raises:
        RecordingError: the recording is damaged.
        OSError: it can't be written.
    """
    with Writer(folder, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        for key, text in decoded.recording.metadata.items():
            writer.set_custom_data(key, text)
        bag = _Bag(decoded, writer)
        bag.begin(episodes)
        for item in decoded.items():
            bag.put(item)
    return bag.packer.summary()


class _Bag:
    """The bag while it is written."""

    def __init__(self, decoded: DecodedRecording, writer: Writer) -> None:
        self._decoded, self._writer = decoded, writer
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._store.register(get_types_from_msg(VIDEO_FIELDS, VIDEO))
        self._connections: dict[str, Connection] = {}
        self._camera: Camera | None = None
        self._mode = ""
        self.packer = PicturePacker()

    def begin(self, episodes: Sequence[Episode]) -> None:
        t = self._decoded.recording.t_first
        leds = self._decoded.robot.robot.leds_in_b.tolist()
        upright = (1.0, 0.0, 0.0, 0.0)
        fixed = [
            FramePlace(BODY, f"led_{k}", (x, y, z), upright) for k, (x, y, z) in enumerate(leds)
        ]
        self._transforms("/tf_static", t, [FILMED, *fixed])
        for episode in episodes:
            description = {
                "episode": episode.number,
                "begin_s": 1e-9 * self._decoded.unix_ns(episode.t_begin),
                "end_s": 1e-9 * self._decoded.unix_ns(episode.t_end),
                "task": episode.task,
                "keep": episode.keep,
            }
            text = msgspec.json.encode(description).decode()
            self._put("/episodes", episode.t_begin, "std_msgs/msg/String", data=text)

    def put(self, item: Item) -> None:
        match item:
            case DatedPicture():
                self._picture(item)
            case PhoneImu(t, rate, force):
                self._imu("/phone/imu", PHONE, t, rate, force)
            case BodyImu(t, rate, force):
                self._imu("/robot/imu", BODY, t, rate, force)
            case DatedTouch(t, held, visible, press):
                axes = np.array([press], dtype=np.float32)
                buttons = np.array([held, visible], dtype=np.int32)
                header = self._header(t, PHONE)
                self._put(
                    "/phone/touch",
                    t,
                    "sensor_msgs/msg/Joy",
                    header=header,
                    axes=axes,
                    buttons=buttons,
                )
            case LogLine(t, source, text, alarms):
                self._log(t, source, text, WARN if alarms else INFO)
            case RecordedState():
                self._state(item)

    def _make(self, kind: str, **fields: object) -> Any:  # noqa: ANN401  (a class made of text)
        make: Callable[..., Any] = self._store.types[kind]
        return make(**fields)

    def _put(self, topic: str, t: float, kind: str, **fields: object) -> None:
        connection = self._connections.get(topic)
        if connection is None:
            connection = self._writer.add_connection(topic, kind, typestore=self._store)
            self._connections[topic] = connection
        data = self._store.serialize_cdr(self._make(kind, **fields), kind)
        self._writer.write(connection, self._decoded.unix_ns(t), data)

    def _stamp(self, t: float) -> Any:  # noqa: ANN401
        sec, nanosec = divmod(self._decoded.unix_ns(t), 10**9)
        return self._make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    def _header(self, t: float, frame: str) -> Any:  # noqa: ANN401
        return self._make("std_msgs/msg/Header", stamp=self._stamp(t), frame_id=frame)

    def _vector(self, v: Sequence[float], kind: str = "Vector3") -> Any:  # noqa: ANN401
        return self._make(f"geometry_msgs/msg/{kind}", x=v[0], y=v[1], z=v[2])

    def _quaternion(self, wxyz: Quaternion) -> Any:  # noqa: ANN401
        w, x, y, z = wxyz
        return self._make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def _picture(self, item: DatedPicture) -> None:
        self._calibrate(item)
        match self.packer.packed(item):
            case "h264", data:
                self._put(
                    "/phone/video",
                    item.t,
                    VIDEO,
                    timestamp=self._stamp(item.t),
                    frame_id=OPTICAL,
                    data=np.frombuffer(data, np.uint8),
                    format="h264",
                )
            case "jpeg", data:
                self._put(
                    "/phone/image/compressed",
                    item.t,
                    "sensor_msgs/msg/CompressedImage",
                    header=self._header(item.t, OPTICAL),
                    format="jpeg",
                    data=np.frombuffer(data, np.uint8),
                )

    def _calibrate(self, item: DatedPicture) -> None:
        """Tell of the camera whenever it is another one."""
        camera = self._decoded.camera(item.picture)
        if camera is None or camera is self._camera:
            return
        self._camera = camera
        nothing = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 0)
        roi = self._make("sensor_msgs/msg/RegionOfInterest", **nothing, do_rectify=False)
        self._put(
            "/phone/camera_info",
            item.t,
            "sensor_msgs/msg/CameraInfo",
            header=self._header(item.t, OPTICAL),
            height=camera.height,
            width=camera.width,
            distortion_model=camera.model,
            d=coefficients(camera),
            k=camera.K.ravel(),
            r=np.eye(3).ravel(),
            p=np.column_stack((camera.K, np.zeros(3))).ravel(),
            binning_x=0,
            binning_y=0,
            roi=roi,
        )

    def _imu(self, topic: str, frame: str, t: float, rate: Array, force: Array) -> None:
        absent = np.zeros(9)
        absent[0] = UNKNOWN
        self._put(
            topic,
            t,
            "sensor_msgs/msg/Imu",
            header=self._header(t, frame),
            orientation=self._quaternion((1.0, 0.0, 0.0, 0.0)),
            orientation_covariance=absent,
            angular_velocity=self._vector(rate.tolist()),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self._vector(force.tolist()),
            linear_acceleration_covariance=np.zeros(9),
        )

    def _log(self, t: float, source: str, text: str, level: int) -> None:
        nowhere = {"file": "", "function": "", "line": 0}
        message = {"stamp": self._stamp(t), "level": level, "name": source, "msg": text}
        self._put("/rosout", t, "rcl_interfaces/msg/Log", **message, **nowhere)

    def _transforms(self, topic: str, t: float, known: Sequence[FramePlace]) -> None:
        transforms = [
            self._make(
                "geometry_msgs/msg/TransformStamped",
                header=self._header(t, place.parent),
                child_frame_id=place.child,
                transform=self._make(
                    "geometry_msgs/msg/Transform",
                    translation=self._vector(place.p),
                    rotation=self._quaternion(place.wxyz),
                ),
            )
            for place in known
        ]
        self._put(topic, t, "tf2_msgs/msg/TFMessage", transforms=transforms)

    def _state(self, state: RecordedState) -> None:
        t = state.t
        self._transforms("/tf", t, places(state))
        if state.mode_name != self._mode:
            self._mode = state.mode_name
            self._put("/robot/mode", t, "std_msgs/msg/String", data=self._mode)
        if state.p_bc_in_c is not None and state.R_cb_wxyz is not None:
            self._pose(state, state.p_bc_in_c, state.R_cb_wxyz)
        if state.u_bf_in_c is not None:
            velocity, kind = self._vector(state.u_bf_in_c), "geometry_msgs/msg/Vector3Stamped"
            header = self._header(t, PHONE)
            self._put("/robot/velocity", t, kind, header=header, vector=velocity)
        if state.battery_v is not None:
            self._battery(t, state.battery_v)
        self._command(state)

    def _battery(self, t: float, volts: float) -> None:
        names = "temperature", "current", "charge", "capacity", "design_capacity", "percentage"
        unknown = dict.fromkeys(names, nan)
        states = "power_supply_status", "power_supply_health", "power_supply_technology"
        self._put(
            "/robot/battery",
            t,
            "sensor_msgs/msg/BatteryState",
            header=self._header(t, BODY),
            voltage=volts,
            **unknown,
            **dict.fromkeys(states, 0),
            present=True,
            cell_voltage=np.zeros(0, dtype=np.float32),
            cell_temperature=np.zeros(0, dtype=np.float32),
            location="",
            serial_number="",
        )

    def _command(self, state: RecordedState) -> None:
        header = self._header(state.t, BODY)
        if (commanded := state.twist_in_b) is not None:
            twist = self._make(
                "geometry_msgs/msg/Twist",
                linear=self._vector(commanded[:3]),
                angular=self._vector(commanded[3:]),
            )
            kind = "geometry_msgs/msg/TwistStamped"
            self._put("/robot/twist", state.t, kind, header=header, twist=twist)
            return
        self._put(
            "/robot/thrusters",
            state.t,
            "sensor_msgs/msg/JointState",
            header=header,
            name=[f"thruster_{k}" for k in range(len(state.thrusts))],
            position=np.zeros(0),
            velocity=np.zeros(0),
            effort=np.array(state.thrusts),
        )

    def _pose(self, state: RecordedState, p: Triple, wxyz: Quaternion) -> None:
        pose = self._make(
            "geometry_msgs/msg/Pose",
            position=self._vector(p, "Point"),
            orientation=self._quaternion(wxyz),
        )
        covaried = self._make(
            "geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance(state).ravel()
        )
        kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
        self._put("/robot/pose", state.t, kind, header=self._header(state.t, PHONE), pose=covaried)
