"""What a leader sees of the robot: spots with noise, or pictures through a codec and vision."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, Protocol

import numpy as np

from hardware.codec import Encoder
from hardware.sim.led_sensor_model import LedSensorModel
from hardware.sim.phone import BodyHistory, Event, VirtualPhone
from pipeline.frames import Array
from pipeline.prediction import Prediction
from pipeline.robot import Robot
from pipeline.signals import BodyImu, PhoneImu, RelativeState, VisionMeasurement
from pipeline.vision_config import GatesConfig
from server.common.settings import VideoSettings
from server.phone.frame_pipeline import FramePipeline
from server.phone.ingest import EncodedFrame
from server.protocol.wire_records import Picture
from server.virtual_phone.phone_script import PhoneScript, VirtualOperator

BITRATE_BPS: Final = VideoSettings().bitrate_bps
"""What a server asks a phone for."""
STATUS_PERIODS: Final = 4
"""Vision hears of control's filter every 20 ms, as in the server."""


class VisionModel(Protocol):
    """Pictures that arrived, and what vision knows beside them."""

    def add_imu(self, samples: Iterable[PhoneImu | BodyImu]) -> None:
        """Follow the motion of both sides."""

    def add_prediction(self, relative: RelativeState | None, time_offset: float) -> None:
        """Follow what control's filter says at the end of a period."""

    def see(self, pictures: Sequence[Event], body: BodyHistory) -> VisionMeasurement | None:
        """What the newest of `pictures`, in order and not none, says of the robot."""


class RayVisionModel:
    """LED rays with noise: nothing is rendered or associated wrongly, and times are known."""

    def __init__(
        self, phone: VirtualPhone, leds_in_b: Array, noise_px: float, rng: np.random.Generator
    ) -> None:
        """LEDs (n, 3) [m]; `noise_px` as in `LedSensorModel`."""
        self._vision_model = LedSensorModel(phone, leds_in_b, noise_px, lambda _: (), rng)

    def add_imu(self, samples: Iterable[PhoneImu | BodyImu]) -> None:
        """It needs no help."""

    def add_prediction(self, relative: RelativeState | None, time_offset: float) -> None:
        """It needs no help."""

    def see(self, pictures: Sequence[Event], body: BodyHistory) -> VisionMeasurement | None:
        """What the newest says; the others are passed over."""
        t = pictures[-1].t_capture
        return self._vision_model.seen(t, t, body)


class RenderedVisionModel:
    """Pictures are rendered, encoded, decoded and looked at, as a phone and a server do."""

    def __init__(self, phone: VirtualPhone, codec: str, robot: Robot, gates: GatesConfig) -> None:
        """`codec` is one of `hardware.codec.CODECS`."""
        camera, rate_hz = phone.camera, phone.options.frame_rate_hz
        encoder = Encoder(camera.width, camera.height, rate_hz, BITRATE_BPS, codec)
        self._script = PhoneScript(phone, encoder, VirtualOperator())
        self._frame_pipeline = FramePipeline(camera, robot, gates)
        self._periods = 0

    def add_imu(self, samples: Iterable[PhoneImu | BodyImu]) -> None:
        """Follow the motion of both sides."""
        self._frame_pipeline.front_end.add_imu(*samples)

    def add_prediction(self, relative: RelativeState | None, time_offset: float) -> None:
        """Follow what control's filter says at the end of a period."""
        self._periods += 1
        if self._periods % STATUS_PERIODS == 0:
            said = Prediction.of(relative, time_offset) if relative is not None else None
            self._frame_pipeline.front_end.add_prediction(said)

    def see(self, pictures: Sequence[Event], body: BodyHistory) -> VisionMeasurement | None:
        """What the newest says; all are decoded, as each needs the one before it."""
        frames = [self._frame(event, body) for event in pictures]
        detection = self._frame_pipeline.see(frames)
        return detection.seen(self._frame_pipeline.camera) if detection is not None else None

    def _frame(self, event: Event, body: BodyHistory) -> EncodedFrame:
        record = self._script.picture(event.t_capture, body, self._frame_pipeline.needs_key)
        assert isinstance(record.body, Picture)
        return EncodedFrame(event.t_capture, event.t_deliver, record.sequence, record.body)
