"""A recording played once, for what it shows of the phone: dates, silences, pictures, camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, nan, sqrt
from typing import Final

import numpy as np

from pipeline.config import FailsafeConfig
from pipeline.estimation.sensor_doubts import PHONES, VIBRATES
from pipeline.estimation.tones import PHONE, Tones
from pipeline.frames import Array
from pipeline.signals import PhoneImu
from pipeline.vision.detection import Detection
from server.diagnostics import camera_health
from server.diagnostics.link_check import check
from server.diagnostics.link_log import Arrival, Series
from server.phone.ingest import EncodedFrame
from server.phone.sensor_check import SensorCheck
from server.protocol.camera_messages import CameraHealth
from server.protocol.link_messages import LinkReport
from server.protocol.wire import decode
from server.protocol.wire_records import Motion, Ping, Pong, Record
from server.recording.reader import Entry, Recording, device_of
from server.recording.writer import SERVER_RECORDS
from server.replay.offline import Offline

STILL_S: Final = 1.0
STILL_RAD_S, STEADY_RAD_S = 0.03, 0.01
"""A phone that lies: its mean rate within the one, a bias, and its spread within the other."""
POSE_UNKNOWNS: Final = 6
ENDS_S: Final = 30.0
"""Beginning and end, of which the rates of pictures are compared ..."""
LONG_S: Final = 120.0
"""... in recordings of at least this."""


@dataclass(frozen=True, slots=True)
class PhoneFigures:
    """What was measured; NaN where nothing tells."""

    device: str
    seconds: float
    size: str
    """Width × height of the first picture [px]."""
    codec: str
    kbit_s: float
    pictures: int
    picture_hz: float
    jitter_ms: float
    """Standard deviation of the time between pictures."""
    lost_pct: float
    """Pictures that are missing in their usual rhythm, or could not be decoded after the first."""
    by_arrival: bool
    """Pictures are dated by their arrival: nobody knows their age."""
    age_ms: tuple[float, float, float]
    """From capture to arrival: median, p95, p99."""
    slower_pct: float
    """By how much fewer pictures came at the end than at the beginning."""
    motion_hz: float
    motion_silence_ms: float
    """The longest."""
    gyro_bias_deg_s: float
    """While it lay still."""
    gravity_m_s2: float
    """Felt while it lay still."""
    clock_ppm: float
    """By how much its clock runs faster."""
    round_trip_ms: float
    """The shortest."""
    found_pct: float
    """Pictures in which the robot's place was found, of those that were looked at."""
    noise_px: float
    """Of an LED's centre, per coordinate, by what a pose leaves unexplained; median."""
    camera: CameraHealth | None
    complaints: tuple[str, ...]
    """Of camera and motion sensors, each as it was said first."""
    link: LinkReport


class RecordedPhone(Offline):
    """Plays a recording, and remembers."""

    def __init__(self, recording: Recording) -> None:
        """Read what it says of robot and camera.

        Raises:
            RecordingError: damaged, or its robot or camera can't be used.
        """
        self._asked: list[float] = []
        self._answers: list[Arrival] = []
        self._motion: list[Arrival] = []
        self._rates: list[Array] = []
        self._forces: list[Array] = []
        self._pictures: list[Arrival] = []
        self._first: EncodedFrame | None = None
        self._bytes = 0
        self._looked_at = self._found = self._undecodable = self._undecodable_first = 0
        self._noise: list[float] = []
        self._tones = Tones(PHONE)
        self._complaints: list[str] = []
        self._sensors = SensorCheck()
        super().__init__(recording)

    def figures(self) -> PhoneFigures:
        """Play it; what it showed.

        Raises:
            RecordingError: the file is damaged.
        """
        for _ in self.rows():
            pass
        recording = self._recording
        seconds = max(recording.t_last - recording.t_first, 1e-9)
        taken = np.array([t for t, _ in self._pictures])
        motion = np.array([t for t, _ in self._motion])
        ages = np.array([came - t for t, came in self._pictures])
        bias, gravity = self._at_rest(motion)
        series = Series(
            recording.t_first,
            recording.t_last,
            tuple(self._asked),
            tuple(self._answers),
            tuple(self._motion),
            tuple(self._pictures),
        )
        first = self._first.picture if self._first is not None else None
        clock = self._ingest.clock
        return PhoneFigures(
            device=device_of(recording) or "unknown",
            seconds=seconds,
            size=f"{first.width}x{first.height}" if first else "",
            codec=first.codec.name if first else "",
            kbit_s=8e-3 * self._bytes / seconds,
            pictures=len(taken),
            picture_hz=_rate(taken),
            jitter_ms=1e3 * float(np.diff(taken).std()) if len(taken) > 2 else nan,
            lost_pct=self._lost_pct(taken),
            by_arrival=first.by_arrival if first else False,
            age_ms=_quantiles_ms(ages),
            slower_pct=_slower_pct(taken),
            motion_hz=_rate(motion),
            motion_silence_ms=1e3 * float(np.diff(motion).max()) if len(motion) > 1 else nan,
            gyro_bias_deg_s=bias,
            gravity_m_s2=gravity,
            clock_ppm=1e6 * clock.drift if clock.ready else nan,
            round_trip_ms=1e3 * clock.round_trip if clock.ready else nan,
            found_pct=100.0 * self._found / self._looked_at if self._looked_at else nan,
            noise_px=float(np.median(self._noise)) if self._noise else nan,
            camera=camera_health.health(self._frame_pipeline.front_end),
            complaints=tuple(
                dict.fromkeys((*self._complaints, *self._sensors.faults(), *self._vibrations()))
            ),
            link=check(series, FailsafeConfig()),
        )

    def _vibrations(self) -> Iterator[str]:
        for sensor, t in zip(PHONES, self._tones.t_heard.tolist(), strict=True):
            if isfinite(t):
                yield VIBRATES.format(sensor=sensor)

    def _new_sight(self) -> None:
        if self._first is not None:
            self._undecodable += self._frame_pipeline.undecodable
        super()._new_sight()

    def _receive(self, entry: Entry) -> None:
        super()._receive(entry)
        if entry.topic == SERVER_RECORDS:
            record = decode(entry.data)
            if isinstance(record.body, Ping):
                self._asked.append(1e-6 * record.t_us)

    def _take(self, record: Record, now: float) -> None:
        super()._take(record, now)
        if isinstance(record.body, Pong):  # else it was refused
            self._answers.append((1e-6 * record.body.server_time_us, now))

    def _on_motion(self, sample: PhoneImu, motion: Motion, now: float) -> None:
        self._motion.append((sample.t, now))
        self._rates.append(sample.omega_m_cf_in_c)
        self._forces.append(sample.a_m_cf_in_c)
        self._sensors.add_imu(sample.t, motion)
        self._tones.add(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)

    def _on_detection(self, frame: EncodedFrame, detection: Detection | None) -> None:
        self._pictures.append((frame.t, frame.t_received))
        self._first = self._first or frame
        self._bytes += len(frame.picture.data)
        if detection is None:
            return
        if self._looked_at == 0:  # one that leans on pictures of before the recording is not lost
            self._undecodable_first = self._frame_pipeline.undecodable
        self._looked_at += 1
        self._sensors.add_detection(detection)
        complaint = self._frame_pipeline.front_end.complaint
        if complaint and complaint not in self._complaints:
            self._complaints.append(complaint)
        if detection.pose is not None:
            self._found += 1
            spare = 2 * detection.pose.leds - POSE_UNKNOWNS
            if spare > 0:
                share = sqrt(detection.pose.leds / spare)
                self._noise.append(share * detection.pose.reprojection_px)

    def _lost_pct(self, taken: Array) -> float:
        if len(taken) < 3:
            return nan
        rhythm, lasted = float(np.median(np.diff(np.sort(taken)))), float(np.ptp(taken))
        due = max(round(lasted / rhythm) + 1, len(taken))
        broken = self._undecodable + self._frame_pipeline.undecodable - self._undecodable_first
        return 100.0 * (due - len(taken) + broken) / due

    def _at_rest(self, t: Array) -> tuple[float, float]:
        """Bias [°/s] and gravity [m/s²] of the stillest second; NaN if it never lay still."""
        if len(t) < 2:
            return nan, nan
        rates, forces = np.array(self._rates), np.array(self._forces)
        starts = np.searchsorted(t, np.arange(t[0], t[-1], STILL_S))
        found: list[tuple[float, float, float]] = []
        for i, j in pairwise((*starts.tolist(), len(t))):
            if j - i < 5 or t[j - 1] - t[i] < 0.8 * STILL_S:
                continue
            mean, spread = rates[i:j].mean(axis=0), rates[i:j].std(axis=0)
            if _norm(mean) < STILL_RAD_S and _norm(spread) < STEADY_RAD_S:
                bias = float(np.rad2deg(_norm(mean)))
                found.append((_norm(spread), bias, _norm(forces[i:j].mean(axis=0))))
        return min(found)[1:] if found else (nan, nan)


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _rate(t: Array) -> float:
    return (len(t) - 1) / float(t[-1] - t[0]) if len(t) > 1 and t[-1] > t[0] else nan


def _quantiles_ms(seconds: Array) -> tuple[float, float, float]:
    if len(seconds) == 0:
        return nan, nan, nan
    p50, p95, p99 = (1e3 * np.percentile(seconds, (50.0, 95.0, 99.0))).tolist()
    return p50, p95, p99


def _slower_pct(taken: Array) -> float:
    if len(taken) < 2 or taken[-1] - taken[0] < LONG_S:
        return nan
    begin = _rate(taken[taken < taken[0] + ENDS_S])
    end = _rate(taken[taken > taken[-1] - ENDS_S])
    return 100.0 * (1.0 - end / begin)
