"""Places at the doors, in virtual time and without a socket."""

from __future__ import annotations

import heapq

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.security.admission import (
    KNOWN_S,
    MAX_KNOWN,
    MAX_NETWORKS,
    PACED_S,
    Admission,
    RemotePeer,
    network_of,
)
from server.security.places import OWN_HANDLES, AdmissionLimits, limits_for

LIMITS = AdmissionLimits()
DOOR = 8443
PHONE = "192.0.2.7"
FEW = AdmissionLimits(strangers=6, per_stranger=3, known=8, per_known=4, here=4)


class Street:
    """Who stands before an admission."""

    def __init__(self, limits=LIMITS):
        self.admission = Admission(limits)
        self.ended, self.ports = [], iter(range(1, 10**6))

    def come(self, host, now=0.0):
        peer = RemotePeer(host, next(self.ports), DOOR)
        return self.admission.enter(peer, lambda: self.ended.append(peer), now)

    def flood(self, hosts, each, now=0.0):
        return [self.come(host, now) for _ in range(each) for host in hosts]


def attackers(n):
    return [f"198.51.100.{i}" for i in range(n)]


@given(
    st.lists(
        st.tuples(
            st.sampled_from([*attackers(9), PHONE, "127.0.0.1", "2001:db8::1"]),
            st.floats(0.0, 5.0),
            st.booleans(),
        ),
        max_size=120,
    )
)
def test_no_order_of_comings_exceeds_the_places_and_every_place_is_given_back(comings):
    street, now, inside = Street(FEW), 0.0, []
    for host, wait, leaves in comings:
        now += wait
        place = street.come(host, now)
        inside += [place] if place else []
        admission = street.admission
        assert admission.strangers <= FEW.strangers
        assert len(admission) - admission.strangers <= FEW.known
        if leaves and inside:
            admission.leave(inside.pop(0))
    for place in inside:
        admission.leave(place)
    assert len(street.admission) == 0
    assert street.admission.strangers == 0


def test_one_stranger_gets_no_more_than_its_own_places():
    street = Street()
    assert sum(place is not None for place in street.flood(attackers(1), 50)) == LIMITS.per_stranger
    assert street.come(PHONE) is not None


def test_strangers_take_no_place_of_a_paired_phone_nor_of_this_machine():
    street = Street()
    street.admission.may_ask(RemotePeer(PHONE, 5, DOOR), True, 0.0)
    street.flood(attackers(250), 8)
    assert street.come(attackers(251)[250]) is None
    assert all(street.flood([PHONE, "127.0.0.1", "::1"], 32))


def test_phones_and_this_machine_take_no_place_of_each_other_even_when_each_shows_a_role():
    street = Street()
    phones = [f"192.0.2.{n}" for n in range(LIMITS.known // LIMITS.per_known + 1)]
    for host in phones:
        street.admission.may_ask(RemotePeer(host, 5, DOOR), True, 0.0)
    for place in filter(None, street.flood(phones, LIMITS.per_known)):
        street.admission.may_ask(place.peer, True, 0.0)
    assert street.come(phones[-1]) is None
    here = street.flood(["127.0.0.1", "::1"], LIMITS.here // 2)
    assert all(here)
    for place in here:
        street.admission.may_ask(place.peer, True, 0.0)
    assert street.come("127.0.0.1") is None
    street.admission.leave(here[0])
    assert street.come("::1") is not None


@pytest.mark.parametrize(
    ("host", "hz"),
    [(PHONE, LIMITS.per_known_connections_hz), ("127.0.0.1", LIMITS.here_connections_hz)],
)
def test_connections_of_who_is_known_are_bounded_in_time_and_each_by_itself(host, hz):
    street, other, shaken = Street(), "192.0.2.8", 0
    for known in (PHONE, other):
        street.admission.may_ask(RemotePeer(known, 5, DOOR), True, 0.0)
    for tick in range(5000):
        place = street.come(host, 0.001 * tick)
        if place is not None:
            shaken += 0.001 * tick + place.wait_s <= 5.0
            street.admission.leave(place)
    assert hz * 4.0 <= shaken <= hz * (5.0 + LIMITS.burst_s)
    assert street.come(other, 5.0) is not None


def test_who_holds_most_gives_way_so_that_a_new_phone_gets_in():
    street = Street(AdmissionLimits(strangers=12, per_stranger=4))
    assert all(street.flood(attackers(3), 4))
    assert street.come(PHONE, 9.0) is not None
    assert [peer.host for peer in street.ended] == [attackers(3)[2]]
    assert street.ended[0].port == 3  # its oldest


def test_equals_do_not_displace_each_other():
    street = Street(AdmissionLimits(strangers=4, per_stranger=4))
    assert all(street.flood(attackers(4), 1))
    assert street.come(PHONE) is None
    assert street.ended == []


def test_connections_of_strangers_are_bounded_in_time_too():
    street, shaken = Street(), 0
    for tick in range(1000):  # 10 s of connections that are closed at once
        place = street.come(attackers(1)[0], 0.01 * tick)
        if place is not None:
            shaken += 0.01 * tick + place.wait_s <= 10.0
            assert place.wait_s <= PACED_S
            street.admission.leave(place)
    assert shaken <= LIMITS.per_stranger_connections_hz * (10.0 + LIMITS.burst_s)
    many = 0
    for tick in range(1000):
        place = street.come(attackers(250)[tick % 250], 100.0 + 0.01 * tick)
        if place is not None:
            many += 0.01 * tick + place.wait_s <= 10.0
            street.admission.leave(place)
    assert many <= LIMITS.connections_hz * (10.0 + LIMITS.burst_s)


@pytest.mark.parametrize("lasts_s", [0.01, 0.1, 1.0])
def test_a_browser_that_needs_a_connection_for_each_file_gets_all_of_a_page(lasts_s):
    """Six at a time, and for each file one more, which ends as it finds the certificate unknown."""
    street, free, connections = Street(), [0.0] * 6, 128
    for _ in range(connections):
        now = heapq.heappop(free)
        place = street.come(PHONE, now)
        assert place is not None
        street.admission.leave(place)
        heapq.heappush(free, now + place.wait_s + lasts_s)
    paced_s = connections / LIMITS.per_stranger_connections_hz
    assert max(free) < paced_s + (connections / 6 + 6) * lasts_s


def test_of_one_known_address_the_oldest_without_a_role_gives_way():
    street = Street(AdmissionLimits(here=4))
    first, second, *_ = street.flood(["127.0.0.1"], 4)
    street.admission.may_ask(first.peer, True, 0.0)
    assert street.come("127.0.0.1") is not None
    assert street.ended == [second.peer]


def test_a_connection_that_showed_a_role_is_never_displaced():
    street = Street(AdmissionLimits(here=4))
    for place in street.flood(["127.0.0.1"], 4):
        street.admission.may_ask(place.peer, True, 0.0)
    assert street.come("127.0.0.1") is None
    assert street.ended == []


def test_a_stranger_that_shows_a_role_becomes_known_with_all_its_connections():
    street = Street()
    places = street.flood([PHONE], 3)
    assert street.admission.strangers == 3
    street.admission.may_ask(places[1].peer, True, 0.0)
    assert street.admission.strangers == 0
    assert [place.is_known for place in places] == [True] * 3
    assert [place.has_role for place in places] == [False, True, False]


def test_an_address_is_forgotten_after_a_while_or_at_once_when_told():
    street = Street()
    street.admission.may_ask(RemotePeer(PHONE, 5, DOOR), True, 0.0)
    assert street.admission.is_known(PHONE, KNOWN_S - 1.0)
    assert not street.admission.is_known(PHONE, KNOWN_S + 1.0)
    street.admission.may_ask(RemotePeer(PHONE, 5, DOOR), True, 0.0)
    street.admission.forget(PHONE)
    assert not street.admission.is_known(PHONE, 0.0)


def test_a_strangers_requests_are_bounded_and_its_connection_ends():
    street = Street()
    place = street.come(PHONE)
    answered = 0
    while street.admission.may_ask(place.peer, False, 0.0):
        answered += 1
    assert answered == LIMITS.per_stranger_requests_hz * LIMITS.burst_s
    assert street.ended == [place.peer]
    assert street.admission.may_ask(place.peer, False, 5.0)


def test_requests_with_a_role_and_of_known_addresses_are_not_counted():
    street = Street()
    peer = RemotePeer(PHONE, 5, DOOR)
    assert all(street.admission.may_ask(peer, n % 2 == 0, 0.0) for n in range(5000))
    assert all(
        street.admission.may_ask(RemotePeer("::1", 1, DOOR), False, 0.0) for _ in range(5000)
    )


def test_what_is_remembered_of_strangers_is_bounded():
    street = Street()
    for n in range(3 * MAX_NETWORKS):
        street.admission.may_ask(RemotePeer(f"2001:db8:{n:x}::1", 1, DOOR), False, 0.0)
    assert len(street.admission._own) == MAX_NETWORKS
    for n in range(3 * MAX_KNOWN):
        street.admission.may_ask(RemotePeer(f"10.0.0.{n}", 1, DOOR), True, 0.0)
    assert len(street.admission._known) == MAX_KNOWN


def test_the_same_address_and_port_again_replaces_the_connection_before():
    street = Street()
    ended, peer = [], RemotePeer(PHONE, 5, DOOR)
    former = street.admission.enter(peer, lambda: ended.append(1), 0.0)
    newer = street.admission.enter(peer, lambda: ended.append(2), 1.0)
    street.admission.leave(former)
    assert ended == [1]
    assert len(street.admission) == 1
    street.admission.leave(newer)
    assert len(street.admission) == 0


@pytest.mark.parametrize(
    ("host", "network"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3::4", "2001:0db8:0001:0002"),
        ("2001:db8:1:2:ffff::", "2001:0db8:0001:0002"),
        ("fe80::1%eth0", "fe80:0000:0000:0000"),
        ("testclient", "testclient"),
    ],
)
def test_a_stranger_is_an_address_or_64_bits_of_one(host, network):
    assert network_of(host) == network


@given(st.integers(16, 100_000))
def test_places_fit_in_the_file_handles_there_are(handles):
    limits = limits_for(handles)
    assert 0 < limits.per_stranger < limits.strangers
    assert 0 < limits.per_known <= limits.known
    if handles >= OWN_HANDLES + 32:
        assert limits.strangers + limits.known <= handles - OWN_HANDLES
    if handles >= 512:
        assert limits == AdmissionLimits()
