"""A recording played once, for what it shows of the phone: dates, silences, pictures, camera."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, isfinite

from pipeline.estimation.sensor_doubts import PHONES, VIBRATES
from pipeline.estimation.tones import PHONE, Tones
from pipeline.signals import PhoneImu
from pipeline.vision.detection import Detection
from server.diagnostics import camera_health
from server.diagnostics.link_log import LinkLog
from server.diagnostics.phone_check.figures import PhoneFigures
from server.diagnostics.phone_check.measure import figures
from server.diagnostics.phone_check.phone_watch import ClockFacts, PhoneFacts, PhoneWatch, look_of
from server.phone.ingest import EncodedFrame
from server.phone.sensor_check import SensorCheck
from server.protocol.wire import decode
from server.protocol.wire_records import Motion, Ping, Pong, Record
from server.recording.reader import Entry, Recording, device_of
from server.recording.writer import SERVER_RECORDS
from server.replay.offline import Offline


class RecordedPhone(Offline):
    """Plays a recording, and remembers."""

    def __init__(self, recording: Recording) -> None:
        """Read what it says of robot and camera.

        Raises:
            RecordingError: damaged, or its robot or camera can't be used.
        """
        self._link = LinkLog(recording.t_first, kept_s=inf, most=None)
        self._watch = PhoneWatch(self._link, long_s=inf, most=None)
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
        recording, pipeline = self._recording, self._frame_pipeline
        said = (*self._complaints, *self._sensors.faults(), *self._vibrations())
        facts = PhoneFacts(
            device=device_of(recording) or "unknown",
            since=recording.t_first,
            clock=ClockFacts.of(self._ingest.clock),
            axes=self._sensors.axes,
            camera=pipeline.camera,
            is_calibrated=True,
            health=camera_health.health(pipeline.front_end),
            complaints=tuple(dict.fromkeys(said)),
            glass=None,
        )
        return figures(self._watch.series(recording.t_last, inf, facts))

    def _vibrations(self) -> Iterator[str]:
        for sensor, t in zip(PHONES, self._tones.t_heard.tolist(), strict=True):
            if isfinite(t):
                yield VIBRATES.format(sensor=sensor)

    def _receive(self, entry: Entry) -> None:
        super()._receive(entry)
        if entry.topic == SERVER_RECORDS:
            record = decode(entry.data)
            if isinstance(record.body, Ping):
                self._link.asked(1e-6 * record.t_us)

    def _take(self, record: Record, now: float) -> None:
        super()._take(record, now)
        if isinstance(record.body, Pong):  # else it was refused
            self._link.came("answers", 1e-6 * record.body.server_time_us, now)

    def _on_motion(self, sample: PhoneImu, motion: Motion, now: float) -> None:
        self._link.came("motion", sample.t, now)
        self._watch.add_motion(sample)
        self._sensors.add_imu(sample.t, motion)
        self._tones.add(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)

    def _on_detection(self, frame: EncodedFrame, detection: Detection | None) -> None:
        self._link.came("pictures", frame.t, frame.t_received)
        self._watch.add_picture(frame.t, frame.t_received, frame.picture)
        self._watch.count(self._frame_pipeline.undecodable)
        if detection is None:
            return
        pipeline = self._frame_pipeline
        self._watch.add_look(look_of(detection, pipeline.camera, self.robot.leds_in_b))
        self._sensors.add_detection(detection)
        complaint = pipeline.front_end.complaint
        if complaint and complaint not in self._complaints:
            self._complaints.append(complaint)
