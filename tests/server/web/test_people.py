"""Who is connected, who leads, and what shutting out means, over real sockets."""

from __future__ import annotations

import asyncio
import contextlib
import json

import pytest
from mcap.reader import make_reader
from msgspec.structs import replace
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from pipeline.signals import Mode
from server.common.clock import now
from server.protocol.messages import decode_from_server
from server.protocol.people_messages import Deed
from server.recording.writer import SERVER_MESSAGES
from server.security.audit import AUDIT_FILE
from server.security.pairings import WAIT_S, PairingError
from server.security.security import Doors, cookie_name
from server.security.sockets import REVOKED
from server.web.status import build
from tests.server.house import (
    DEADLINE_S,
    HOST,
    Talker,
    control_status,
    eventually,
    house_in,
    is_request,
)

COMMANDS = ("arm", "disarm", "reset", "stop")


@pytest.fixture
def house(tmp_path):
    with house_in(tmp_path) as made:
        yield made


def play(house, scene):
    async def run():
        async with house.open():
            await scene()

    asyncio.run(run())


class Browser:
    """Somebody who has paired."""

    def __init__(self, house, role, name):
        doors = house.doors
        key = doors.pairings.invite(role, now())
        self.member, cookie = doors.pairings.pair(key, name, HOST, now())
        if self.member.state == "waiting":
            self.member = doors.pairings.confirm(self.member.id, self.member.code)
        self.house, self.value = house, cookie

    @contextlib.asynccontextmanager
    async def page(self, path):
        base = f"http://{HOST}:{self.house.port}"
        name = cookie_name(False, f"{HOST}:{self.house.port}")
        headers = {"Cookie": f"{name}={self.value}", "Origin": base}
        url = base.replace("http", "ws") + path
        async with connect(url, additional_headers=headers, compression=None, proxy=None) as one:
            yield Talker(one)

    @contextlib.asynccontextmanager
    async def leading(self, device="phone"):
        async with self.page("/ws/phone") as page:
            assert (await page.hello("operator", device=device))["type"] == "welcome"
            yield page

    @contextlib.asynccontextmanager
    async def watching(self):
        async with self.page("/ws/supervisor") as page:
            assert (await page.hello("supervisor"))["type"] == "welcome"
            yield page


def in_mode(house, mode):
    house.manager.status = control_status(mode=int(mode))


def give(house, to, by):
    house.manager.handover.give(to, by, now())


def people(house):
    return {one.name: one for one in house.manager.people.present()}


def test_everybody_is_listed_with_role_and_whether_he_leads(house):
    async def scene():
        anna, vera = Browser(house, "operator", "Anna"), Browser(house, "viewer", "Vera")
        async with anna.leading(), vera.watching() as watcher, house.supervisor():
            status = await watcher.until("status", phones=1, supervisors=2)
            told = {one["name"]: one for one in status["people"]}
            assert set(told) == {"Anna", "Vera", "local program (supervisor)"}
            assert {name: one["leads"] for name, one in told.items() if one["leads"]} == {
                "Anna": True
            }
            assert all(one["connected"] for one in told.values())
        await eventually(lambda: not any(one.connected for one in people(house).values()))
        assert set(people(house)) == {"Anna", "Vera"}

    play(house, scene)


@pytest.mark.parametrize("role", ["viewer", "operator"])
def test_on_the_supervisors_page_others_may_stop_and_nothing_else(house, role):
    async def scene():
        async with Browser(house, role, "Vera").watching() as page:
            for what in COMMANDS:
                await page.say(type="command", what=what)
                if what != "stop":
                    assert (await page.until("refused"))["code"] == "role"
            await page.say(type="tune", cutoff_hz=1.0)
            assert (await page.until("refused"))["code"] == "role"
            await page.say(type="path", wish="JPEG", by="supervisor")
            assert (await page.until("refused"))["code"] == "role"
            heard = await house.control_hears(is_request("stop"))
            assert [one.what for one in heard if hasattr(one, "what")] == ["stop"]

    play(house, scene)


@pytest.mark.parametrize("role", ["viewer", "operator", "supervisor"])
def test_whoever_is_shut_out_loses_every_socket_at_once_and_gets_no_other(house, role):
    async def scene():
        browser = Browser(house, role, "Vera")
        sup = house.manager.people.named("local-supervisor")
        async with browser.watching() as one, browser.watching() as other:
            await house.manager.handover.shut_out(browser.member.id, "lost", sup)
            for page in (one, other):
                await asyncio.wait_for(page.socket.wait_closed(), DEADLINE_S)
                assert page.socket.close_code == REVOKED
        with pytest.raises(InvalidStatus, match="401"):
            async with browser.watching():
                pass

    play(house, scene)


def test_what_a_socket_still_says_after_its_end_is_heard_by_nobody(house):
    async def scene():
        browser = Browser(house, "viewer", "Vera")
        async with browser.watching() as page:
            sup = house.manager.people.named("local-supervisor")
            ended = asyncio.create_task(
                house.manager.handover.shut_out(browser.member.id, "lost", sup)
            )
            await page.say(type="command", what="stop")
            await ended
            await eventually(lambda: not house.doors.sockets.ids())
        assert not any(map(is_request("stop"), house.control.inputs()))

    play(house, scene)


@pytest.mark.parametrize("mode", [Mode.TRACK, Mode.DISARMED])
def test_a_leader_who_is_shut_out_is_disarmed_and_leads_no_more(house, mode):
    async def scene():
        anna = Browser(house, "operator", "Anna")
        async with anna.leading():
            house.control.inputs()
            in_mode(house, mode)
            sup = house.manager.people.named("local-supervisor")
            await house.manager.handover.shut_out(anna.member.id, "stolen", sup)
            assert house.manager.phone is None
            assert house.manager.people.lease.holder == ""
            await house.control_hears(is_request("disarm"))

    play(house, scene)


def test_a_full_disk_keeps_nobody_in_who_was_shut_out_and_ends_no_server(house, tmp_path, caplog):
    async def scene():
        anna, gone = Browser(house, "operator", "Anna"), Browser(house, "viewer", "Gone")
        house.doors._store = tmp_path / "nowhere" / "members"
        house.doors.pairings.book.members[gone.member.id] = replace(gone.member, state="waiting")
        async with anna.leading() as page:
            house.control.inputs()
            in_mode(house, Mode.TRACK)
            sup = house.manager.people.named("local-supervisor")
            await house.manager.handover.shut_out(anna.member.id, "stolen", sup)
            assert await page.closed() == REVOKED
            await house.control_hears(is_request("disarm"))
        assert any("The disk takes nothing" in event.text for event in house.manager.events)
        assert any("The disk takes nothing" in text for text in build(house.manager).warnings)
        house.doors.clock = lambda: now() + WAIT_S
        await house.manager.handover.expire()
        assert not people(house)

    play(house, scene)
    assert "can't be written down" in caplog.text


def test_a_revocation_that_could_not_be_written_down_is_written_once_the_disk_takes_it(
    house, tmp_path
):
    async def scene():
        anna = Browser(house, "operator", "Anna")
        store = house.doors._store = tmp_path / "nowhere" / "members"
        sup = house.manager.people.named("local-supervisor")
        await house.manager.handover.shut_out(anna.member.id, "stolen", sup)
        store.parent.mkdir()
        await eventually(store.exists)
        assert Doors(store=store).pairings.book.members[anna.member.id].state == "revoked"
        await eventually(lambda: "written down again" in house.manager.events[0].text)
        assert not build(house.manager).warnings

    play(house, scene)


def test_on_the_ground_the_lead_is_handed_on_at_once_and_the_robot_disarmed(house):
    async def scene():
        anna, bert = (Browser(house, "operator", name) for name in ("Anna", "Bert"))
        async with anna.leading() as hers:
            house.control.inputs()
            in_mode(house, Mode.ARMED)
            give(house, bert.member.id, anna.member)
            assert house.manager.phone is None
            await house.control_hears(is_request("disarm"))
            async with bert.leading("other"):
                assert people(house)["Bert"].leads
                await hers.say(type="command", what="arm")
                assert (await hers.until("refused", fatal=True))["code"] == "role"
        assert not any(map(is_request("arm"), house.control.inputs()))

    play(house, scene)


def test_a_lead_is_kept_no_longer_when_giver_or_heir_says_so_and_nobody_else(house):
    async def scene():
        anna, bert, cleo = (Browser(house, "operator", n) for n in ("Anna", "Bert", "Cleo"))
        keep = house.manager.handover.keep
        for by in (anna, bert):
            async with anna.leading():
                in_mode(house, Mode.DISARMED)
                give(house, bert.member.id, anna.member)
            assert [name for name, one in people(house).items() if one.offered] == ["Bert"]
            with pytest.raises(PairingError, match="who gave it"):
                keep(bert.member.id, cleo.member, now())
            with pytest.raises(PairingError, match="kept for"):
                keep(cleo.member.id, anna.member, now())
            keep(bert.member.id, by.member, now())
            assert not any(one.offered for one in people(house).values())
            async with anna.leading():
                assert people(house)["Anna"].leads
            await eventually(lambda: house.manager.phone is None)

    play(house, scene)


def test_a_lead_that_was_given_is_not_snatched_by_a_third(house):
    async def scene():
        anna, bert, cleo = (Browser(house, "operator", n) for n in ("Anna", "Bert", "Cleo"))
        async with anna.leading():
            in_mode(house, Mode.DISARMED)
            give(house, bert.member.id, anna.member)
            async with cleo.page("/ws/phone") as page:
                assert (await page.hello("operator", device="third"))["code"] == "role"
            async with bert.leading():
                assert people(house)["Bert"].leads

    play(house, scene)


@pytest.mark.parametrize("mode", [Mode.TRACK, Mode.HOLD, Mode.RAMP])
def test_in_flight_the_leader_gives_nothing_away_and_a_supervisor_brings_the_robot_down_first(
    house, mode
):
    async def scene():
        anna, bert = (Browser(house, "operator", name) for name in ("Anna", "Bert"))
        async with anna.leading():
            house.control.inputs()
            in_mode(house, mode)
            with pytest.raises(PairingError, match="disarm it first"):
                give(house, bert.member.id, anna.member)
            assert not any(map(is_request("disarm"), house.control.inputs()))
            phone = house.manager.phone
            give(house, bert.member.id, house.manager.people.named("local-supervisor"))
            assert any(map(is_request("disarm"), house.control.inputs()))
            house.manager._tick()
            assert house.manager.phone is phone, "it leads until the robot is down"
            in_mode(house, Mode.DISARMED)
            house.manager._tick()
            assert house.manager.phone is None
            async with bert.leading():
                pass

    play(house, scene)


@pytest.mark.parametrize("mode", [Mode.TRACK, Mode.HOLD, Mode.COAST, Mode.RAMP])
def test_a_robot_left_in_flight_comes_down_before_somebody_else_leads(house, mode):
    async def scene():
        anna, bert = (Browser(house, "operator", name) for name in ("Anna", "Bert"))
        in_mode(house, mode)
        async with anna.leading():
            pass
        await eventually(lambda: house.manager.phone is None)
        house.control.inputs()
        async with bert.page("/ws/phone") as page:
            assert (await page.hello("operator", device="other"))["code"] == "role"
        await house.control_hears(is_request("disarm"))
        async with anna.leading():
            pass
        await eventually(lambda: house.manager.phone is None)
        in_mode(house, Mode.DISARMED)
        async with bert.leading():
            assert people(house)["Bert"].leads

    play(house, scene)


def test_a_new_lead_disarms_also_when_control_could_take_nothing_at_first(house, monkeypatch):
    async def scene():
        anna, heard = Browser(house, "operator", "Anna"), []
        in_mode(house, Mode.DISARMED)
        send = house.manager._control.send

        def full_at_first(message):
            if is_request("disarm")(message):
                heard.append(message)
                return len(heard) > 3 and send(message)
            return send(message)

        monkeypatch.setattr(house.manager._control, "send", full_at_first)
        async with anna.leading():
            await house.control_hears(is_request("disarm"))

    play(house, scene)


def test_nobody_gives_away_what_he_has_not_or_to_whom_he_may_not(house):
    async def scene():
        anna, bert = (Browser(house, "operator", name) for name in ("Anna", "Bert"))
        vera = Browser(house, "viewer", "Vera")
        in_mode(house, Mode.DISARMED)
        async with anna.leading():
            sup = house.manager.people.named("local-supervisor")
            for to, by in (
                (bert.member.id, bert.member),
                (bert.member.id, vera.member),
                (vera.member.id, anna.member),
                (vera.member.id, sup),
                (anna.member.id, sup),
                ("nobody", sup),
            ):
                with pytest.raises(PairingError):
                    give(house, to, by)
            assert people(house)["Anna"].leads

    play(house, scene)


def test_what_somebody_tried_without_the_right_is_written_down_with_his_name(house, tmp_path):
    async def scene():
        async with Browser(house, "viewer", "Vera").watching() as page:
            await page.say(type="command", what="arm")
            await page.until("refused")

    play(house, scene)
    house.doors.audit.close()
    logged = [json.loads(line) for line in (tmp_path / AUDIT_FILE).read_text().splitlines()]
    (refused,) = [one for one in logged if one["what"] == "refusal"]
    assert (refused["who"], refused["role"], refused["address"]) == ("Vera", "viewer", HOST)
    assert "supervisor" in refused["why"]


def test_arming_that_can_not_be_granted_is_written_down_with_what_lacks(house, tmp_path):
    async def scene():
        async with Browser(house, "operator", "Anna").leading() as page:
            house.manager.status = control_status(refusals=["The robot is not seen."])
            await page.say(type="command", what="arm")
            await house.control_hears(is_request("arm"))

    play(house, scene)
    house.doors.audit.close()
    logged = [json.loads(line) for line in (tmp_path / AUDIT_FILE).read_text().splitlines()]
    (armed,) = [one for one in logged if one["what"] == "arm"]
    assert armed["why"] == "refused: The robot is not seen."


def test_deeds_are_in_the_audit_log_and_in_the_running_recording(house, tmp_path):
    async def scene():
        house.manager.start_recording()
        anna = Browser(house, "operator", "An\u202ena\n")
        async with anna.leading() as page:
            for what in ("arm", "stop"):
                await page.say(type="command", what=what)
            await house.control_hears(is_request("stop"))
            sup = house.manager.people.named("local-supervisor")
            await house.manager.handover.shut_out(anna.member.id, "left", sup)

    play(house, scene)
    house.doors.audit.close()
    logged = [json.loads(line) for line in (tmp_path / AUDIT_FILE).read_text().splitlines()]
    deeds = [(one["what"], one["who"]) for one in logged if one["what"] in (*COMMANDS, "lead")]
    assert deeds == [(what, "An·na·") for what in ("lead", "arm", "stop")]
    assert {"what": "revoke", "role": "supervisor"}.items() <= logged[-2].items()
    (file,) = (tmp_path / "recordings").glob("*.mcap")
    with file.open("rb") as stream:
        said = make_reader(stream).iter_messages(topics=[SERVER_MESSAGES])
        kept = [decode_from_server(message.data) for _, _, message in said]
    recorded = [(one.what, one.who, one.t_s) for one in kept if isinstance(one, Deed)]
    assert recorded == [(one["what"], one["who"], one["t_s"]) for one in logged]
