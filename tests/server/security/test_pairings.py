"""Links and members: laws over every order of events."""

from __future__ import annotations

import random
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from server.security.pairings import (
    KEY_BYTES,
    LETTERS,
    LINK_S,
    MAX_ENDED,
    MAX_LINKS,
    MAX_MEMBERS,
    WAIT_S,
    PairingError,
    Pairings,
)

ROLES = ("viewer", "operator", "supervisor")


def enter(pairings, role="viewer", name="", now=0.0):
    return pairings.pair(pairings.invite(role, now), name, "192.0.2.1", now)


def test_a_key_has_128_random_bits():
    asked = []

    def bits(count):
        asked.append(count)
        return bytes(range(count))

    Pairings(random=bits).invite("viewer", 0.0)
    assert asked == [KEY_BYTES]
    assert 8 * KEY_BYTES == 128


def test_a_link_opens_once():
    pairings = Pairings()
    key = pairings.invite("viewer", 0.0)
    pairings.pair(key, "", "", 1.0)
    with pytest.raises(PairingError, match="once"):
        pairings.pair(key, "", "", 1.0)


def test_links_of_whoever_is_revoked_open_nothing_and_those_of_others_do():
    pairings = Pairings()
    (sue, _), (tom, _) = (enter(pairings, "supervisor", name) for name in ("Sue", "Tom"))
    hers, his = (pairings.invite("operator", 0.0, by=one.id) for one in (sue, tom))
    used = pairings.invite("viewer", 0.0, by=sue.id)
    guest, _ = pairings.pair(used, "", "", 1.0)
    pairings.revoke(sue.id, "lost")
    with pytest.raises(PairingError, match="newest"):
        pairings.pair(hers, "", "", 1.0)
    with pytest.raises(PairingError, match="once"):
        pairings.pair(used, "", "", 1.0)
    assert pairings.pair(his, "", "", 1.0)
    assert guest in pairings.present()


@pytest.mark.parametrize("role", ROLES)
def test_a_link_opens_until_its_time_is_over(role):
    pairings = Pairings()
    early, late = (pairings.invite(role, 5.0) for _ in range(2))
    pairings.pair(early, "", "", 5.0 + 0.999 * LINK_S)
    with pytest.raises(PairingError, match="minutes"):
        pairings.pair(late, "", "", 5.0 + LINK_S)


@given(st.text())
def test_nothing_but_a_link_opens(text):
    pairings = Pairings()
    pairings.invite("supervisor", 0.0)
    with pytest.raises(PairingError, match="this run"):
        pairings.pair(text, "", "", 0.0)


def test_an_operator_waits_for_a_supervisor_unless_the_link_is_enough():
    states = {
        (confirm, role): enter(Pairings(confirm), role)[0].state
        for confirm in ("supervisor", "self")
        for role in ROLES
    }
    assert {key for key, state in states.items() if state == "waiting"} == {
        ("supervisor", "operator")
    }


def test_who_waits_too_long_is_turned_away_and_told():
    pairings = Pairings()
    member, cookie = enter(pairings, "operator")
    assert pairings.expire(0.999 * WAIT_S) == []
    assert [one.id for one in pairings.expire(WAIT_S)] == [member.id]
    ended = pairings.of_cookie(cookie, WAIT_S)
    assert (ended.state, ended.why) == ("expired", "Nobody confirmed it.")
    with pytest.raises(PairingError):
        pairings.confirm(member.id, member.code)


def test_codes_of_those_who_wait_differ_and_hold_four_plain_letters():
    pairings = Pairings(random=random.Random(1).randbytes)
    codes = [enter(pairings, "operator")[0].code for _ in range(MAX_MEMBERS)]
    assert len(set(codes)) == MAX_MEMBERS
    assert all(re.fullmatch(f"[{LETTERS}]{{4}}", code) for code in codes)


def test_a_code_that_is_taken_is_drawn_again():
    draws = [*[bytes(8)] * 2, b"\1" * 8]
    pairings = Pairings(random=lambda n: draws.pop(0) if n == 8 else random.randbytes(n))
    codes = [enter(pairings, "operator")[0].code for _ in range(2)]
    assert len(set(codes)) == 2
    assert draws == []


@given(st.lists(st.text(max_size=60), max_size=8))
def test_names_of_those_present_differ_are_short_and_can_be_read(names):
    pairings = Pairings()
    given_names = [enter(pairings, "viewer", name)[0].name for name in names]
    assert len(set(given_names)) == len(names)
    assert all(name.isprintable() and 0 < len(name) <= 43 for name in given_names)


def test_too_many_are_refused_and_links_take_bounded_room():
    pairings = Pairings()
    for _ in range(MAX_MEMBERS):
        enter(pairings)
    with pytest.raises(PairingError, match="at most"):
        enter(pairings)
    for _ in range(2 * MAX_LINKS):
        pairings.invite("viewer", 0.0)
    assert len(pairings.book.links) == MAX_LINKS


def test_whoever_pairs_anew_keeps_his_place_and_his_name():
    pairings = Pairings()
    first, *_ = [enter(pairings, name="Dora")[0] for _ in range(MAX_MEMBERS)]
    key = pairings.invite("viewer", 0.0)
    with pytest.raises(PairingError, match="at most"):
        pairings.pair(key, "Dora", "192.0.2.1", 0.0, "nobody")
    again, _ = pairings.pair(key, "Dora", "192.0.2.1", 0.0, first.id)
    assert (again.name, again.state) == ("Dora", "in")
    assert again.id != first.id


def test_those_who_have_ended_take_bounded_room_and_the_newest_are_remembered():
    pairings = Pairings()
    for n in range(3 * MAX_ENDED):
        member, cookie = enter(pairings, now=float(n))
        pairings.revoke(member.id, "gone")
    assert len(pairings.book.members) == MAX_ENDED
    assert pairings.of_cookie(cookie, 0.0).state == "revoked"


class Life(RuleBasedStateMachine):
    """Any order of what people do, beside what must hold."""

    def __init__(self):
        super().__init__()
        self.now = 0.0
        self.pairings = Pairings(random=random.Random(0).randbytes)
        self.links, self.cookies, self.used = {}, {}, set()
        self.confirmed, self.ended = set(), set()

    @rule(role=st.sampled_from(ROLES))
    def invite(self, role):
        self.links[self.pairings.invite(role, self.now)] = role

    @precondition(lambda self: self.links)
    @rule(data=st.data())
    def pair(self, data):
        key = data.draw(st.sampled_from(sorted(self.links)))
        try:
            member, cookie = self.pairings.pair(key, "x", "", self.now)
        except PairingError:
            return
        assert key not in self.used
        assert member.role == self.links[key]
        self.used.add(key)
        self.cookies[cookie] = member

    @precondition(lambda self: self.cookies)
    @rule(data=st.data(), deed=st.sampled_from(["confirm", "deny", "revoke"]), right=st.booleans())
    def decide(self, data, deed, right):
        cookie = data.draw(st.sampled_from(sorted(self.cookies)))
        member = self.cookies[cookie]
        try:
            if deed == "confirm":
                self.pairings.confirm(member.id, member.code if right else "")
                assert right
                self.confirmed.add(member.id)
            else:
                getattr(self.pairings, deed)(member.id, "why")
                self.ended.add(member.id)
        except PairingError:
            return

    @rule(seconds=st.sampled_from([1.0, WAIT_S, LINK_S]))
    def wait(self, seconds):
        self.now += seconds
        self.ended |= {one.id for one in self.pairings.expire(self.now)}

    @invariant()
    def nobody_is_in_who_should_not_be(self):
        for cookie, member in self.cookies.items():
            now = self.pairings.of_cookie(cookie, self.now)
            state = "forgotten" if now is None else now.state
            if member.id in self.ended:
                assert state not in ("in", "waiting")
            if state == "in" and member.role == "operator":
                assert member.id in self.confirmed
            if now is not None:
                assert now.role == member.role


TestLife = Life.TestCase
TestLife.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
