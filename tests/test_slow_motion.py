"""In slow motion every clock of a process is slow alike, and whoever waits waits by it."""

from __future__ import annotations

import json
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests import slow_motion

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="NO LINUX, not tested"),
    pytest.mark.skipif(shutil.which("gcc") is None, reason="NO COMPILER, not tested: gcc"),
]
SLOWER = 3.0
STEP_S = 0.01
"""Of /proc/uptime, here the world's clock, and of what is told of CPU time."""
WAIT_S = 0.2
WAYS = 26
LONG_AGO_NS = 10**12
"""Then slow motion began: by now its clocks are 11 minutes behind the world's."""
LIVED = """
import asyncio, ctypes, json, resource, select, signal, socket, struct, threading, time
from pathlib import Path

def world():
    return float(Path("/proc/uptime").read_text().split()[0])

libc = ctypes.CDLL(None)
pair = socket.socketpair()
pair[0].setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 0, int(1e6 * WAIT_S)))
signal.signal(signal.SIGALRM, lambda *_: None)

class Timespec(ctypes.Structure):
    _fields_ = [("s", ctypes.c_long), ("ns", ctypes.c_long)]

def moment(clock):
    ns = time.clock_gettime_ns(clock) + int(1e9 * WAIT_S)
    return ctypes.byref(Timespec(ns // 10**9, ns % 10**9))

MS = int(1e3 * WAIT_S)
DURATION = ctypes.byref(Timespec(0, int(1e9 * WAIT_S)))

def condition(clock, name, *by):
    mutex, one, kind = (ctypes.create_string_buffer(128) for _ in range(3))
    libc.pthread_mutex_init(mutex, None)
    libc.pthread_condattr_init(kind)
    libc.pthread_condattr_setclock(kind, clock)
    libc.pthread_cond_init(one, kind)
    libc.pthread_mutex_lock(mutex)
    getattr(libc, name)(one, mutex, *by, moment(clock))

def semaphore(name, clock, *by):
    one = ctypes.create_string_buffer(64)
    libc.sem_init(one, 0, 0)
    getattr(libc, name)(one, *by, moment(clock))

def futex(what, t):
    word = ctypes.c_int(0)
    libc.syscall(202 if MACHINE == "x86_64" else 98, ctypes.byref(word), what, 0, t, None, -1)

def timer(is_moment):
    file = libc.timerfd_create(time.CLOCK_MONOTONIC, 0)
    ns = int(1e9 * WAIT_S) + (time.monotonic_ns() if is_moment else 0)
    libc.timerfd_settime(file, is_moment, (ctypes.c_long * 4)(0, 0, ns // 10**9, ns % 10**9), None)
    select.select([file], [], [])

def alarm():
    signal.setitimer(signal.ITIMER_REAL, WAIT_S)
    signal.pause()

def polled(kind):
    one = kind()
    one.register(pair[0], select.POLLIN)
    one.poll(1e3 * WAIT_S if kind is select.poll else WAIT_S)

def received():
    try:
        pair[0].recv(1)
    except BlockingIOError:
        pass

REAL, MONO = time.CLOCK_REALTIME, time.CLOCK_MONOTONIC
WAYS = {
    "sleep": lambda: time.sleep(WAIT_S),
    "nanosleep": lambda: libc.nanosleep(DURATION, None),
    "usleep": lambda: libc.usleep(int(1e6 * WAIT_S)),
    "clock_nanosleep": lambda: libc.clock_nanosleep(MONO, 0, DURATION, None),
    "clock_nanosleep until": lambda: libc.clock_nanosleep(REAL, 1, moment(REAL), None),
    "lock": lambda: [lock := threading.Lock(), lock.acquire(), lock.acquire(timeout=WAIT_S)],
    "asyncio": lambda: asyncio.run(asyncio.sleep(WAIT_S)),
    "select": lambda: select.select([], [], [], WAIT_S),
    "pselect": lambda: libc.pselect(0, None, None, None, DURATION, None),
    "poll": lambda: polled(select.poll),
    "ppoll": lambda: libc.ppoll(None, 0, DURATION, None),
    "epoll": lambda: polled(select.epoll),
    "epoll_pwait": lambda: libc.epoll_pwait(libc.epoll_create1(0), bytes(12), 1, MS, None),
    "condition realtime": lambda: condition(REAL, "pthread_cond_timedwait"),
    "condition monotonic": lambda: condition(MONO, "pthread_cond_timedwait"),
    "condition of a clock": lambda: condition(MONO, "pthread_cond_clockwait", MONO),
    "semaphore": lambda: semaphore("sem_timedwait", REAL),
    "semaphore of a clock": lambda: semaphore("sem_clockwait", MONO, MONO),
    "futex": lambda: futex(0, DURATION),
    "futex until": lambda: futex(9, moment(MONO)),
    "futex until realtime": lambda: futex(9 | 256, moment(REAL)),
    "timer": lambda: timer(0),
    "timer until": lambda: timer(1),
    "alarm": alarm,
    "receive": received,
}

def of_day():
    t = (ctypes.c_long * 2)()
    libc.gettimeofday(t, None)
    return t[0] + 1e-6 * t[1]

def asked():
    t = Timespec()
    libc.syscall(228 if MACHINE == "x86_64" else 113, REAL, ctypes.byref(t))
    return t.s + 1e-9 * t.ns

def used():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime

KINDS = (time.CLOCK_MONOTONIC_RAW, time.CLOCK_BOOTTIME, 5, 6)  # the last two are coarse
CLOCKS = [time.time, time.monotonic, of_day, asked]
CLOCKS += [lambda kind=kind: time.clock_gettime(kind) for kind in KINDS]
CPU = [time.process_time, time.thread_time, used, lambda: 1e-6 * libc.clock()]

def work():
    while time.process_time() < end:
        pass

def lived(clocks, wait):
    began = world(), [clock() for clock in clocks]
    wait()
    own = [clock() - t for clock, t in zip(clocks, began[1])]
    return world() - began[0], own

assert int(time.time()) <= libc.time(None) <= time.time()
began = time.monotonic()
libc.sleep(1)
assert time.monotonic() - began > 0.99
end = time.process_time() + WAIT_S
told = {name: lived(CLOCKS, wait) for name, wait in WAYS.items()}
print(json.dumps(told | {"work": lived(CPU, work)}))
"""


def test_each_way_to_wait_lasts_as_long_by_its_own_clocks_and_longer_by_the_worlds(
    tmp_path: Path,
) -> None:
    lived = slow_motion.environment(SLOWER, tmp_path)
    long_ago = (int(ns) - LONG_AGO_NS for ns in lived[slow_motion.SINCE].split())
    lived[slow_motion.SINCE] = " ".join(map(str, long_ago))
    head = f"WAIT_S, MACHINE = {WAIT_S}, {platform.machine()!r}\n"
    done = subprocess.run(
        [sys.executable, "-c", head + LIVED],
        env=lived,
        capture_output=True,
        text=True,
        check=True,
    )
    told: dict[str, tuple[float, list[float]]] = json.loads(done.stdout)
    assert len(told) == WAYS
    for name, (world_s, own_s) in told.items():
        print(name, world_s, own_s)
        assert min(own_s) >= WAIT_S - STEP_S, f"{name}: too short by its own clocks"
        assert max(own_s) <= (world_s + STEP_S) / SLOWER + STEP_S, f"{name}: a clock is not slow"
