"""A phone and a server in two networks: what each path makes of a bad line, side by side."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite

import pytest

from hardware.sim.network.emulated_link import EmulatedLink
from hardware.sim.network.netns import NamespaceError
from server.experiments.network.command import row_of
from server.experiments.network.run import NetworkTestbed
from server.experiments.network.scenarios import SCENARIOS

pytestmark = [pytest.mark.e2e, pytest.mark.page]
SECONDS, MANY_SECONDS = 6.0, 15.0
"""Of a run, and of one whose lost pictures are counted: a key frame that is lost costs many."""


@pytest.fixture(scope="module")
def rig() -> Iterator[NetworkTestbed]:
    try:
        link = EmulatedLink()
    except NamespaceError as error:
        pytest.skip(f"NO LINK EMULATOR, not tested: {error}")
    with link:
        rig = NetworkTestbed(link)
        try:
            yield rig
        finally:
            rig.close()


def test_with_15_percent_lost_webrtc_keeps_the_operator_younger_and_more_pictures(
    rig: NetworkTestbed,
) -> None:
    line = SCENARIOS["loss15"]
    runs = {path: rig.run(line, path, MANY_SECONDS, seed=1) for path in ("webrtc", "websocket")}
    rows = {path: row_of(line, path, run) for path, run in runs.items()}
    webrtc, websocket = rows["webrtc"], rows["websocket"]
    assert all(count.lost > 50 for run in runs.values() for count in run.counts)
    assert "WebRTC" in webrtc.video_path
    assert "websocket" in websocket.video_path
    assert webrtc.undecodable == websocket.undecodable == 0
    assert webrtc.operator_p999_ms < websocket.operator_p999_ms
    assert webrtc.drops_pct < websocket.drops_pct


def test_damage_and_a_blackout_cost_pictures_but_neither_the_connection_nor_a_wrong_one(
    rig: NetworkTestbed,
) -> None:
    dark = SCENARIOS["blackout"]
    line = replace(dark, line=replace(dark.line, corrupt=0.02))
    run = rig.run(line, "webrtc", SECONDS, seed=2)
    row = row_of(line, "webrtc", run)
    assert row.ended == ""
    assert row.undecodable == 0
    assert all(count.corrupted > 5 and count.dark_lost > 10 for count in run.counts)
    assert isfinite(row.recovery_s)
    assert row.drops_pct < 60.0
