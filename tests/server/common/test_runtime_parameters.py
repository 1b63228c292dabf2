"""Knobs: what is set is what stands, what is not named stays, what is out of range is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf, nan

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.config import VirtualCameraConfig
from server.common.runtime_parameters import (
    DEFAULT_KNOBS,
    FASTEST_HZ,
    SLOWEST_HZ,
    RuntimeParameters,
    Tune,
    turned,
)
from server.control.process import parse
from server.protocol.messages import decode_message
from server.protocol.wire import WireError

knobs = st.builds(
    RuntimeParameters,
    cutoff_hz=st.floats(SLOWEST_HZ, FASTEST_HZ),
    mode=st.sampled_from(["full", "selective", "off"]),
    adaptive_beta=st.floats(0.0, 10.0),
    max_speed_m_s=st.floats(0.0, 5.0),
    guard=st.booleans(),
)


@given(one=knobs)
def test_what_is_set_is_what_stands(one):
    stands = RuntimeParameters.of(one.config())
    assert stands.cutoff_hz == pytest.approx(one.cutoff_hz, abs=6e-5)
    assert msgspec.structs.replace(stands, cutoff_hz=one.cutoff_hz) == one


def test_the_defaults_are_the_pipelines():
    config = VirtualCameraConfig()
    assert (
        RuntimeParameters(0.28, config.mode, 0.0, config.max_speed_m_s, guard=True) == DEFAULT_KNOBS
    )
    assert DEFAULT_KNOBS.config().tau_1 == pytest.approx(config.tau_1, rel=1e-3)


@given(one=knobs, other=knobs)
def test_a_wish_turns_what_it_names_and_nothing_else(one, other):
    before, wanted = one.config(), msgspec.structs.asdict(other)
    assert turned(before, Tune()) == before
    for name, value in wanted.items():
        after = turned(before, Tune(**{name: value}))
        if name == "cutoff_hz":
            assert RuntimeParameters.of(after).cutoff_hz == pytest.approx(value, abs=6e-5)
            assert replace(after, tau_1=before.tau_1, tau_2=before.tau_2) == before
        else:
            assert after == replace(before, **{name: value})


@pytest.mark.parametrize("mode", ["full", "selective", "off"])
def test_a_configuration_without_bounds_stands_at_the_end_of_its_range(mode):
    unbounded = VirtualCameraConfig(tau_1=0.0, tau_2=0.0, mode=mode, max_speed_m_s=inf)
    stands = RuntimeParameters.of(unbounded)
    assert (stands.cutoff_hz, stands.max_speed_m_s) == (FASTEST_HZ, 0.0)
    assert RuntimeParameters.of(VirtualCameraConfig(tau_1=1e4)).cutoff_hz == SLOWEST_HZ


@pytest.mark.parametrize(
    ("knob", "value"),
    [("cutoff_hz", nan), ("cutoff_hz", inf), ("max_speed_m_s", -0.1), ("adaptive_beta", 11.0)],
)
def test_a_datagram_out_of_range_is_none(knob, value):
    data = msgspec.msgpack.encode(Tune(**{knob: value}))
    with pytest.raises(msgspec.ValidationError):
        msgspec.msgpack.decode(data, type=Tune)


@pytest.mark.parametrize("text", ["{", "{}", '{"cutoff_hz": 99}', "0.28"])
def test_control_does_not_start_with_knobs_it_can_not_read(text, capsys):
    with pytest.raises(SystemExit):
        parse(["--runtime", "x", "--port", "1", "--virtual-camera", text])
    assert "--virtual-camera" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("knob", "value"),
    [
        ("cutoff_hz", 0.0),
        ("cutoff_hz", 3.1),
        ("adaptive_beta", -1),
        ("max_speed_m_s", 1e9),
        ("mode", "wild"),
        ("guard", 1),
        ("tau_1", 0.5),
    ],
)
def test_a_knob_out_of_its_range_is_refused_by_name(knob, value):
    with pytest.raises(WireError) as refusal:
        decode_message(json.dumps({"type": "tune", knob: value}))
    assert refusal.value.code == "value"
    assert knob in refusal.value.field + refusal.value.allowed
