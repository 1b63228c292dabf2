"""What the server tells control, as msgpack: the pipeline's own values, arrays as shape and bytes.

Who sends may be anybody, or of another version: what `decode` gives has its shapes and numbers that
can be believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import LedRays, PhoneImu, RelativePose, TouchState, VisionMeasurement
from pipeline.vision.blink_code import CODES
from server.common.runtime_parameters import Tune
from server.protocol.lead_messages import Lead

LARGEST = 1e9
"""No time, sensor or pose has a number or an array of a length beyond it."""
MAX_LEDS = 16
"""Of any robot file."""
FLOAT, INDEX = np.dtype(np.float64), np.dtype(np.intp)
KINDS: dict[str, np.dtype[Any]] = {dtype.kind: dtype for dtype in (FLOAT, INDEX)}


class RequestInput(msgspec.Struct, tag="request", array_like=True, frozen=True):
    """A request of a person, already checked for its role."""

    what: str


class ReadyInput(msgspec.Struct, tag="ready", array_like=True, frozen=True):
    """What the server has against arming, nothing when all is well; sent at 10 Hz."""

    refusals: list[str]


class BlinkInput(msgspec.Struct, tag="blink", array_like=True, frozen=True):
    """The robot's LEDs shall blink a code of `blink_code.book`; said again while it is wanted."""

    number: int
    t_begin: float


class ToolInput(msgspec.Struct, tag="tool", array_like=True, frozen=True):
    """How far the robot's tool shall be open, 0 to 1, while the hand leads."""

    opening: float


Input = (
    PhoneImu
    | VisionMeasurement
    | TouchState
    | RequestInput
    | ReadyInput
    | BlinkInput
    | Tune
    | Lead
    | ToolInput
)


class _Motion(msgspec.Struct, tag="imu", array_like=True, frozen=True):
    input: PhoneImu


class _Seen(msgspec.Struct, tag="seen", array_like=True, frozen=True):
    input: VisionMeasurement


class _Touch(msgspec.Struct, tag="touch", array_like=True, frozen=True):
    input: TouchState


class _Tune(msgspec.Struct, tag="tune", array_like=True, frozen=True):
    input: Tune


class _Lead(msgspec.Struct, tag="lead", array_like=True, frozen=True):
    input: Lead


def _plain(array: npt.NDArray[Any]) -> tuple[str, tuple[int, ...], bytes]:
    return array.dtype.kind, array.shape, array.tobytes()


def _array(_: type, plain: tuple[str, Sequence[int], bytes]) -> npt.NDArray[Any]:
    """An array of its own, which kernels take.

    Raises:
        ValueError, TypeError: it is none.
    """
    kind, shape, data = plain
    try:
        return np.ndarray(shape, KINDS.get(kind, FLOAT), bytearray(memoryview(data)))
    except OverflowError as error:
        raise ValueError(str(error)) from error


_TAGGED = {
    PhoneImu: _Motion,
    VisionMeasurement: _Seen,
    TouchState: _Touch,
    Tune: _Tune,
    Lead: _Lead,
}
_encoder = msgspec.msgpack.Encoder(enc_hook=_plain)
_decoder = msgspec.msgpack.Decoder(
    _Motion | _Seen | _Touch | RequestInput | ReadyInput | BlinkInput | _Tune | _Lead | ToolInput,
    dec_hook=_array,
)


def encode(message: Input) -> bytes:
    """One datagram."""
    tagged: Any = _TAGGED.get(type(message))
    return _encoder.encode(message if tagged is None else tagged(message))


def decode(datagram: bytes) -> Input:
    """What a datagram says.

    Raises:
        ValueError, RecursionError: nothing that can be believed.
    """
    said = _decoder.decode(datagram)
    message: Input = getattr(said, "input", said)
    if not is_believable(message):
        raise ValueError("a shape or a number that can't be")
    return message


def is_believable(message: Input) -> bool:
    """Whether its arrays have their shapes, and all its numbers are finite and of this world.

    No other may reach the state.
    """
    match message:
        case PhoneImu():
            return (
                abs(message.t) <= LARGEST
                and _fits(message.omega_m_cf_in_c, 3)
                and _fits(message.a_m_cf_in_c, 3)
            )
        case VisionMeasurement():
            offset = message.offset
            return (
                hypot(message.t, *message.half_field) <= LARGEST
                and (offset is None or hypot(offset.value, offset.sigma) <= LARGEST)
                and _are_rays(message.rays)
                and (message.pose is None or _is_pose(message.pose))
            )
        case TouchState():
            return abs(message.t) <= LARGEST
        case BlinkInput():
            return 0 <= message.number < CODES and abs(message.t_begin) <= LARGEST
        case ToolInput():
            return 0.0 <= message.opening <= 1.0
        case _:
            return True


def _fits(array: Array, *shape: int) -> bool:
    return (
        array.shape == shape and array.dtype == FLOAT and hypot(*array.ravel().tolist()) <= LARGEST
    )


def _are_rays(rays: LedRays) -> bool:
    count = len(rays)
    return (
        count <= MAX_LEDS
        and rays.led.shape == (count,)
        and rays.led.dtype == INDEX
        and all(0 <= led < MAX_LEDS for led in rays.led.tolist())
        and _fits(rays.t, count)
        and _fits(rays.tangents, count, 2)
        and _fits(rays.covariances, count, 2, 2)
    )


def _is_pose(pose: RelativePose) -> bool:
    return (
        hypot(pose.t, pose.reprojection_px) <= LARGEST
        and _fits(pose.p_bc_in_c, 3)
        and _fits(pose.R_cb, 3, 3)
        and _fits(pose.covariance, 6, 6)
    )
