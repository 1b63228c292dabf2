"""What a server counts over its life, for Prometheus: the present status forgets it."""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Counter, Histogram, Info, ProcessCollector

from server import __version__
from server.protocol.messages import Status

STAGES_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Bounds of the histogram of the latency, from one stage's share to all that can be flown with."""
FRESH_MS = 150.0
"""Latencies count while pictures come: a status is sent every 100."""


class Tally:
    """Counters and histograms that only grow; a fresh one begins with each server process."""

    def __init__(self) -> None:
        """Nothing counted yet."""
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        Info("lightleash_build", "what runs", registry=self.registry).info({"version": __version__})
        self._modes = Counter(
            "lightleash_mode_entered", "times, also the first", ["mode"], registry=self.registry
        )
        self._latency = Histogram(
            "lightleash_latency_seconds",
            "of pictures, by stage, sampled at 10 Hz",
            ["stage"],
            buckets=STAGES_S,
            registry=self.registry,
        )
        self._removed = Counter(
            "lightleash_recordings_removed", "the oldest, to make room", registry=self.registry
        )
        self._mode = ""

    def see(self, status: Status) -> None:
        """Count what one status tells; call it with each."""
        if status.mode != self._mode:
            self._mode = status.mode
            self._modes.labels(status.mode).inc()
        video = status.streams.get("video")
        if video is not None and video.age_ms is not None and video.age_ms <= FRESH_MS:
            for stage, ms in status.latency_ms.items():
                self._latency.labels(stage).observe(1e-3 * ms)

    def removed(self, count: int) -> None:
        """Count recordings that had to make room."""
        self._removed.inc(count)
