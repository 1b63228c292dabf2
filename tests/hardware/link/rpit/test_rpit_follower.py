"""RPIt's link over real sockets in virtual time, against a client made from its description."""

from __future__ import annotations

import socket
import struct

import numpy as np
import pytest

from hardware.contract import FollowerContract, exchange
from hardware.follower import FollowerError, FollowerState, ThrustCommand
from hardware.link.address import ANYBODY
from hardware.link.registry import link_kind
from hardware.link.robot_server import bound
from hardware.robot_file import load_robot, robot_of, robot_path, robot_table
from tests.hardware.link.rpit.lab_robot import RUNNING, Block, Model
from tests.hardware.link.rpit.rpit_rig import BOOT_ID, LOCALHOST, RpitRig, bad_line

AMES = load_robot("ames")
ZERO = ThrustCommand.zero(8)
FLYING = ThrustCommand(np.full(8, 0.5), armed=True)
STILL = (0.0, 0.0, 0.0)


@pytest.fixture
def loopback():
    rig = RpitRig(AMES)
    yield rig
    rig.close()


class TestContract(FollowerContract):
    @pytest.fixture
    def rig(self, loopback):
        return loopback

    def test_a_command_made_of_old_samples_is_not_taken(self, rig) -> None:
        """The contract's law, whose last two lines ask for what RPIt's client can't give.

        There the line is emptied, and then the robot has to speak though nothing more is said to
        it; but this client says something only when it has read something, or once in a second.
        So here what the line held back is read, and that nothing more comes is seen.
        """
        self.ready(rig)
        self.fly(rig, 1.0, 0.2)
        for _ in range(80):
            rig.follower.send(ThrustCommand(np.full(rig.follower.thrusters, 1.0), armed=True))
            rig.advance(0.005)
        assert rig.robot.model.state == FollowerState.RAMP
        assert rig.follower.receive()[-1].state == FollowerState.RAMP
        rig.advance(0.005)
        assert rig.follower.receive() == []

    def test_stop_is_zero_at_once(self, rig) -> None:
        """The same: what it did is told when it is asked again, so its model is looked at."""
        self.ready(rig)
        self.fly(rig, 2.0, 0.4)
        rig.follower.stop()
        rig.advance(0.010)
        assert rig.robot.model.state == FollowerState.IDLE
        assert rig.robot.set == [0.0] * 8


def run(rig, command, ticks):
    samples = []
    for _ in range(ticks):
        samples += exchange(rig.follower, command)
        rig.advance(0.005)
    return samples


def test_a_mes_goes_out_with_each_command_and_never_as_an_answer(loopback):
    run(loopback, ZERO, 200)
    block = loopback.robot.block
    exchanges = block.exchanges
    run(loopback, ZERO, 200)
    assert block.exchanges == exchanges + 200
    for _ in range(600):  # the client speaks by itself once a second
        loopback.advance(0.005)
        loopback.follower.receive()
    assert block.exchanges == exchanges + 200


def test_nothing_is_sent_before_the_robot_has_spoken(loopback):
    other = loopback.ground(1)
    other.send(ZERO)
    assert other.lost == 1
    assert other.receive() == []
    other.close()


def test_a_robot_whose_packets_get_lost_doubled_and_swapped_is_led_without_a_gap(loopback):
    run(loopback, ZERO, 120)
    rng, block, model = np.random.default_rng(5), loopback.robot.block, loopback.robot.model
    block.to_ground, block.to_robot = bad_line(rng), bad_line(rng)
    begun, dropped = model.counter, loopback.follower.dropped
    states, missed, times = set(), [], []
    for k in range(4000):
        level = 1.0 + 0.5 * np.sin(0.02 * k)
        samples = run(loopback, ThrustCommand(np.full(8, level), armed=True), 1)
        states.add(model.state if k > 0 else RUNNING)
        missed.append(loopback.robot.set[0] - level if k > 0 else 0.0)
        times += [sample.t_us for sample in samples]
    assert states == {RUNNING}
    assert model.counter - begun == pytest.approx(4000, abs=3)
    assert len(times) > 3600
    assert (np.diff(times) > 0).all()
    assert np.abs(missed).max() < 0.05
    assert loopback.follower.dropped - dropped > 100  # doubled and overtaken


def test_when_control_dies_the_robot_comes_down_though_the_block_shows_its_last_words(loopback):
    run(loopback, ZERO, 120)
    run(loopback, FLYING, 20)
    loopback.follower.close()
    robot, states, thrusts = loopback.robot, [], []
    while robot.model.state != FollowerState.REFUSING:
        loopback.advance(0.005)
        states.append(robot.model.state)
        thrusts.append(max(robot.set))
    order = list(dict.fromkeys(states))
    assert order == [FollowerState[s] for s in ("RUNNING", "COAST", "RAMP", "REFUSING")]
    assert 0.005 * states.index(FollowerState.RAMP) == pytest.approx(0.28, abs=0.011)
    assert 0.005 * len(states) == pytest.approx(0.06 + AMES.robot.ramp_s, abs=0.011)
    assert (np.diff(thrusts) <= 0.0).all()
    assert thrusts[-1] == 0.0
    assert robot.block.mes[16:24] == [0.5] * 8


def test_a_new_control_process_on_the_same_port_has_the_robot_soon(loopback):
    run(loopback, ZERO, 120)
    run(loopback, FLYING, 20)
    port = loopback.follower.port
    loopback.follower.close()
    loopback.advance(3.0)
    loopback.follower = loopback.ground(9, port)
    states = [(sample.state if sample else None) for sample in heard(loopback, 400)]
    assert loopback.robot.model.epoch == 9
    assert states.index(FollowerState.IDLE) < 310  # a second for the client to speak, and 0.5
    assert states[-1] == FollowerState.IDLE


def heard(rig, ticks):
    """Newest sample of each tick of zero, None without one."""
    for _ in range(ticks):
        samples = run(rig, ZERO, 1)
        yield samples[-1] if samples else None


def test_a_robot_that_starts_anew_gives_no_thrust_before_zero(loopback):
    run(loopback, ZERO, 120)
    run(loopback, FLYING, 20)
    loopback.robot.close()
    loopback.robot = loopback.started(BOOT_ID + 1, 5_000)
    samples = run(loopback, FLYING, 300)
    assert {s.state for s in samples if s.boot_id > BOOT_ID} == {FollowerState.REFUSING}
    assert loopback.robot.set == [0.0] * 8
    last = run(loopback, ZERO, 300)[-1]
    assert (last.boot_id, last.state) == (BOOT_ID + 1, FollowerState.IDLE)


def test_a_model_that_stands_still_behind_its_block_is_silent(loopback):
    """The block's thread goes on and says the same again."""
    run(loopback, ZERO, 120)
    dropped = loopback.follower.dropped
    for _ in range(20):
        loopback.now += 0.005
        loopback.follower.send(ZERO)
        loopback.robot.run()
        samples = loopback.follower.receive()
    assert samples == []
    assert loopback.follower.dropped == dropped


class Stranger(Block):
    """Another program on this machine, which knows the structs."""

    def say(self, sent_ns):
        """Something new by its own counter and clock."""
        self.con[9] += 1.0
        self.con[6] += 1.0
        self.socket.send(struct.pack("<IxxxxQ150d", 3141592, sent_ns, *self.con))

    def heard(self):
        try:
            return self.socket.recv(2048)
        except BlockingIOError:
            return None


@pytest.fixture
def stranger(loopback):
    stranger = Stranger(loopback.follower.port)
    stranger.con = loopback.robot.model.con(7, STILL, (0.0, 0.0, 9.8), [0.0] * 8)
    yield stranger
    stranger.socket.close()


def test_a_stranger_moves_nobody_and_gets_nothing_while_the_robot_is_heard(loopback, stranger):
    run(loopback, ZERO, 120)
    dropped = loopback.follower.dropped
    for k in range(300):
        stranger.con = list(loopback.robot.block.con)  # he knows all that the robot says
        stranger.say(10**15 + k)
        (sample,) = run(loopback, FLYING, 1)
        assert sample.state in (FollowerState.IDLE, FollowerState.RUNNING)
        assert stranger.heard() is None
    assert loopback.robot.model.state == RUNNING
    assert loopback.follower.dropped == dropped + 300


@pytest.mark.parametrize("lasts", [10**6, 100])
def test_a_stranger_who_was_first_with_a_recording_gives_way_after_a_second(
    loopback, stranger, lasts
):
    """However often he begins it anew."""
    stranger.say(1)
    loopback.follower.receive()
    states = []
    for k in range(600):
        if k % 10 == 0:
            stranger.say(2 + k % lasts)
        states += [s.state for s in run(loopback, ZERO, 1)]
    assert len(states) > 150
    assert states[-1] == FollowerState.IDLE


def test_a_stranger_has_the_place_of_a_robot_that_was_silent_for_a_second_and_is_not_believed(
    loopback, stranger
):
    run(loopback, ZERO, 120)
    loopback.cut_link()
    run(loopback, ZERO, 1)
    for k in range(400):
        stranger.say(10**15 + k)
        assert run(loopback, ZERO, 1) == []
        if stranger.heard() is not None:
            break
    assert 0.99 < 0.005 * k < 1.02


def test_only_the_host_of_the_robot_file_is_heard():
    rig = RpitRig(AMES, host="192.0.2.1")
    assert run(rig, ZERO, 100) == []
    assert rig.follower.dropped > 0
    assert rig.follower.lost == 100
    rig.close()


def test_if_the_robot_file_names_no_host_whoever_speaks_first_is_heard():
    rig = RpitRig(AMES, host="0.0.0.0")
    assert run(rig, ZERO, 150)[-1].state == FollowerState.IDLE
    rig.close()


def test_a_robot_whose_clock_goes_back_is_not_believed_until_it_has_caught_up(loopback):
    run(loopback, ZERO, 120)
    newest = run(loopback, ZERO, 1)[-1].t_us
    loopback.robot.now_us -= 100_000
    dropped = loopback.follower.dropped
    times = [sample.t_us for sample in run(loopback, ZERO, 50)]
    assert min(times) > newest
    assert len(times) < 32
    assert loopback.follower.dropped - dropped == pytest.approx(20, abs=2)


NO_CONS = {
    "nothing": lambda _: b"",
    "zeros": lambda _: bytes(1216),
    "a byte too few": lambda good: good[:-1],
    "a byte too many": lambda good: good + b"\0",
    "another magic": lambda good: b"\0" + good[1:],
    "ten doubles, as of old": lambda good: good[:96],
}


@pytest.mark.parametrize("made", NO_CONS.values(), ids=NO_CONS)
def test_what_is_no_con_is_dropped_and_counted_and_makes_nobody_the_robot(loopback, stranger, made):
    good = struct.pack("<IxxxxQ150d", 3141592, 9, *stranger.con)
    stranger.socket.send(made(good))
    assert loopback.follower.receive() == []
    assert loopback.follower.dropped == 1
    loopback.follower.send(ZERO)
    assert stranger.heard() is None
    stranger.socket.send(good)
    loopback.follower.receive()
    loopback.follower.send(ZERO)
    assert len(stranger.heard()) == 1216


def test_a_robot_of_another_number_of_thrusters_is_not_heard(loopback, stranger):
    stranger.con = Model(4, 3.0, 1.0, 1.0, 3).con(7, STILL, STILL, [0.0] * 4)
    stranger.say(1)
    assert loopback.follower.receive() == []
    assert loopback.follower.dropped == 1
    loopback.follower.send(ZERO)
    assert stranger.heard() is None


def test_what_can_not_be_connected_says_why_and_what_to_do():
    connect = link_kind("rpit").connect
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOCALHOST, 0))
        port = taken.getsockname()[1]
        with pytest.raises(FollowerError, match=rf"port {port} .*link\.port"):
            connect(AMES.reached(LOCALHOST, port), b"", 1)
    with pytest.raises(FollowerError, match=r"no-such-robot\.invalid.*0\.0\.0\.0"):
        connect(AMES.reached("no-such-robot.invalid", port), b"", 1)
    with pytest.raises(FollowerError, match="epoch"):
        connect(AMES.reached(LOCALHOST, port), b"", 2**53)


def test_by_its_kind_it_listens_where_the_file_says_and_leads_the_robot(loopback):
    port = loopback.follower.port
    loopback.follower.close()
    loopback.follower = link_kind("rpit").connect(AMES.reached(LOCALHOST, port), b"", 5)
    assert loopback.follower.port == port
    assert run(loopback, ZERO, 150)[-1].state == FollowerState.IDLE
    assert loopback.robot.model.epoch == 5


@pytest.mark.parametrize(
    ("host", "here"),
    [
        (LOCALHOST, LOCALHOST),
        ("127.0.0.3", "127.0.0.3"),
        ("192.0.2.1", ANYBODY),
        (ANYBODY, ANYBODY),
    ],
)
def test_a_robot_of_this_machine_is_not_listened_for_on_the_network(monkeypatch, host, here):
    asked = []
    monkeypatch.setattr(
        "hardware.link.rpit.rpit_follower.bound",
        lambda at: asked.append(at) or bound((LOCALHOST, 0)),
    )
    link_kind("rpit").connect(AMES.reached(host, 31415), b"", 5).close()
    assert asked == [(here, 31415)]


def lab_file(**link):
    table = robot_table(robot_path("ames"))
    del table["link"]["port"]
    table["link"] |= {"kind": "rpit", "host": "192.168.1.20", **link}
    return robot_of(table, "lab.toml")


def test_its_usual_port_need_not_be_said():
    assert lab_file().link.port == 31415
    assert lab_file(port=31418).link.port == 31418


def test_thrust_that_rises_too_fast_is_slowed_down_not_refused(loopback):
    run(loopback, ZERO, 120)
    run(loopback, ThrustCommand(np.full(8, 3.0), armed=True), 3)
    assert loopback.robot.set == [3.0] * 8
    assert loopback.robot.model.state == RUNNING


def test_stop_is_obeyed_by_a_robot_that_hears_old_news_only(loopback):
    run(loopback, ZERO, 120)
    run(loopback, FLYING, 20)
    loopback.robot.block.to_ground = lambda _: []
    run(loopback, FLYING, 30)
    assert 0.4 < max(loopback.robot.set) < 0.5
    loopback.follower.stop()
    loopback.advance(0.005)
    assert loopback.robot.set == [0.0] * 8


def test_stop_is_said_often_enough_for_a_bad_line_and_never_after_the_end(loopback, stranger):
    stranger.say(1)
    loopback.follower.receive()
    loopback.follower.send(FLYING)
    loopback.follower.stop()
    said = [struct.unpack("<IxxxxQ150d", mes)[2:] for mes in iter(stranger.heard, None)]
    assert max(said[0][16:24]) > 0.0
    assert [mes[3] for mes in said[1:]] == [2.0, 3.0, 4.0, 5.0, 6.0]
    assert all(set(mes[16:24]) == {0.0} and mes[7] == 0.0 for mes in said[1:])
    loopback.follower.close()
    loopback.follower.stop()
    assert loopback.follower.lost == 0
