"""The lines of `lightleash experiments network`, and what is to be met on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hardware.sim.network.channel import CLEAN, Burst, Conditions

Fault = Literal["blackout", "stall"]
"""Nothing crosses the line; the server's process stands still."""
NEAR = Conditions(delay_s=0.004, jitter_s=0.003)
"""Of a Wi-Fi in the room, one direction: a round trip of 11 ms."""


@dataclass(frozen=True, slots=True)
class LinkGoals:
    """What the path by WebRTC shall keep to; None: nothing is asked."""

    frame_p95_ms: float | None = None
    drops_pct: float | None = None
    operator_p999_ms: float | None = None
    recovery_s: float | None = None


@dataclass(frozen=True, slots=True)
class Scenario:
    """A line, the same in both directions."""

    name: str
    description: str
    line: Conditions
    fault: Fault | None = None
    fault_s: float = 1.0
    goals: LinkGoals = LinkGoals()


SCENARIOS = {
    one.name: one
    for one in (
        Scenario("clean", "no delay, no loss", CLEAN),
        Scenario(
            "loss1",
            "1 % loss, RTT 11 ms",
            Conditions(delay_s=0.004, jitter_s=0.003, loss=0.01),
            goals=LinkGoals(frame_p95_ms=100.0, drops_pct=2.0),
        ),
        Scenario(
            "loss3",
            "3 % loss, RTT 35 ms",
            Conditions(delay_s=0.015, jitter_s=0.005, loss=0.03),
            goals=LinkGoals(frame_p95_ms=250.0),
        ),
        Scenario(
            "loss15",
            "15 % loss, RTT 11 ms",
            Conditions(delay_s=0.004, jitter_s=0.003, loss=0.15),
            goals=LinkGoals(operator_p999_ms=120.0),
        ),
        Scenario(
            "burst",
            "bursts: 11 % of the packets, in runs of 7",
            Conditions(delay_s=0.004, jitter_s=0.003, burst=Burst(0.02, 0.15, 0.9)),
        ),
        Scenario(
            "reorder",
            "5 % held back by 20 ms, 5 % twice",
            Conditions(delay_s=0.004, jitter_s=0.003, reorder=0.05, duplicate=0.05),
        ),
        Scenario(
            "corrupt",
            "a bit turned in 0.1 % of the packets",
            Conditions(delay_s=0.004, jitter_s=0.003, corrupt=0.001),
        ),
        Scenario(
            "rate",
            "2 Mbit/s, a queue of 64 KiB",
            Conditions(delay_s=0.004, jitter_s=0.003, rate_bps=2e6),
        ),
        Scenario("blackout", "nothing crosses for 1 s, every 5 s", NEAR, "blackout"),
        Scenario(
            "stall",
            "the server stands still for 1 s, every 5 s",
            NEAR,
            "stall",
            goals=LinkGoals(recovery_s=0.5),
        ),
    )
}
