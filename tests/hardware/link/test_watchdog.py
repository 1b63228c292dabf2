"""The watchdog in C answers random traffic exactly as the reference in Python does."""

import ctypes
import json
import math
import random
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hardware.follower import ROUNDING, FollowerState, Refusal
from hardware.link.datagram import CommandDatagram, encode_command
from hardware.link.link_key import LinkKeyError, mac, read_key
from hardware.link.robot_end import LinkLimits, RobotEnd
from hardware.robot_file import load_robot
from tests.hardware.link.test_robot_end import ABOVE, LARGEST
from tests.hardware.test_attitude_keeper import asymmetric, turned

SOURCE = Path(__file__).parents[3] / "deploy" / "watchdog"
KEY = bytes(range(16))
VECTORS = json.loads((Path(__file__).parents[2] / "data" / "link_vectors.json").read_text())
IDLE, RUNNING, RAMP, _, COAST, WIRE = FollowerState
LIMITS = LinkLimits(thrusters=3, f_max=3.0, max_rise=1.0, ramp_us=700_000)
NAMES = ("watchdog.c", "blink.c", "health.c", "tool.c", "attitude.c", "hmac.c")
GCC = ("gcc", "-std=c99", "-pedantic", "-O2", "-Wall", "-Wextra", "-Werror", "-Wconversion")


class CGains(ctypes.Structure):
    _fields_ = (
        ("lift_row", ctypes.c_double * 16),
        ("lift_column", ctypes.c_double * 16),
        ("gain", ctypes.c_double * 6 * 16),
    )

    @classmethod
    def of(cls, gains):
        c = cls()
        for i in range(len(gains.lift_row)):
            c.lift_row[i], c.lift_column[i] = gains.lift_row[i], gains.lift_column[i]
            c.gain[i][:] = gains.gain[i]
        return c


class CLimits(ctypes.Structure):
    _fields_ = (
        ("thrusters", ctypes.c_uint8),
        ("f_max", ctypes.c_double),
        ("max_rise", ctypes.c_double),
        ("ramp_us", ctypes.c_int64),
        ("attitude", ctypes.POINTER(CGains)),
    )


class CRobotEnd:
    """`ll_watchdog` with the methods of `RobotEnd`."""

    def __init__(self, library, limits, boot_id, key=KEY):
        self.library = library
        self.memory = ctypes.create_string_buffer(4096 * b"\xa5")  # whatever was there before
        self.thrusters = limits.thrusters
        c_limits = CLimits(limits.thrusters, limits.f_max, limits.max_rise, limits.ramp_us)
        if limits.attitude is not None:
            self.gains = CGains.of(limits.attitude)
            c_limits.attitude = ctypes.pointer(self.gains)
        self.started = library.ll_init(
            self.memory, ctypes.byref(c_limits), ctypes.c_uint32(boot_id), key
        )
        self.answers = False

    def receive(self, data, _peer, now_us):
        size, now = ctypes.c_size_t(len(data)), ctypes.c_int64(now_us)
        answer = ctypes.c_bool(True)
        why = self.library.ll_receive(self.memory, data, size, now, ctypes.byref(answer))
        self.answers = answer.value
        return Refusal(why)

    def setpoint(self, now_us):
        thrusts = (ctypes.c_float * 16)()
        self.library.ll_setpoint(self.memory, ctypes.c_int64(now_us), thrusts)
        return np.array(thrusts[: self.thrusters])

    def sample(self, now_us, nonce, omega, a, thrusts):
        out = ctypes.create_string_buffer(156)
        size = self.library.ll_sample(
            self.memory,
            ctypes.c_int64(now_us),
            ctypes.c_uint64(nonce),
            (ctypes.c_float * 3)(*omega),
            (ctypes.c_float * 3)(*a),
            (ctypes.c_float * 16)(*thrusts),
            out,
        )
        return out.raw[:size]

    def halt(self):
        self.library.ll_halt(self.memory)

    def wire(self, *, is_open):
        self.library.ll_wire(self.memory, ctypes.c_bool(is_open))


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if shutil.which("gcc") is None:
        pytest.skip("NO COMPILER, not tested: gcc is not installed")
    path = tmp_path_factory.mktemp("watchdog") / "watchdog.so"
    sources = (*(str(SOURCE / name) for name in NAMES), "-shared", "-fPIC", "-o", str(path), "-lm")
    subprocess.run((*GCC, *sources), check=True)
    library = ctypes.CDLL(str(path))
    library.ll_sample.restype = ctypes.c_size_t
    library.ll_init.restype = ctypes.c_bool
    library.ll_health_due.restype = ctypes.c_size_t
    return library


class Traffic:
    """Control processes that mostly behave, drawn from a seed."""

    def __init__(self, seed, thrusters):
        self.thrusters = thrusters
        self.random = random.Random(seed)
        self.epoch = self.random.choice((1, 2**40, 2**63))
        self.counter = self.random.choice((0, 2**32 - 100))
        self.sent = [b""]

    def often(self, share):
        return self.random.random() < share

    def step_us(self):
        if self.often(0.985):
            return 5000
        return self.random.choice(HOLES_US)

    def thrusts(self):
        """Of all thrusters the same, of each its own, or of one alone."""
        rnd, n = self.random, self.thrusters
        if self.often(0.7):
            return [rnd.uniform(0.0, 1.9)] * n
        drawn = [rnd.uniform(0.0, 1.0) for _ in range(n)]
        alone = rnd.randrange(n) if self.often(0.3) else None
        return [thrust * (alone in (None, i)) for i, thrust in enumerate(drawn)]

    def datagram(self, state, nonce):
        rnd = self.random
        if self.often(0.02):
            return rnd.choice((rnd.choice(self.sent), rnd.randbytes(64), self.sent[-1][:-1], b""))
        if self.often(0.02 if state == FollowerState.REFUSING else 0.004):
            self.epoch = max(1, self.epoch + rnd.choice((1, 1, 1, -1, 1000)))
        self.counter = (
            self.counter + (1 if self.often(0.98) else rnd.choice((0, 2, 200, 201, -3)))
        ) % 2**32
        thrusting = state != FollowerState.REFUSING and self.often(0.98)
        thrusts = self.thrusts() if thrusting else [0.0] * self.thrusters
        if self.often(0.01):
            bad = rnd.choice((float("nan"), float("inf"), -1.0, 3.5, 3.0, -0.0))
            thrusts[rnd.randrange(self.thrusters)] = bad
        command = CommandDatagram(
            epoch=self.epoch,
            counter=self.counter,
            nonce=nonce if self.often(0.99) else rnd.choice((0, max(1, nonce - 12))),
            challenge=rnd.getrandbits(64),
            armed=any(thrusts) if self.often(0.99) else False,
            thrusts=tuple(
                thrusts if self.often(0.995) else rnd.choice((thrusts[1:], [0.0, *thrusts]))
            ),
            stop=self.often(0.01),
        )
        if self.often(0.02):
            command = self.other(command)
        key = KEY if self.often(0.995) else rnd.randbytes(16)
        self.sent.append(encode_command(command, key))
        return self.sent[-1]

    def other(self, command):
        """Of another process, or of one that hears nothing; or half round the counter's corner."""
        rnd, zero = self.random, (0.0,) * self.thrusters
        stop, nonce = self.often(0.5), rnd.choice((0, command.nonce, max(1, command.nonce - 8)))
        if self.often(0.5):
            epoch, counter = command.epoch + rnd.choice((-1, 1)), rnd.choice((1, command.counter))
            return replace(command, epoch=max(1, epoch), counter=counter, thrusts=zero, stop=stop)
        if self.often(0.5):
            return replace(command, nonce=nonce, thrusts=zero)
        return replace(command, counter=(command.counter - 1 + 2**31) % 2**32, thrusts=zero)


HOLES_US = (*range(0, 450_000, 50_000), -20_000, 1, 39_999, 41_000, 60_001, 1_500_000)
PERIODS = np.array([40.0, 50.0, 60.0])
QUADROTOR = load_robot("quadrotor")
FLIES = LinkLimits.of(QUADROTOR)
ROBOTS = {
    "hangs": LIMITS,
    "flies": FLIES,
    "one thruster": replace(LIMITS, thrusters=1),
    "sixteen thrusters": replace(LIMITS, thrusters=16),
}


def hold_against_each_other(library, seed, limits, seen):
    """The same traffic for both; adds to `seen` what happened."""
    traffic = Traffic(seed, limits.thrusters)
    python, c = RobotEnd(limits, 77, KEY), CRobotEnd(library, limits, 77)
    now_us = 10_000_000
    is_open = wired = False
    for nonce in range(1, 2500):
        now_us += traffic.step_us()
        rare = 0.02 if python.state in (COAST, RAMP) else 0.002
        if traffic.often(0.05 if is_open else rare):
            is_open, wired = not is_open, True
            seen |= {(python.state, WIRE)} if is_open else set()
        if wired:
            python.wire(is_open=is_open)
            c.wire(is_open=is_open)
        omega = tuple(float(v) for v in (0.3 * np.sin(nonce / PERIODS)).astype(np.float32))
        if traffic.often(0.002):
            omega = (*omega[:2], traffic.random.choice((math.nan, math.inf, -math.inf)))
        values = (omega, (0.5, 1.5, 9.75), np.full(limits.thrusters, 0.5))
        a = python.sample(now_us, nonce, *values)
        assert a == c.sample(now_us, nonce, *values)
        before, data = python.state, traffic.datagram(python.state, nonce)
        now_us += traffic.random.choice((0, 0, 3000))
        peer = ("", nonce)
        why = python.receive(data, peer, now_us)
        assert why == c.receive(data, peer, now_us), nonce
        assert (python._asking == peer) == c.answers
        assert (python._peer == peer) == (why == Refusal.NONE)
        if traffic.often(0.01):
            now_us += traffic.step_us() + traffic.random.choice(HOLES_US)
        if traffic.often(0.001):
            python.halt()
            c.halt()
        np.testing.assert_allclose(python.setpoint(now_us), c.setpoint(now_us), atol=1e-6)
        seen |= {python.state, ("answer", why), (before, python.state)}
        seen.add((why == Refusal.NONE, c.answers))


@pytest.mark.slow
@pytest.mark.parametrize("limits", ROBOTS.values(), ids=ROBOTS)
def test_c_and_python_agree_on_every_answer_thrust_and_sample(library, limits):
    seen = set()
    for seed in range(6):
        hold_against_each_other(library, seed, limits, seen)
    assert seen >= {*FollowerState}
    assert seen >= {(state, FollowerState.RUNNING) for state in (COAST, RAMP, RUNNING, IDLE)}
    assert seen >= {(taken, answered) for taken in (True, False) for answered in (True, False)}
    assert seen >= {(state, WIRE) for state in (RUNNING, RAMP, WIRE)}  # others: the search
    others = {Refusal.NONE, Refusal.STARTED, Refusal.HANDSHAKE, Refusal.FAULT}
    others |= {Refusal.NOT_ARMED, Refusal.MODE}  # an autopilot's alone
    others |= {Refusal.RISE} if limits is FLIES else set()  # from 0 to full in two commands
    assert seen >= {("answer", why) for why in Refusal if why not in others}


BAD_LIMITS = (
    *({"thrusters": n} for n in (0, 17)),
    *({"ramp_us": ramp_us} for ramp_us in (0, -1)),
    *({name: bad} for name in ("f_max", "max_rise") for bad in (0, -1, math.nan, math.inf)),
)


@pytest.mark.parametrize("bad", BAD_LIMITS, ids=str)
def test_limits_that_limit_nothing_are_refused_and_then_no_command_is_taken(library, bad):
    assert CRobotEnd(library, LIMITS, 77).started
    robot = CRobotEnd(library, replace(LIMITS, **bad), 77)
    assert not robot.started
    for nonce, now_us in enumerate(range(1_000_000, 2_000_000, 5000), 1):
        robot.sample(now_us, nonce, (0.0,) * 3, (0.0,) * 3, np.zeros(3))
        command = CommandDatagram(5, nonce, nonce, nonce, False, (0.0,) * 3)
        assert robot.receive(encode_command(command, KEY), None, now_us) == Refusal.THRUSTERS


GOOD_LIMITS = (*({"thrusters": n} for n in (1, 16)), {"ramp_us": 1}, {"f_max": 5e-324})


@pytest.mark.parametrize("good", GOOD_LIMITS, ids=str)
def test_limits_that_limit_something_are_taken(library, good):
    assert CRobotEnd(library, replace(LIMITS, **good), 77).started


class Both:
    """The two ends, asked and told the same; what they answer and give is the same, too."""

    def __init__(self, library, limits=LIMITS):
        self.ends = RobotEnd(limits, 77, KEY), CRobotEnd(library, limits, 77)
        self.thrusters, self.now_us, self.nonce, self.counter = limits.thrusters, 1_000_000, 0, 0

    def send(self, thrust=0.0, after_us=5000):
        """A good command on the sample of that time; what the robot says to it."""
        self.now_us += after_us
        self.nonce += 1
        values = (0.0,) * 3, (0.0,) * 3, np.zeros(self.thrusters)
        python, c = (end.sample(self.now_us, self.nonce, *values) for end in self.ends)
        assert python == c
        thrusts = (thrust,) * self.thrusters
        command = CommandDatagram(5, self.counter + 1, self.nonce, 1, thrust > 0.0, thrusts)
        data = encode_command(command, KEY)
        why, c_why = (end.receive(data, None, self.now_us) for end in self.ends)
        assert why == c_why
        python, c = (end.setpoint(self.now_us) for end in self.ends)
        np.testing.assert_allclose(python, c, atol=1e-6)
        self.counter += why == Refusal.NONE
        return why

    def shake_hands(self):
        while self.ends[0].state != FollowerState.IDLE:
            assert self.send() == Refusal.NONE


@pytest.mark.parametrize(("limit", "why"), [("f_max", Refusal.LIMITS), ("max_rise", Refusal.RISE)])
def test_a_limit_allows_what_is_rounded_to_it_and_no_more(library, limit, why):
    both = Both(
        library, replace(LIMITS, **{"f_max": 3.0, "max_rise": 3.0, limit: LARGEST / ROUNDING})
    )
    both.shake_hands()
    assert both.send(ABOVE) == why
    assert both.send(LARGEST) == Refusal.NONE


LIMITS_OF_SILENCE = (60_000, 280_000, 400_000, 60_000 + LIMITS.ramp_us)


@pytest.mark.parametrize("silence_us", sorted(us + k for us in LIMITS_OF_SILENCE for k in (0, 1)))
@pytest.mark.parametrize("thrust", [0.0, 2.0])
def test_c_and_python_follow_again_alike_after_a_silence_as_long_as_a_limit(
    library, silence_us, thrust
):
    both = Both(library, replace(LIMITS, max_rise=0.05))
    both.shake_hands()
    for k in range(50):
        assert both.send(min(thrust, 0.05 * k)) == Refusal.NONE
    both.send(thrust, silence_us)
    for _ in range(20):
        both.send(thrust)


@pytest.mark.parametrize("commands", [3, 79, 80, 81, 200])
def test_c_and_python_give_the_same_in_silence_after_any_thrusts(library, commands):
    """What was given long ago counts in both alike, and in neither after a zero between."""
    both, rng = Both(library, replace(LIMITS, max_rise=3.0)), np.random.default_rng(commands)
    both.shake_hands()
    for _ in range(2):
        for thrust in rng.uniform(0.1, 2.9, commands):
            assert both.send(thrust) == Refusal.NONE
        for silence_us in range(5_000, 380_000, 25_000):
            python, c = (end.setpoint(both.now_us + silence_us) for end in both.ends)
            np.testing.assert_allclose(python, c, atol=1e-6)
        assert both.send(1.0, 390_000) == Refusal.NONE
        assert both.send(0.0) == Refusal.NONE


ZERO = encode_command(CommandDatagram(5, 110, 109, 1, False, (0.0,) * 3), KEY)[:-16]


@pytest.mark.parametrize("at", range(8))
def test_c_and_python_read_the_same_of_the_first_bytes(library, at):
    ends = RobotEnd(LIMITS, 77, KEY), CRobotEnd(library, LIMITS, 77)
    for value in range(256):
        body = ZERO[:at] + bytes([value]) + ZERO[at + 1 :]
        python, c = (end.receive(body + mac(KEY, body), None, 1_000_000) for end in ends)
        assert python == c


@pytest.mark.parametrize("sent", range(20))
def test_a_datagram_has_as_many_thrusts_as_it_says(library, sent):
    body = ZERO[:36] + bytes(4 * sent)
    for said in range(20):
        end = CRobotEnd(library, replace(LIMITS, thrusters=max(1, min(said, 16))), 77)
        data = body[:5] + bytes([said]) + body[6:]
        why = end.receive(data + mac(KEY, data), None, 1_000_000)
        assert (why == Refusal.MALFORMED) == (said != sent or not 1 <= said <= 16)


def run_robot(path, key_text, *numbers):
    """The program of a robot, which must refuse to start."""
    program, key_file = path / "robot", path / "robot.key"
    key_file.write_text(key_text)
    key_file.chmod(0o600)
    words = (str(program), str(key_file), "0", "3", *numbers)
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=20.0)


@pytest.fixture(scope="module")
def program_path(library, tmp_path_factory):
    path = tmp_path_factory.mktemp("robot")
    sources = [str(SOURCE / name) for name in ("robot_main.c", *NAMES)]
    words = ("gcc", "-O2", "-Wall", "-Wextra", "-Werror", "-o", str(path / "robot"))
    subprocess.run((*words, *sources, "-lm"), check=True)
    return path


HEX = KEY.hex()
NO_KEYS = ["", HEX[:-1], HEX + "0", HEX + "\n00", HEX[:16] + " " + HEX[16:], "0x" + HEX[:-2]]
NO_KEYS += [HEX[:-1] + "g", "+1" + HEX[2:], "x" + HEX]


@pytest.mark.parametrize("text", NO_KEYS)
def test_the_program_refuses_what_python_refuses_as_a_key(program_path, text):
    done = run_robot(program_path, text, "3.0", "1.0", "2000")
    assert (done.returncode, "no key" in done.stderr) == (2, True)
    with pytest.raises(LinkKeyError):
        read_key(program_path / "robot.key")


BAD_NUMBERS = (("nan", "1", "9"), ("3", "nan", "9"), ("3", "1", "-9"), ("3", "1", "0"))


@pytest.mark.parametrize("numbers", BAD_NUMBERS)
@pytest.mark.parametrize("key_text", [HEX, f" \n{HEX.upper()}\n\n"])
def test_the_program_reads_the_key_and_refuses_numbers_that_limit_nothing(
    program_path, key_text, numbers
):
    done = run_robot(program_path, key_text, *numbers)
    assert (done.returncode, "above 0" in done.stderr) == (2, True)


@pytest.mark.parametrize("seed", range(100))
def test_c_and_python_agree_on_torques_whatever_the_rotors(library, seed):
    gains, falling, random = asymmetric(seed)
    keeper, c_gains = turned(gains, random), CGains.of(gains)
    attitude = (ctypes.c_double * 12)(*keeper.up_in_b, 0.0, 0.0, 1.0, *keeper._omega_in_b)
    thrusts = (ctypes.c_double * 16)(*falling)
    n, f_max = ctypes.c_uint8(len(falling)), ctypes.c_double(gains.f_max)
    library.ll_attitude_thrusts(attitude, ctypes.byref(c_gains), n, f_max, thrusts)
    np.testing.assert_allclose(thrusts[: len(falling)], keeper.thrusts(falling), atol=1e-9)


@pytest.mark.parametrize("kind", ["sha256", "hmac_sha256"])
def test_the_digests_are_those_of_fips_180_4_and_rfc_4231(library, kind):
    for vector in VECTORS[kind]:
        data, digest = bytes.fromhex(vector["data"]), ctypes.create_string_buffer(32)
        if kind == "sha256":
            library.ll_sha256(data, ctypes.c_size_t(len(data)), digest)
        else:
            key, prepared = bytes.fromhex(vector["key"]), ctypes.create_string_buffer(64)
            library.ll_hmac_init(prepared, key, ctypes.c_size_t(len(key)))
            library.ll_hmac_of(prepared, data, ctypes.c_size_t(len(data)), digest)
        expected = bytes.fromhex(vector["digest"])
        assert digest.raw[: len(expected)] == expected


@pytest.mark.parametrize("length", range(130))
def test_the_mac_is_right_for_every_length_of_message(library, length):
    data, digest = bytes(range(length)), ctypes.create_string_buffer(32)
    prepared = ctypes.create_string_buffer(64)
    library.ll_hmac_init(prepared, KEY, ctypes.c_size_t(16))
    library.ll_hmac_of(prepared, data, ctypes.c_size_t(length), digest)
    assert digest.raw[:16] == mac(KEY, data)


@pytest.mark.parametrize("vector", [v for v in VECTORS["datagrams"] if v["kind"] == "command"])
def test_the_recorded_commands_are_read_and_no_byte_of_them_may_differ(library, vector):
    data, key = bytes.fromhex(vector["bytes"]), bytes.fromhex(vector["key"])
    limits = replace(LIMITS, thrusters=data[5])
    for at in (None, *range(len(data))):
        sent = bytearray(data)
        if at is not None:
            sent[at] ^= 1
        robot = CRobotEnd(library, limits, 77, key)
        why = robot.receive(bytes(sent), None, 1_000_000)
        assert (why == Refusal.MALFORMED) == (at is not None)


def test_a_twist_is_no_command_for_it(library):
    both = Both(library, LIMITS)
    both.shake_hands()
    twist = CommandDatagram(5, both.counter + 1, both.nonce, 1, True, (), False, (0.1,) * 6)
    python, c = both.ends
    assert c.receive(encode_command(twist, KEY), None, both.now_us) == Refusal.MALFORMED
    assert python.receive(encode_command(twist, KEY), None, both.now_us) == Refusal.THRUSTERS
    assert not c.setpoint(both.now_us).any()
    assert not python.setpoint(both.now_us).any()
