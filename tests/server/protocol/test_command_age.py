"""A wish that a link held back for too long is not carried out."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.protocol.command_age import OLDEST_S, age_s, refuse_old
from server.protocol.messages import Command
from server.protocol.session import MAX_FAULTS, Session
from server.protocol.wire import WireError
from tests.server.protocol.test_session import opened

SECONDS = st.floats(0.0, 1e3)


def encoded(age_ms, server_ms):
    return f'{{"type":"command","what":"stop","age_ms":{age_ms},"server_ms":{server_ms}}}'


@given(SECONDS, SECONDS, st.floats(0.0, 1e6))
def test_what_the_page_waited_and_what_the_link_held_back_count_together(waited, on_the_way, t):
    command = Command("stop", round(1e3 * waited), round(1e3 * t))
    assert age_s(command, t + on_the_way) == pytest.approx(waited + on_the_way, abs=2e-3)


@given(SECONDS, st.floats(0.0, 1e6), st.floats(0.0, 1e6))
def test_a_server_time_that_is_unknown_or_yet_to_come_makes_nothing_older(waited, t, ahead):
    age_ms = round(1e3 * waited)
    for server_ms in (None, 1 + round(1e3 * (t + ahead))):
        assert age_s(Command("stop", age_ms, server_ms), t) == 1e-3 * age_ms


def test_only_what_is_too_old_is_refused():
    young, old = Command("stop", 500, 7_000), Command("stop", 501, 7_000)
    assert refuse_old(young, 7.0 + OLDEST_S - 0.5) == young
    with pytest.raises(WireError) as refused:
        refuse_old(old, 7.0 + OLDEST_S - 0.5)
    assert (refused.value.code, refused.value.field) == ("age", "command.age_ms")


@pytest.mark.parametrize("role", ["operator", "supervisor"])
def test_a_page_whose_link_was_away_is_refused_its_old_stops_but_stays(role):
    session: Session = opened(role)
    for _ in range(2 * MAX_FAULTS):
        with pytest.raises(WireError, match="age"):
            session.receive(encoded(0, 1_000), 120.0)
    assert not session.hopeless
    assert session.receive(encoded(0, 119_900), 120.0) == Command("stop", 0, 119_900)


@pytest.mark.parametrize("age_ms", [-1, 1e9, "null", '"young"'])
def test_an_age_that_can_not_be_is_a_fault(age_ms):
    with pytest.raises(WireError) as refused:
        opened("operator").receive(encoded(age_ms, "null"), 0.0)
    assert refused.value.code == "value"
