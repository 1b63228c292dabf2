"""What those may ask whom the doors know: pools, without a socket and behind the real guard."""

from __future__ import annotations

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.testclient import TestClient, WebSocketDenialResponse

from server.common.clock import now
from server.security.quotas import COSTS, MAX_POOLS, QUOTAS, Asker, Quota, Quotas
from tests.server.live_server import LiveServer

BASE, WS = "http://127.0.0.1:8080", "ws://127.0.0.1:8080"
OWN = {"Origin": BASE, "X-Lightleash": "1"}
ANNA, BERT = Asker("member", "anna"), Asker("member", "bert")
ALL = [ANNA, BERT, *(Asker(kind, "x") for kind in QUOTAS)]
FEW = dict.fromkeys(QUOTAS, Quota(1e-6, 6.0, 2, 2))
"""So slow that a test never sees a pool fill."""


@given(
    st.lists(
        st.tuples(st.sampled_from(ALL), st.sampled_from(["/", *COSTS]), st.floats(0.0, 3.0)),
        max_size=200,
    )
)
def test_nobody_gets_more_than_his_rate_and_what_may_come_at_once(asked):
    quotas, t, cost = Quotas(), 0.0, dict.fromkeys(ALL, 0.0)
    for asker, path, wait in asked:
        t += wait
        if not quotas.may_ask(asker, path, t):
            cost[asker] += COSTS.get(path, 1.0)
    for asker, taken in cost.items():
        quota = QUOTAS[asker.kind]
        assert taken <= quota.at_once + quota.hz * t + 1e-6


@pytest.mark.parametrize("flooder", ALL)
def test_a_flood_of_one_takes_nothing_from_any_other(flooder):
    quotas = Quotas()
    while not quotas.may_ask(flooder, "/", 0.0):
        pass
    others = [asker for asker in ALL if asker != flooder]
    for asker in others:
        at_once = int(QUOTAS[asker.kind].at_once)
        assert not any(quotas.may_ask(asker, "/", 0.0) for _ in range(at_once))


@pytest.mark.parametrize("path", ["/api/link", "/api/check", "/metrics"])
def test_what_computes_for_tens_of_milliseconds_may_not_be_asked_for_without_a_pause(path):
    quotas = Quotas()
    asked = 0
    while not quotas.may_ask(ANNA, path, 0.0):
        asked += 1
    assert asked <= 20
    assert quotas.may_ask(ANNA, path, 0.4)


def test_who_waits_may_ask_again():
    quotas = Quotas()
    while not quotas.may_ask(ANNA, "/", 0.0):
        pass
    assert "50 a second" in quotas.may_ask(ANNA, "/", 0.0)
    assert not quotas.may_ask(ANNA, "/", 0.02)
    assert quotas.may_ask(ANNA, "/", 0.02)


@pytest.mark.parametrize("is_socket", [True, False])
def test_what_is_open_is_bounded_and_given_back_however_it_ends(is_socket):
    quotas = Quotas()
    quota = QUOTAS["member"]
    limit = quota.sockets if is_socket else quota.under_way
    for _ in range(3):
        with contextlib.suppress(ZeroDivisionError), contextlib.ExitStack() as held:
            said = [held.enter_context(quotas.place(ANNA, is_socket)) for _ in range(limit + 1)]
            assert said[:-1] == [""] * limit
            assert said[-1].startswith(f"{limit} ")
            with quotas.place(BERT, is_socket) as other:
                assert other == ""
            raise ZeroDivisionError
    assert not quotas._under_way


def test_what_is_remembered_is_bounded():
    quotas = Quotas()
    for n in range(3 * MAX_POOLS):
        quotas.may_ask(Asker("address", str(n)), "/", 0.0)
    assert len(quotas._buckets) == MAX_POOLS


@pytest.fixture
def rig(tmp_path):
    server = LiveServer(tmp_path, Quotas(FEW))
    yield server
    server.close()


def client_at(rig, address="127.0.0.1", **headers):
    return TestClient(
        rig.guard, base_url=BASE, client=(address, 50_000), headers={**OWN, **headers}
    )


def member_at(rig, address, role="viewer"):
    """A browser that is in."""
    key = rig.doors.pairings.invite(role, now())
    client = client_at(rig, address)
    assert client.post("/api/pair", json={"token": key}).status_code == 200
    return client


def key_of(rig, role):
    return {"Authorization": f"Bearer {rig.token(role)}"}


def exhaust(client):
    """Ask until it is refused; the refusal."""
    for _ in range(20):
        answer = client.get("/healthz")
        if answer.status_code == 429:
            return answer
    raise AssertionError("never refused")


def test_a_member_who_floods_is_told_why_and_stops_the_robot_all_the_same(rig):
    client = member_at(rig, "192.0.2.1")
    refused = exhaust(client)
    assert refused.status_code == 429
    told = refused.json()
    assert (told["code"], told["field"]) == ("refused", "requests")
    assert "a second" in told["allowed"]
    assert [client.post("/api/stop").status_code for _ in range(50)] == [202] * 50
    assert client.get("/healthz").status_code == 429


def test_members_of_one_address_have_pools_of_their_own_and_so_has_this_machine(rig):
    first, second = member_at(rig, "127.0.0.1"), member_at(rig, "127.0.0.1")
    assert exhaust(first).status_code == 429
    assert second.get("/healthz").status_code != 429
    assert exhaust(client_at(rig, "127.0.0.1")).status_code == 429  # without a role
    assert exhaust(client_at(rig, "127.0.0.1", **key_of(rig, "operator"))).status_code == 429
    local = client_at(rig, "127.0.0.1", **key_of(rig, "supervisor"))
    assert local.get("/api/status").status_code == 200
    assert second.get("/healthz").status_code != 429


def test_a_known_address_without_a_role_is_bounded_and_takes_nothing_from_its_member(rig):
    member = member_at(rig, "192.0.2.1")
    assert member.get("/healthz").status_code != 429
    assert exhaust(client_at(rig, "192.0.2.1")).status_code == 429
    assert member.get("/healthz").status_code != 429


def test_websockets_of_a_member_are_bounded_and_one_that_closes_makes_room(rig):
    local = client_at(rig, "127.0.0.1", **key_of(rig, "supervisor"))

    def socket():
        return local.websocket_connect(WS + "/ws/supervisor")

    with socket():
        with socket():
            with pytest.raises(WebSocketDenialResponse) as refused, socket():
                pass
            assert refused.value.status_code == 429
            assert "open websockets" in json.loads(refused.value.content)["allowed"]
            assert local.post("/api/stop").status_code == 202
        with socket():
            pass
