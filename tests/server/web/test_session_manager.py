"""Session manager: one operator at a time, wishes that arrive, events that can be read."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import msgspec
import pytest

from pipeline.prediction import Prediction
from server.common.clock import now
from server.common.runtime_parameters import Tune
from server.control.ipc_inputs import ReadyInput, RequestInput
from server.control.robot_health import HealthFields
from server.diagnostics.events import EVENTS
from server.protocol.lead_messages import AS_EVER, Lead
from server.protocol.messages import Command, Hello, encode_message
from server.protocol.wire import VERSION, decode, encode
from server.protocol.wire_records import Codec, Ping, Record
from server.security.pairings import of_this_machine
from server.web import session_manager as hub_module
from server.web.lease import LEASE_S
from tests.pipeline.seeing import CAMERA
from tests.server.house import JPEG, control_status, estimate_fields, house_in, is_request


class Paper:
    """A page that keeps what it is sent."""

    def __init__(self) -> None:
        self.data: list[str | bytes] = []

    def send(self, data: str | bytes) -> None:
        self.data.append(data)

    send_newest = send


@pytest.fixture
def house(tmp_path):
    with house_in(tmp_path) as made:
        yield made


def test_a_recording_begins_with_a_picture_that_can_be_decoded(house):
    async def scene():
        page = Paper()
        house.manager.connect_phone(hello("first"), page)
        house.manager.start_recording()
        await asyncio.sleep(0)
        house.manager.recordings.stop()
        return page.data

    assert encode_message(Command("key_frame")) in asyncio.run(scene())


def test_a_recording_that_runs_already_learns_of_the_phones_camera(house, monkeypatch):
    told: list[tuple[str, str]] = []
    monkeypatch.setattr(house.manager.recordings, "learn", lambda *phone: told.append(phone))

    def scene():
        phone = house.manager.connect_phone(hello("first"), Paper())
        phone.camera_text = "its camera"
        house.control.send(control_status())
        house.manager._receive_status()

    in_loop(scene)
    assert told == [("first", "its camera")]


def hello(device: str) -> Hello:
    return Hello(VERSION, "operator", device)


def in_loop(scene):
    async def run():
        return scene()

    return asyncio.run(run())


def test_one_phone_leads_until_it_has_been_silent(house, monkeypatch):
    def scene():
        manager = house.manager
        first = manager.connect_phone(hello("first"), Paper())
        assert manager.connect_phone(hello("second"), Paper()) is None
        assert manager.phone is first
        monkeypatch.setattr("server.web.session_manager.now", lambda: now() + LEASE_S)
        second = manager.connect_phone(hello("second"), Paper())
        assert manager.phone is second is not None
        manager.disconnect_phone(first)
        assert manager.phone is second
        manager.disconnect_phone(second)
        assert manager.phone is None

    in_loop(scene)


def test_whoever_comes_to_lead_finds_the_robot_disarmed(house):
    in_loop(lambda: house.manager.connect_phone(hello("first"), Paper()))
    assert any(map(is_request("disarm"), house.control.inputs()))


def test_pings_go_to_the_phone_that_leads_alone(house, monkeypatch):
    def scene():
        old, new = Paper(), Paper()
        house.manager.connect_phone(hello("first"), old)
        house.manager.ping()
        monkeypatch.setattr("server.web.session_manager.now", lambda: now() + LEASE_S)
        house.manager.connect_phone(hello("second"), new)
        house.manager.ping()
        (ping,) = map(decode, new.data)
        assert isinstance(ping.body, Ping)
        assert len(old.data) == 1

    in_loop(scene)


def test_only_the_session_that_leads_may_send_pictures(house):
    def scene():
        assert house.manager.join_video("", Paper()) is None
        phone = house.manager.connect_phone(hello("first"), Paper())
        assert house.manager.join_video("guess", Paper()) is None
        assert house.manager.join_video(phone.id, Paper()) is phone
        house.manager.disconnect_phone(phone)
        assert house.manager.join_video(phone.id, Paper()) is None

    in_loop(scene)


class Fast:
    """A fast path that keeps what it is told."""

    def __init__(self):
        self.data, self.keys, self.closed, self.has_video = [], 0, False, True

    def send(self, data):
        self.data.append(data)

    def request_key(self):
        self.keys += 1

    def close(self):
        self.closed = True


def test_pings_take_all_ways_that_are_open(house):
    def scene():
        page, fast = Paper(), Fast()
        phone = house.manager.connect_phone(hello("first"), page)
        assert house.manager.join_fast("guess", fast) is None
        house.manager.ping()
        assert house.manager.join_fast(phone.id, fast) is phone
        house.manager.ping()
        assert len(fast.data) == 1
        assert page.data[1:] == fast.data
        house.manager.paths.leave(fast)
        house.manager.ping()
        assert (len(fast.data), len(page.data)) == (1, 3)

    in_loop(scene)


def test_a_phone_has_one_fast_path_which_goes_with_it(house):
    def scene():
        phone = house.manager.connect_phone(hello("first"), Paper())
        former, fast = Fast(), Fast()
        house.manager.join_fast(phone.id, former)
        house.manager.join_fast(phone.id, fast)
        assert (former.closed, fast.closed) == (True, False)
        house.manager.paths.leave(former)  # late news
        house.manager.ping()
        assert len(fast.data) == 1
        house.manager.disconnect_phone(phone)
        assert fast.closed

    in_loop(scene)


def test_a_recording_begins_with_a_key_picture(house):
    def scene():
        fast = Fast()
        phone = house.manager.connect_phone(hello("first"), Paper())
        house.manager.join_fast(phone.id, fast)
        house.manager.start_recording()
        assert fast.keys == 1

    in_loop(scene)


def test_what_the_server_lacks_reaches_control_with_every_tick(house):
    house.manager._tick()
    (ready,) = house.control.inputs()
    assert isinstance(ready, ReadyInput)
    assert "No phone is connected" in ready.refusals[0]


def test_wishes_reach_control_except_those_for_phones(house):
    def scene():
        for what in ("arm", "disarm", "stop", "reset", "key_frame"):
            house.manager.request(Command(what), of_this_machine("operator"))

    in_loop(scene)
    heard = [m.what for m in house.control.inputs() if isinstance(m, RequestInput)]
    assert heard == ["arm", "disarm", "stop", "reset"]
    assert house.manager.events[0].text == "local program (operator): reset"


def test_a_turned_knob_reaches_control_and_is_an_event(house):
    in_loop(lambda: house.manager.tune(Tune(cutoff_hz=0.5, guard=False)))
    assert house.control.inputs() == [Tune(cutoff_hz=0.5, guard=False)]
    assert house.manager.events[0].text == "supervisor: virtual camera: cutoff_hz 0.5, guard False"


def test_a_wish_to_turn_nothing_is_none(house):
    in_loop(lambda: house.manager.tune(Tune()))
    assert house.control.inputs() == []
    assert not house.manager.events


def test_a_knob_that_does_not_reach_control_is_told(house):
    house.control.close()
    in_loop(lambda: house.manager.tune(Tune(mode="off")))
    assert "did not reach" in house.manager.events[0].text


def test_a_stop_is_said_again_until_control_can_take_it(house):
    async def scene():
        while house.manager._control.send(ReadyInput([])):
            pass
        house.manager.request(Command("stop"), of_this_machine("operator"))
        assert not any(map(is_request("stop"), house.control.inputs()))
        heard = []
        for _ in range(1000):
            heard += house.control.inputs()
            if any(map(is_request("stop"), heard)):
                return
            await asyncio.sleep(0.005)
        raise AssertionError(heard)

    asyncio.run(scene())


def test_events_are_few_newest_first_and_hold_no_control_characters(house):
    for k in range(2 * EVENTS):
        house.manager.log_event(f"{k}\x1b]0;owned\x07\n")
    assert len(house.manager.events) == EVENTS
    assert house.manager.events[0].text == f"{2 * EVENTS - 1}·]0;owned··"


def test_a_change_of_mode_is_an_event_and_every_page_is_told(house):
    watcher = Paper()
    house.manager.supervisors.add(watcher)
    house.control.send(control_status(mode=5, reason="STOP was pressed."))
    house.manager._receive_status()
    house.manager._tick()
    assert house.manager.events[0].text == "STOPPED: STOP was pressed."
    house.manager._tick()
    assert [event.times for event in house.manager.events if "STOPPED" in event.text] == [1]
    assert '"mode":"STOPPED"' in watcher.data[-1]


def test_what_is_doubted_of_the_sensors_is_told_and_is_one_event_while_it_lasts(house):
    watcher, said = Paper(), "The robot's gyroscope is much noisier than usual."
    house.manager.supervisors.add(watcher)
    for doubts in ([said], [said], [], [said]):
        house.control.send(control_status(estimate=estimate_fields(doubts=doubts)))
        house.manager._receive_status()
        house.manager._tick()
        assert msgspec.json.decode(watcher.data[-1])["sensors_doubted"] == doubts
    assert [event.times for event in house.manager.events if event.text == said] == [2]


def test_a_battery_that_gets_worse_is_one_event_whatever_its_voltage(house):
    watcher, shown = Paper(), []
    house.manager.supervisors.add(watcher)
    told = (("good", 11.0), ("low", 10.4), ("low", 10.3), ("empty", 9.8), ("empty", 9.7))
    for level, volts in told:
        words = "" if level == "good" else f"The battery is {level} ({volts} V)."
        house.control.send(control_status(health=HealthFields(level, volts, words)))
        house.manager._receive_status()
        house.manager._tick()
        status = msgspec.json.decode(watcher.data[-1])
        shown.append((status["battery"], status["battery_v"]))
        assert status["health"] == [words] * bool(words)
    assert shown == list(told)
    said = [event.text for event in house.manager.events if "battery" in event.text]
    assert said == ["The battery is empty (9.8 V).", "The battery is low (10.4 V)."]


def test_an_emergency_stop_is_one_event_each_time_it_is_pressed_and_no_battery_s(house):
    watcher, low = Paper(), ("low", 10.4, "The battery is low.")
    house.manager.supervisors.add(watcher)
    for e_stop in ("released", "pressed", "pressed", "released", "pressed"):
        words = "It is pressed." if e_stop == "pressed" else ""
        house.control.send(control_status(health=HealthFields(*low, e_stop, words)))
        house.manager._receive_status()
        house.manager._tick()
        status = msgspec.json.decode(watcher.data[-1])
        assert status["e_stop"] == e_stop
        assert status["health"] == [words] * bool(words) + ["The battery is low."]
    times = {event.text: event.times for event in house.manager.events}
    assert (times["It is pressed."], times["The battery is low."]) == (2, 1)


def test_what_gains_lack_is_one_event(house):
    said = "Gains 'mine' have less margin than is usual."
    for _ in range(3):
        house.control.send(control_status(gains_weak=said))
        house.manager._receive_status()
        house.manager._tick()
    assert [event.times for event in house.manager.events if event.text == said] == [1]


class Eyes:
    """A vision thread and its front-end, which keep what control expects."""

    def __init__(self) -> None:
        self.front_end, self.camera = self, CAMERA
        self.expected: list[Prediction | None] = []

    def add_prediction(self, expected: Prediction | None) -> None:
        self.expected.append(expected)

    def add_imu(self, *samples: object) -> None: ...

    def stop(self) -> None: ...


def test_what_control_expects_of_the_robot_reaches_the_phones_eyes(house):
    def scene():
        page = Paper()
        phone = house.manager.connect_phone(hello("first"), page)
        phone.vision = eyes = Eyes()
        sure = {"u_bf_in_c": (0.0, 0.1, 0.0), "sigma_p": 0.01, "sigma_theta": 0.02}
        pose = {"p_bc_in_c": (2.5, 0.0, 0.0), "R_cb_wxyz": (1.0, 0.0, 0.0, 0.0)}
        for fields in ({}, {**pose, **sure}):
            house.control.send(control_status(**fields))
        house.manager._receive_status()
        before, after = eyes.expected
        assert before is None
        assert (after.sigma_p, after.sigma_theta, after.time_offset) == (0.01, 0.02, 0.0)
        assert after.p_bc_in_c.tolist() == [2.5, 0.0, 0.0]
        assert after.R_cb.tolist() == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        told = [one for one in page.data if '"type":"sight"' in one]
        assert len(told) == 1  # not for each of control's words

    in_loop(scene)


def test_a_recording_asks_for_a_key_again_until_one_has_come(house, monkeypatch):
    def scene():
        fast, t = Fast(), now()
        phone = house.manager.connect_phone(hello("first"), Paper())
        house.manager.join_fast(phone.id, fast)
        house.manager.start_recording()
        picture = replace(JPEG, codec=Codec.H264, key=False)
        for _ in range(30):
            t += 0.1
            monkeypatch.setattr(hub_module, "now", lambda t=t: t)
            house.manager.record(encode(Record(1, 1, picture)), t)
            house.manager._ask_key()
        assert 6 <= fast.keys <= 8  # twice a second
        house.manager.record(encode(Record(2, 1, replace(picture, key=True))), t)
        asked = fast.keys
        monkeypatch.setattr(hub_module, "now", lambda: t + 10.0)
        house.manager._ask_key()
        assert fast.keys == asked

    in_loop(scene)


def test_who_leads_after_somebody_else_leads_by_all_of_the_motion(house):
    """Nobody finds a scale that another hand has chosen; one who comes back finds his own."""

    def leads():
        return [m for m in house.control.inputs() if isinstance(m, Lead)]

    def scene():
        house.manager.status = control_status()
        one, other = (of_this_machine(role) for role in ("operator", "supervisor"))
        first = house.manager.connect_phone(hello("first"), Paper(), one)
        house.manager.lead(Lead(0.5, "level"), one)
        assert leads() == [Lead(0.5, "level")]
        house.manager.disconnect_phone(first)
        again = house.manager.connect_phone(hello("first"), Paper(), one)
        assert leads() == []
        house.manager.disconnect_phone(again)
        assert house.manager.connect_phone(hello("second"), Paper(), other) is not None
        assert leads() == [AS_EVER]

    in_loop(scene)


def test_a_choice_of_leading_that_does_not_reach_control_is_told(house):
    house.control.close()
    in_loop(lambda: house.manager.lead(AS_EVER, of_this_machine("operator")))
    assert "did not reach" in house.manager.events[0].text
