"""Metrics: numbers that Prometheus can read, the same as on the screens."""

from __future__ import annotations

import contextlib
import os
import signal

import pytest
from msgspec.structs import replace
from prometheus_client.parser import text_string_to_metric_families

from hardware.codec import DecodeError
from pipeline.signals import Mode
from server import __version__
from server.common.clock import now
from server.control.robot_health import HealthFields
from server.diagnostics.pauses import Stall
from server.diagnostics.tally import Tally
from server.media.decoding import Decoding
from server.protocol.messages import Stream
from server.recording.folder import RESERVE_BYTES, DiskLimits, RecordingFolder
from server.web.metrics import exposition
from server.web.status import build
from tests.server.house import control_status, estimate_fields, house_in


@pytest.fixture
def manager(tmp_path):
    with house_in(tmp_path) as house:
        yield house.manager


def samples(manager):
    families = text_string_to_metric_families(exposition(manager).decode())
    return {(s.name, *s.labels.values()): s.value for family in families for s in family.samples}


def tell(manager, **changes):
    manager.status = control_status(**changes)
    manager.control_meter.tick(manager.status.t)


def test_without_a_control_process_the_mode_is_lost(manager):
    found = samples(manager)
    assert found["lightleash_mode", "LOST"] == 1.0
    assert sum(value for (name, *_), value in found.items() if name == "lightleash_mode") == 1.0


@pytest.mark.parametrize("mode", Mode)
def test_exactly_one_mode_is_the_present_one(manager, mode):
    tell(manager, mode=int(mode))
    found = samples(manager)
    modes = {key[1]: value for key, value in found.items() if key[0] == "lightleash_mode"}
    assert set(modes) == {*Mode.__members__, "LOST"}
    assert [name for name, value in modes.items() if value] == [mode.name]


def test_lateness_ages_and_the_error_are_told_in_si_units(manager):
    tell(manager, error_m=0.0123, inputs_dropped=4)
    found = samples(manager)
    assert found[("lightleash_error_metres",)] == pytest.approx(0.0123)
    assert found["lightleash_control", "p999_ms"] == 0.4
    assert found["lightleash_control", "missed"] == 3.0
    assert found["lightleash_stream_rate_hertz", "body_imu"] == 200.0
    assert 0.0 < found["lightleash_stream_age_seconds", "body_imu"] < 1.0
    assert found["lightleash_stream_dropped_total", "control"] == 4.0


def test_the_battery_is_told_while_it_is_known(manager):
    for health, known in (
        (None, None),
        (HealthFields("told", 11.25), 11.25),
        (HealthFields("low", 10.4, "Low."), 10.4),
        (HealthFields("unknown"), None),
    ):
        tell(manager, health=health)
        assert samples(manager).get(("lightleash_robot_battery_volts",)) == known


def test_the_emergency_stop_is_told_while_it_is_known(manager):
    for e_stop, known in (("untold", None), ("released", 0), ("pressed", 1), ("unknown", None)):
        tell(manager, health=HealthFields(e_stop=e_stop))
        assert samples(manager).get(("lightleash_robot_e_stop_pressed",)) == known


def test_pictures_that_could_not_be_decoded_are_counted_by_what_became_of_them(manager):
    assert not any(name.startswith("lightleash_undecodable") for name, *_ in samples(manager))
    with contextlib.closing(Decoding(clock=lambda: 0.0)) as manager.decoding:
        there = manager.decoding.open("jpeg", 640, 360)
        for data in (b"no picture", b"neither"):
            with pytest.raises(DecodeError):
                there.decode(data)
        os.killpg(manager.decoding.pid, signal.SIGKILL)
        with pytest.raises(DecodeError):
            there.decode(b"never read")
        found = samples(manager)
    assert found["lightleash_undecodable_pictures_total", "refused"] == 2.0
    assert found["lightleash_undecodable_pictures_total", "ended it"] == 1.0


def test_what_a_server_saw_is_counted_and_latencies_are_kept_while_pictures_come(manager):
    shown = build(manager)
    manager.tally = Tally()
    fresh, old = Stream(30.0, 30.0), Stream(500.0, 0.0)
    for mode, video in (("TRACK", fresh), ("TRACK", fresh), ("HOLD", old), ("TRACK", fresh)):
        streams, told = {"video": video}, {"decode": 4.0}
        manager.tally.see(replace(shown, mode=mode, streams=streams, latency_ms=told))
    found = samples(manager)
    assert found["lightleash_mode_entered_total", "TRACK"] == 2.0
    assert found["lightleash_mode_entered_total", "HOLD"] == 1.0
    assert found["lightleash_latency_seconds_count", "decode"] == 3.0
    assert found["lightleash_latency_seconds_bucket", "0.002", "decode"] == 0.0
    assert found["lightleash_latency_seconds_bucket", "0.005", "decode"] == 3.0
    assert found["lightleash_build_info", __version__] == 1.0
    assert found[("process_open_fds",)] > 0.0


def test_room_for_recordings_and_the_level_of_the_battery_are_told(manager):
    tell(manager, health=HealthFields("empty", 9.9, "Empty."))
    found = samples(manager)
    assert found["lightleash_robot_battery", "empty"] == 1.0
    levels = [value for (name, *_), value in found.items() if name == "lightleash_robot_battery"]
    assert sum(levels) == 1.0
    assert found[("lightleash_recordings_disk_free_bytes",)] > 0.0
    assert found[("lightleash_recordings_reserve_bytes",)] == RESERVE_BYTES
    assert found[("lightleash_recordings_impossible",)] == 0.0
    full = DiskLimits(reserve_bytes=1 << 60)
    manager.recordings.folder = RecordingFolder(manager.recordings.folder.path, full)
    assert samples(manager)[("lightleash_recordings_impossible",)] == 1.0


def test_pauses_of_the_server_are_told(manager):
    manager.pauses.tick(armed=True, idle=False)
    manager.pauses.loop.add_stall(now() - 70.0, Stall(0.043, 0.012), armed=True)
    manager.pauses.loop.add_stall(now(), Stall(0.025, 0.001), armed=True)
    found = samples(manager)
    assert found["lightleash_server", "stall_ms"] == 25.0
    assert found["lightleash_server", "armed_stall_ms"] == 43.0
    assert found["lightleash_server", "armed_stall_cpu_ms"] == 12.0


def test_what_is_not_known_is_left_out(manager):
    tell(manager, body_imu_age=float("inf"))
    found = samples(manager)
    assert ("lightleash_error_metres",) not in found
    assert ("lightleash_stream_age_seconds", "body_imu") not in found


def test_the_estimators_telemetry_is_told_in_si_units(manager):
    tell(
        manager,
        estimate=estimate_fields(complaint="Restart the camera.", bias_omega_c=(0.0, -0.02, 0.0)),
        poses_fused=90,
        poses_dropped=4,
        time_offset=-0.012,
        sigma_p=0.003,
    )
    found = samples(manager)
    assert found["lightleash_estimator_complains", "relative"] == 1.0
    assert found[("lightleash_estimate_nis",)] == 1.25
    assert found[("lightleash_estimate_age_seconds",)] == pytest.approx(0.0871)
    assert found[("lightleash_estimate_leds_rejected",)] == 7.0
    assert found[("lightleash_estimate_time_offset_seconds",)] == pytest.approx(-0.012)
    assert found[("lightleash_estimate_sigma_metres",)] == pytest.approx(0.003)
    for fate, count in {"fused": 90.0, "dropped": 4.0, "late": 3.0}.items():
        assert found["lightleash_estimate_pictures_total", fate] == count
    told = found["lightleash_estimate_bias", "y", "phone_gyroscope"]
    assert told == pytest.approx(-0.02, abs=1e-4)


def test_of_an_estimator_that_knows_little_the_rest_is_left_out(manager):
    tell(manager, estimate=estimate_fields(name="none", nis=None, age=None, bias_a_b=None))
    found = samples(manager)
    assert found["lightleash_estimator_complains", "none"] == 0.0
    assert ("lightleash_estimate_nis",) not in found
    assert ("lightleash_estimate_age_seconds",) not in found
    assert ("lightleash_estimate_bias", "x", "body_accelerometer") not in found
