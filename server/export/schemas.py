"""Our own protobuf messages, for what Foxglove has none: package `lightleash`.

Their descriptors travel within each file, so that no reader needs ours.
"""

from __future__ import annotations

from typing import Final

from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
)
from google.protobuf.descriptor_pool import Default
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from google.protobuf.timestamp_pb2 import Timestamp

PACKAGE = "lightleash"
SHARED: Final = {"Timestamp": Timestamp, "Vector3": Vector3, "Pose": Pose}
"""Messages of others within ours."""
SCALARS: Final = {
    "double": FieldDescriptorProto.TYPE_DOUBLE,
    "bool": FieldDescriptorProto.TYPE_BOOL,
    "string": FieldDescriptorProto.TYPE_STRING,
    "uint32": FieldDescriptorProto.TYPE_UINT32,
}
OWN: Final = {
    "Imu": (
        "Timestamp timestamp, string frame_id,"
        "Vector3 angular_velocity_rad_s, Vector3 specific_force_m_s2"
    ),
    "PictureTime": (
        "Timestamp timestamp, double sigma_s, Timestamp received, uint32 sequence,"
        "string codec, bool key"
    ),
    "State": (
        "Timestamp timestamp, string mode, string reason, double pose_age_s,"
        "Pose body_in_phone, Vector3 body_velocity_in_phone_m_s,"
        "double sigma_position_m, double sigma_attitude_rad,"
        "double picture_delay_s, double picture_delay_sigma_s"
    ),
    "Command": (
        "Timestamp timestamp, string mode, Pose reference_in_virtual, double error_m,"
        "double error_rad, repeated double thrusts_n, bool saturated,"
        "Vector3 velocity_in_body_m_s, Vector3 angular_velocity_in_body_rad_s"
    ),
    "Health": "Timestamp timestamp, string battery, double battery_v, repeated string words,"
    "string e_stop",
    "Touch": "Timestamp timestamp, bool held, bool visible, uint32 press",
}
"""Fields of each message, numbered from 1 as they stand. What nobody knows is left out."""


def _described(name: str, fields: str) -> DescriptorProto:
    message = DescriptorProto(name=name)
    for number, text in enumerate(fields.split(","), 1):
        *repeated, kind, field_name = text.split()
        field = message.field.add(name=field_name, number=number)
        field.label = FieldDescriptorProto.LABEL_OPTIONAL
        if repeated:
            field.label = FieldDescriptorProto.LABEL_REPEATED
        if kind in SCALARS:
            field.type = SCALARS[kind]
        else:
            field.type = FieldDescriptorProto.TYPE_MESSAGE
            field.type_name = f".{SHARED[kind].DESCRIPTOR.full_name}"
    return message


def _file() -> FileDescriptorProto:
    file = FileDescriptorProto(name=f"{PACKAGE}.proto", package=PACKAGE, syntax="proto2")
    file.dependency.extend(sorted(shared.DESCRIPTOR.file.name for shared in SHARED.values()))
    file.message_type.extend(_described(name, fields) for name, fields in OWN.items())
    return file


def _class_of(name: str) -> type[Message]:
    found: type[Message] = GetMessageClass(Default().FindMessageTypeByName(f"{PACKAGE}.{name}"))
    return found


Default().Add(_file())
Imu, PictureTime, State, Command, Health, Touch = map(_class_of, OWN)
