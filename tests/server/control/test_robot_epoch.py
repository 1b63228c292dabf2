"""Epochs grow, whatever the wall clock does and whichever of clock and file is lost."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.follower import FollowerState, Refusal, ThrustCommand
from hardware.link.control_end import ControlEnd
from hardware.link.datagram import SampleDatagram, decode_command, encode_sample
from server.control.robot_epoch import RENEWALS, next_epoch

KEY = bytes(range(16))
NOW_MS = 1_760_000_000_000


def epoch_after_renewals(epoch, times):
    """Epoch of a control process that a robot has refused so often."""
    end = ControlEnd(1, 1.0, 1.0, epoch, KEY)
    for counter in range(1, times + 1):
        command = decode_command(end.command(ThrustCommand.zero(1), 0.0), KEY)
        end.receive(encode_sample(refusing(command, counter), KEY), 0.0)
        end.command(ThrustCommand.zero(1), 0.0)
    return end.epoch


def refusing(command, counter):
    """Of a robot that has followed `command` and lost it."""
    return SampleDatagram(
        state=FollowerState.REFUSING,
        refusal=Refusal.SILENT,
        t_us=counter,
        nonce=counter,
        challenge=command.challenge,
        epoch=command.epoch,
        boot_id=1,
        counter=counter,
        accepted=command.counter,
        omega_in_b=(0.0, 0.0, 0.0),
        a_in_b=(0.0, 0.0, 0.0),
        thrusts=(0.0,),
    )


@settings(max_examples=30)
@given(st.lists(st.integers(0, 2**45), min_size=2, max_size=8))
def test_each_epoch_is_later_than_the_one_before(tmp_path_factory, times):
    file = tmp_path_factory.mktemp("epoch") / "robots" / "ames.epoch"
    epochs = [next_epoch(file, t) for t in times]
    assert epochs[0] >= 1
    assert all(b > a for a, b in pairwise(epochs))


def test_it_is_the_wall_clock_where_that_goes_on(tmp_path):
    file = tmp_path / "ames.epoch"
    times = [NOW_MS, NOW_MS + 2 * RENEWALS]
    assert [next_epoch(file, t) for t in times] == times
    file.unlink()
    assert next_epoch(file, NOW_MS) == NOW_MS


@pytest.mark.parametrize("renewals", [0, 1, 2, 9])
def test_a_process_started_after_renewals_is_later_though_the_clock_is_not(tmp_path, renewals):
    file = tmp_path / "ames.epoch"
    first = next_epoch(file, NOW_MS)
    before = epoch_after_renewals(first, renewals)
    assert before == first + renewals
    assert next_epoch(file, 0) > before


@pytest.mark.parametrize("text", [b"what?", b"-5", b"%d" % (2**63 + 1), b"9" * 9999, b"\xff", b""])
def test_a_file_that_is_spoilt_leaves_the_wall_clock(tmp_path, text):
    file = tmp_path / "ames.epoch"
    file.write_bytes(text)
    assert next_epoch(file, NOW_MS) == NOW_MS
