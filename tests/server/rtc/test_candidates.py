"""The server knocks at this network and at whoever answered, at nobody else."""

from __future__ import annotations

from ipaddress import ip_address

import pytest
from aioice import Candidate, ice
from hypothesis import given
from hypothesis import strategies as st

from server.rtc import candidates
from server.rtc.candidates import is_private, reachable

OWN = ["192.168.1.5", "203.0.113.8", "127.0.0.1", "::1"]
PHONE, AWAY = "192.168.1.7", "198.51.100.9"
NAME = "0" * 36 + ".local"
LINE = "a=candidate:1 1 udp 2130706431 {} 5000 typ {}"


def kept(*hosts, source=PHONE, kind="host", with_relay=False):
    lines = [LINE.format(host, kind) for host in hosts]
    sdp = "\r\n".join(["v=0", *lines, "a=setup:active"]) + "\r\n"
    left = reachable(sdp, source, OWN, with_relay)
    assert left.startswith("v=0\r\n")
    assert left.endswith("a=setup:active\r\n")
    return [line.split(" ")[4] for line in left.splitlines() if line.startswith("a=candidate")]


def test_private_addresses_names_of_this_network_and_the_source_stay():
    hosts = ["10.1.2.3", "172.31.0.1", PHONE, "169.254.1.1", "100.64.0.1", "fd00::1", "fe80::1"]
    assert kept(*hosts, NAME) == [*hosts, NAME]
    assert kept(AWAY, PHONE, source=AWAY) == [AWAY, PHONE]
    assert kept(AWAY, source=f"::ffff:{AWAY}") == [AWAY]


@given(st.ip_addresses())
def test_no_public_address_stays_but_that_of_the_answer(address):
    host = str(address)
    wanted = [host] if is_private(host) and host not in OWN else []
    assert kept(host) == wanted
    assert kept(host, source=host) == [host]


@pytest.mark.parametrize("host", [AWAY, "8.8.8.8", "2001:db8::1", "192.169.0.1", "172.32.0.1"])
def test_others_are_not_knocked_at(host):
    assert kept(host) == []
    assert kept(host, kind="srflx") == []


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9", "::1", "192.168.1.5", "203.0.113.8"])
def test_a_phone_does_not_make_the_server_knock_at_itself(host):
    assert kept(host) == []


def test_a_page_on_this_machine_may_name_this_machine():
    assert kept("192.168.1.5", "127.0.0.1", source="127.0.0.1") == ["192.168.1.5", "127.0.0.1"]
    assert kept("192.168.1.5", source="203.0.113.8") == ["192.168.1.5"]
    assert kept("127.0.0.9", source="127.0.0.1") == []


def test_a_relay_stays_where_the_server_was_told_of_one():
    assert kept(AWAY, kind="relay", with_relay=True) == [AWAY]
    assert kept(AWAY, kind="relay") == []
    assert kept(AWAY, kind="host", with_relay=True) == []


@pytest.mark.parametrize("host", ["8.8.8.8", "127.0.0.1", "224.0.0.1", "nonsense"])
def test_a_name_that_somebody_says_stands_for_a_public_address_is_not_believed(host):
    candidate = Candidate("1", 1, "udp", 1, NAME, 5000, "host")
    with pytest.raises(ValueError, match=r"\.local is"):
        ice.validate_remote_candidate(candidate, host)
    assert ice.validate_remote_candidate(candidate, PHONE) == PHONE


def test_private_ranges_are_private_for_the_library_too():
    assert all(net[1].is_private or net[1] in SHARED for net in candidates.PRIVATE)


SHARED = [ip_address("100.64.0.1")]
