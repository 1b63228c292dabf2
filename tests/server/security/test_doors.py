"""Doors: keys, cookies and tries, without a socket."""

from __future__ import annotations

import hmac
import json
import secrets

from hypothesis import given
from hypothesis import strategies as st

from server.security.pairings import IDLE_S
from server.security.security import (
    COOKIE,
    MAX_ADDRESSES,
    PAIR_TRIES,
    PAIR_WINDOW_S,
    SAVE_AGAIN_S,
    Doors,
)


class Clock:
    """Time by hand."""

    t = 100.0

    def __call__(self):
        return self.t


def enter(doors, role="viewer"):
    """Pair; gives the headers of who is in."""
    key = doors.pairings.invite(role, doors.clock())
    member, cookie = doors.pairings.pair(key, "Anna", "192.0.2.1", doors.clock())
    doors.save()
    return member, {"cookie": f"{COOKIE}={cookie}"}


def who(doors, headers):
    return doors.who(headers, secure=False, address="192.0.2.1")


def test_a_server_started_anew_within_a_run_knows_its_pages_and_another_run_does_not(tmp_path):
    secret, store = b"s" * 32, tmp_path / "members"
    before = Doors(secret, store=store)
    member, headers = enter(before)
    after, other = Doors(secret, store=store), Doors()
    assert who(after, headers) == member
    assert who(other, headers) is None
    assert before.operator_token == after.operator_token
    keys = {doors.operator_token for doors in (before, other)}
    assert len(keys | {doors.supervisor_token for doors in (before, other)}) == 4


def test_what_was_revoked_or_used_stays_so_when_the_server_is_started_anew(tmp_path):
    secret, store = b"s" * 32, tmp_path / "members"
    before = Doors(secret, store=store)
    key = before.pairings.invite("viewer", before.clock())
    member, cookie = before.pairings.pair(key, "", "", before.clock())
    before.pairings.revoke(member.id, "gone")
    before.save()
    after = Doors(secret, store=store)
    assert who(after, {"cookie": f"{COOKIE}={cookie}"}).state == "revoked"
    assert [link.used for link in after.pairings.book.links.values()] == [True]


def test_when_the_disk_takes_nothing_a_server_started_anew_lets_nobody_in_who_was_shut_out(
    tmp_path,
):
    store = tmp_path / "members"
    doors = Doors(store=store, clock=(clock := Clock()))
    member, headers = enter(doors)
    other, _ = enter(doors)
    store.with_suffix(".part").mkdir()  # in the way of whatever is written
    doors.pairings.revoke(member.id, "stolen")
    assert not doors.save()
    assert doors.is_unsaved
    assert who(doors, headers).state == "revoked"
    assert who(Doors(store=store), headers) is None
    tries = 0
    for _ in range(100):  # ten seconds
        clock.t += 0.1
        tried = doors._t_saved
        assert not doors.save_again()
        tries += doors._t_saved != tried
    assert 9 <= tries <= 10
    store.with_suffix(".part").rmdir()
    clock.t += SAVE_AGAIN_S
    assert doors.save_again()
    assert not doors.save_again()
    after = Doors(store=store)
    assert who(after, headers).state == "revoked"
    assert [one.id for one in after.pairings.present()] == [other.id]


def test_what_is_kept_is_private_and_opens_nothing(tmp_path):
    store = tmp_path / "members"
    doors = Doors(store=store)
    key = doors.pairings.invite("supervisor", doors.clock())
    _, headers = enter(doors)
    assert store.stat().st_mode & 0o777 == 0o600
    kept = store.read_text()
    assert key not in kept
    assert headers["cookie"].partition("=")[2] not in kept
    digests = [*json.loads(kept)["links"]]
    digests += [one["digest"] for one in json.loads(kept)["members"].values()]
    assert not [d for d in digests if who(doors, {"cookie": f"{COOKIE}={d}"})]


def test_a_file_that_is_broken_lets_nobody_in_and_is_no_reason_not_to_start(tmp_path):
    store = tmp_path / "members"
    store.write_text("{")
    assert Doors(store=store).pairings.present() == []


def test_a_cookie_does_not_say_its_role_so_it_can_not_be_promoted():
    doors = Doors()
    _, headers = enter(doors, "viewer")
    assert not [role for role in ("viewer", "operator", "supervisor") if role in headers["cookie"]]


@given(st.text())
def test_no_text_is_a_credential(text):
    doors = Doors(b"k" * 32)
    assert doors.role_of_token(text) is None
    assert who(doors, {"cookie": f"{COOKIE}={text}", "authorization": ""}) is None
    assert who(doors, {"authorization": f"Bearer {text}"}) is None


def test_keys_are_compared_in_constant_time(monkeypatch):
    compared = []

    def compare(a, b):
        compared.append((a, b))
        return hmac.compare_digest(a, b)

    monkeypatch.setattr(secrets, "compare_digest", compare)
    doors = Doors(b"k" * 32)
    doors.role_of_token("guess")
    assert [b.decode() for _, b in compared] == [doors.supervisor_token, doors.operator_token]


def test_who_has_tried_too_often_may_try_again_later_and_others_at_once():
    doors = Doors(clock=(clock := Clock()))
    for _ in range(PAIR_TRIES):
        assert doors.may_try("192.0.2.1")
        doors.tried("192.0.2.1")
    clock.t += 2.0
    assert not doors.may_try("192.0.2.1")
    assert doors.may_try("192.0.2.2")
    clock.t += PAIR_WINDOW_S
    assert doors.may_try("192.0.2.1")


def test_one_machine_has_the_tries_of_one_however_many_addresses_it_takes():
    doors = Doors(clock=Clock())
    for n in range(PAIR_TRIES):
        doors.tried(f"2001:db8::{n + 1:x}")
    assert not doors.may_try("2001:db8::ffff")
    assert doors.may_try("2001:db8:0:1::1")


def test_tries_of_many_addresses_take_bounded_room_and_the_newest_are_kept():
    doors = Doors(clock=Clock())
    for n in range(2 * MAX_ADDRESSES):
        doors.tried(f"10.0.{n // 250}.{n % 250}")
    assert len(doors._tries) == MAX_ADDRESSES
    for _ in range(PAIR_TRIES):
        doors.tried("192.0.2.1")
    assert not doors.may_try("192.0.2.1")


def test_a_session_ends_when_nobody_uses_it_for_long_and_not_while_it_is_used():
    doors = Doors(clock=(clock := Clock()))
    used, headers = enter(doors)
    idle, _ = enter(doors)
    clock.t += 0.9 * IDLE_S
    assert who(doors, headers) == used
    clock.t += 0.2 * IDLE_S
    assert [one.id for one in doors.pairings.expire(clock.t)] == [idle.id]
    clock.t += IDLE_S
    assert doors.pairings.expire(clock.t, busy=[used.id]) == []


def test_a_server_started_anew_late_in_a_run_shuts_nobody_out_who_was_here(tmp_path):
    store = tmp_path / "members"
    member, _ = enter(Doors(store=store, clock=(clock := Clock())))
    clock.t += 2.0 * IDLE_S
    after = Doors(store=store, clock=clock)
    assert after.pairings.expire(clock.t) == []
    clock.t += 0.9 * IDLE_S
    assert after.pairings.expire(clock.t) == []
    clock.t += 0.2 * IDLE_S
    assert [one.id for one in after.pairings.expire(clock.t)] == [member.id]
