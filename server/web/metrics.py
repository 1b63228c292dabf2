"""Prometheus: what a supervisor sees, as numbers for machines."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import radians
from typing import get_args

from prometheus_client import CollectorRegistry, Gauge, generate_latest
from prometheus_client.core import CounterMetricFamily, Metric
from prometheus_client.registry import Collector

from pipeline.signals import Mode
from server.control.robot_health import BatteryLevel
from server.media.decoding import Decoding
from server.protocol.messages import Estimate, Status
from server.recording.control import Recordings
from server.web.session_manager import SessionManager
from server.web.status import build


def exposition(manager: SessionManager) -> bytes:
    """What was counted so far, and the present status, in Prometheus' text format."""
    registry, status = CollectorRegistry(), build(manager)
    mode = Gauge("lightleash_mode", "1 for the present mode", ["mode"], registry=registry)
    for name in (*Mode.__members__, "LOST"):
        mode.labels(name).set(name == status.mode)
    age = Gauge(
        "lightleash_stream_age_seconds", "of the newest item", ["stream"], registry=registry
    )
    rate = Gauge("lightleash_stream_rate_hertz", "items a second", ["stream"], registry=registry)
    registry.register(_Totals(status, manager.decoding))
    for name, stream in status.streams.items():
        if stream.age_ms is not None:
            age.labels(name).set(1e-3 * stream.age_ms)
        rate.labels(name).set(stream.rate_hz)
    control = Gauge(
        "lightleash_control", "lateness [ms] and missed ticks", ["figure"], registry=registry
    )
    for name, value in status.control.items():
        control.labels(name).set(value)
    pauses = Gauge(
        "lightleash_server", "longest pauses [ms], full collections", ["figure"], registry=registry
    )
    for name, value in status.server.items():
        pauses.labels(name).set(value)
    _recordings(manager.recordings, registry)
    battery = Gauge(
        "lightleash_robot_battery", "1 for what is known of it", ["level"], registry=registry
    )
    for level in get_args(BatteryLevel):
        battery.labels(level).set(level == status.battery)
    if status.battery_v is not None:
        volts = Gauge("lightleash_robot_battery_volts", "as the robot tells", registry=registry)
        volts.set(status.battery_v)
    if status.e_stop in ("pressed", "released"):
        stop = Gauge("lightleash_robot_e_stop_pressed", "1: it is", registry=registry)
        stop.set(status.e_stop == "pressed")
    if status.error_mm is not None:
        error = Gauge("lightleash_error_metres", "from the reference", registry=registry)
        error.set(1e-3 * status.error_mm)
    if status.estimate is not None:
        _estimate(status.estimate, status, registry)
    return generate_latest(manager.tally.registry) + generate_latest(registry)


def _recordings(recordings: Recordings, registry: CollectorRegistry) -> None:
    """What they take, and whether there is room for another one."""
    folder = recordings.folder
    for name, words, value in (
        ("bytes", "of those that are finished", folder.taken()),
        ("disk_free_bytes", "left of the disk they lie on", folder.free_bytes()),
        ("reserve_bytes", "what they leave of it", folder.reserve_bytes),
        ("impossible", "1: nothing can be recorded; /healthz says why", bool(recordings.why_not())),
    ):
        Gauge(f"lightleash_recordings_{name}", words, registry=registry).set(value)


@dataclass(frozen=True, slots=True, eq=False)
class _Totals(Collector):
    """What others have counted since they started; control's begin again with it."""

    status: Status
    decoding: Decoding | None

    def collect(self) -> Iterable[Metric]:
        """Each as a counter."""
        dropped = CounterMetricFamily(
            "lightleash_stream_dropped", "items superseded, too old or refused", labels=["stream"]
        )
        for name, stream in self.status.streams.items():
            dropped.add_metric([name], stream.dropped)
        yield dropped
        if (estimate := self.status.estimate) is not None:
            pictures = CounterMetricFamily(
                "lightleash_estimate_pictures", "late ones are dropped ones", labels=["fate"]
            )
            for fate in ("fused", "dropped", "late"):
                pictures.add_metric([fate], getattr(estimate, fate))
            yield pictures
        if self.decoding is not None:
            undecodable = CounterMetricFamily(
                "lightleash_undecodable_pictures",
                "that their decoder refused, that ended it",
                labels=["fate"],
            )
            undecodable.add_metric(["refused"], self.decoding.refused)
            undecodable.add_metric(["ended it"], self.decoding.deaths)
            yield undecodable


def _estimate(estimate: Estimate, status: Status, registry: CollectorRegistry) -> None:
    """What the estimator says of itself; what it doesn't know is left out."""
    complains = Gauge(
        "lightleash_estimator_complains", "1: don't fly on it", ["estimator"], registry=registry
    )
    complains.labels(estimate.name).set(estimate.complaint != "")
    for name, words, value, unit in _estimate_figures(estimate, status):
        if value is not None:
            Gauge(f"lightleash_estimate_{name}", words, registry=registry).set(unit * value)
    bias = Gauge(
        "lightleash_estimate_bias", "[rad/s] or [m/s²]", ["sensor", "axis"], registry=registry
    )
    for sensor, values, unit in (
        ("body_gyroscope", estimate.bias_body_deg_s, radians(1.0)),
        ("body_accelerometer", estimate.bias_body_m_s2, 1.0),
        ("phone_gyroscope", estimate.bias_phone_deg_s, radians(1.0)),
        ("phone_accelerometer", estimate.bias_phone_m_s2, 1.0),
    ):
        for axis, value in zip("xyz", values or (), strict=False):
            bias.labels(sensor, axis).set(unit * value)


def _estimate_figures(
    estimate: Estimate, status: Status
) -> Iterable[tuple[str, str, float | None, float]]:
    """(name, words, value, its unit in SI) of each figure without labels."""
    return (
        ("nis", "innovation squared per degree of freedom; 1 is honest", estimate.nis, 1.0),
        ("age_seconds", "of the last fused picture", estimate.age_ms, 1e-3),
        ("leds_rejected", "single LEDs beyond their gate", estimate.leds_rejected, 1.0),
        ("time_offset_seconds", "of the pictures' stamps", estimate.time_offset_ms, 1e-3),
        ("time_offset_sigma_seconds", "its sigma", estimate.time_offset_sigma_ms, 1e-3),
        ("sigma_metres", "of the position", status.sigma_mm, 1e-3),
        ("sigma_radians", "of the attitude", estimate.sigma_deg, radians(1.0)),
    )
