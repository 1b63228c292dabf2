"""The watchdog in C answers random traffic exactly as the reference in Python does."""

import ctypes
import random
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from hardware.datagram import Command, encode_command
from hardware.follower import FollowerState, Refusal
from hardware.robot_end import LinkLimits, RobotEnd

SOURCE = Path(__file__).parents[2] / "deploy" / "watchdog"
LIMITS = LinkLimits(thrusters=3, f_max=3.0, max_rise=1.0, ramp_us=700_000)
GCC = ("gcc", "-std=c99", "-pedantic", "-O2", "-Wall", "-Wextra", "-Werror", "-Wconversion")


class CLimits(ctypes.Structure):
    _fields_ = (
        ("thrusters", ctypes.c_uint8),
        ("f_max", ctypes.c_double),
        ("max_rise", ctypes.c_double),
        ("ramp_us", ctypes.c_int64),
    )


class CRobotEnd:
    """`ll_watchdog` with the methods of `RobotEnd`."""

    def __init__(self, library, limits, boot_id):
        self.library = library
        self.memory = ctypes.create_string_buffer(4096)
        self.thrusters = limits.thrusters
        c_limits = CLimits(limits.thrusters, limits.f_max, limits.max_rise, limits.ramp_us)
        library.ll_init(self.memory, ctypes.byref(c_limits), ctypes.c_uint32(boot_id))

    def receive(self, data, _peer, now_us):
        size, now = ctypes.c_size_t(len(data)), ctypes.c_int64(now_us)
        return Refusal(self.library.ll_receive(self.memory, data, size, now))

    def setpoint(self, now_us):
        thrusts = (ctypes.c_float * 16)()
        self.library.ll_setpoint(self.memory, ctypes.c_int64(now_us), thrusts)
        return np.array(thrusts[: self.thrusters])

    def sample(self, now_us, nonce, omega, a, thrusts):
        out = ctypes.create_string_buffer(128)
        size = self.library.ll_sample(
            self.memory,
            ctypes.c_int64(now_us),
            ctypes.c_uint32(nonce),
            (ctypes.c_float * 3)(*omega),
            (ctypes.c_float * 3)(*a),
            (ctypes.c_float * 16)(*thrusts),
            out,
        )
        return out.raw[:size]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if shutil.which("gcc") is None:
        pytest.skip("NO COMPILER, not tested: gcc is not installed")
    path = tmp_path_factory.mktemp("watchdog") / "watchdog.so"
    sources = (str(SOURCE / "watchdog.c"), "-shared", "-fPIC", "-o", str(path), "-lm")
    subprocess.run((*GCC, *sources), check=True)
    library = ctypes.CDLL(str(path))
    library.ll_sample.restype = ctypes.c_size_t
    return library


class Traffic:
    """A control process that mostly behaves, drawn from a seed."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.epoch = self.random.choice((1, 2**32 - 2, 2**31))
        self.counter = self.random.choice((0, 2**32 - 100))
        self.thrust = 0.0
        self.sent = b""

    def often(self, share):
        return self.random.random() < share

    def step_us(self):
        if self.often(0.985):
            return 5000
        return self.random.choice((0, 1, 39_999, 41_000, 60_000, 60_001, 300_000, 1_500_000))

    def datagram(self, state, nonce, sent_us):
        rnd = self.random
        if self.often(0.01):
            return rnd.choice((self.sent, rnd.randbytes(44), self.sent[:-1], b""))
        if state == FollowerState.REFUSING and self.often(0.02):
            self.epoch = (self.epoch + rnd.choice((1, 1, 1, -1, 2**31))) % 2**32
        self.counter = (
            self.counter + (1 if self.often(0.98) else rnd.choice((0, 2, 200, 201, -3)))
        ) % 2**32
        flying = state in (FollowerState.IDLE, FollowerState.RUNNING, FollowerState.RAMP)
        thrusts = [self.random.uniform(0.0, 1.9) if flying and self.often(0.99) else 0.0] * 3
        if self.often(0.01):
            thrusts[1] = rnd.choice((float("nan"), float("inf"), -1.0, 3.5, 3.0, -0.0))
        command = Command(
            epoch=self.epoch,
            counter=self.counter,
            robot_time_us=sent_us if self.often(0.995) else 1,
            nonce=nonce if self.often(0.995) else 0,
            armed=any(thrusts) if self.often(0.99) else False,
            thrusts=tuple(thrusts if self.often(0.995) else thrusts[:2]),
        )
        self.sent = encode_command(command)
        return self.sent


@pytest.mark.parametrize("seed", range(4))
def test_c_and_python_agree_on_every_answer_thrust_and_sample(library, seed):
    traffic = Traffic(seed)
    python, c = RobotEnd(LIMITS, 77), CRobotEnd(library, LIMITS, 77)
    now_us, states, answers = 10_000_000, set(), set()
    for nonce in range(1, 2500):
        now_us += traffic.step_us()
        values = ((0.1, -0.2, nonce), (1.0, 2.0, 9.8), np.full(3, 0.5))
        a = python.sample(now_us, nonce, *values)
        assert a == c.sample(now_us, nonce, *values)
        data = traffic.datagram(python.state, nonce, now_us)
        now_us += traffic.random.choice((0, 0, 3000))
        why = python.receive(data, ("", 0), now_us)
        assert why == c.receive(data, ("", 0), now_us), nonce
        np.testing.assert_allclose(python.setpoint(now_us), c.setpoint(now_us), atol=1e-6)
        states.add(python.state)
        answers.add(why)
    assert states == {*FollowerState} - {FollowerState.COAST}
    assert len(answers) >= 9
