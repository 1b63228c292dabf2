"""Doors: tokens, cookies and tries, without a socket."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from server.security import COOKIE, PAIR_TRIES, PAIR_WINDOW_S, Doors


def test_a_server_started_anew_within_a_run_knows_its_pages_and_another_run_does_not():
    secret = b"s" * 32
    before, after, other = Doors(secret), Doors(secret), Doors()
    value = before.pair(before.operator_token)[1]
    assert after.role_of({"cookie": f"{COOKIE}={value}"}) == "operator"
    assert other.role_of({"cookie": f"{COOKIE}={value}"}) is None
    assert before.operator_token == after.operator_token
    tokens = {doors.operator_token for doors in (before, other)}
    assert len(tokens | {doors.supervisor_token for doors in (before, other)}) == 4


def test_an_operators_cookie_does_not_become_a_supervisors():
    doors = Doors()
    value = doors.pair(doors.operator_token)[1]
    promoted = value.replace("operator", "supervisor")
    assert doors.role_of({"cookie": f"{COOKIE}={promoted}"}) is None


def test_with_both_cookies_the_greater_role_counts():
    doors = Doors()
    values = [doors.pair(t)[1] for t in (doors.operator_token, doors.supervisor_token)]
    cookies = f"__Host-{COOKIE}={values[0]}; {COOKIE}={values[1]}"
    assert doors.role_of({"cookie": cookies}) == "supervisor"


@given(st.text())
def test_no_text_is_a_credential(text):
    doors = Doors(b"k" * 32)
    assert doors.role_of_token(text) is None
    assert doors.pair(text) is None
    assert doors.role_of({"cookie": f"{COOKIE}={text}", "authorization": ""}) is None
    assert doors.role_of({"authorization": f"Bearer {text}"}) is None


def test_who_has_tried_too_often_may_try_again_later_and_others_at_once():
    doors = Doors()
    assert all(doors.may_try("a", 0.1 * n) for n in range(PAIR_TRIES))
    assert not any(doors.may_try("a", 2.0 + 0.01 * n) for n in range(1000))
    assert doors.may_try("b", 2.0)
    assert doors.may_try("a", PAIR_WINDOW_S + 1.0)
