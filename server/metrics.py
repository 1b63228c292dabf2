"""Prometheus: what a supervisor sees, as numbers for machines."""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Gauge, generate_latest

from pipeline.signals import Mode
from server.hub import Hub
from server.status import build


def exposition(hub: Hub) -> bytes:
    """The present status in Prometheus' text format."""
    registry, status = CollectorRegistry(), build(hub)
    mode = Gauge("lightleash_mode", "1 for the present mode", ["mode"], registry=registry)
    for name in (*Mode.__members__, "LOST"):
        mode.labels(name).set(name == status.mode)
    age = Gauge(
        "lightleash_stream_age_seconds", "of the newest item", ["stream"], registry=registry
    )
    rate = Gauge("lightleash_stream_rate_hertz", "items a second", ["stream"], registry=registry)
    lost = Gauge("lightleash_stream_dropped", "items dropped", ["stream"], registry=registry)
    for name, stream in status.streams.items():
        if stream.age_ms is not None:
            age.labels(name).set(1e-3 * stream.age_ms)
        rate.labels(name).set(stream.rate_hz)
        lost.labels(name).set(stream.dropped)
    latency = Gauge("lightleash_latency_seconds", "by stage", ["stage"], registry=registry)
    for name, ms in status.latency_ms.items():
        latency.labels(name).set(1e-3 * ms)
    control = Gauge(
        "lightleash_control", "lateness [ms] and missed ticks", ["figure"], registry=registry
    )
    for name, value in status.control.items():
        control.labels(name).set(value)
    if status.error_mm is not None:
        error = Gauge("lightleash_error_metres", "from the reference", registry=registry)
        error.set(1e-3 * status.error_mm)
    return generate_latest(registry)
