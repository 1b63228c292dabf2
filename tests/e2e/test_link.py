"""Two networks and an emulated line between them, with real sockets; as root on Linux."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hardware.sim.network.channel import CLEAN, Conditions
from hardware.sim.network.emulated_link import EmulatedLink
from hardware.sim.network.netns import Namespace, NamespaceError

pytestmark = pytest.mark.e2e
PORT = 5000
PATIENCE_S = 5.0
LATE = Conditions(delay_s=0.02)


@pytest.fixture
def link() -> Iterator[EmulatedLink]:
    try:
        opened = EmulatedLink(seed=1)
    except NamespaceError as error:
        pytest.skip(f"NO LINK EMULATOR, not tested: {error}")
    with opened:
        yield opened


def bound(namespace: Namespace, kind: socket.SocketKind = socket.SOCK_DGRAM) -> socket.socket:
    one = namespace.run(lambda: socket.socket(socket.AF_INET, kind))
    one.bind((namespace.address, PORT))
    one.settimeout(PATIENCE_S)
    return one


def exchange(link: EmulatedLink, count: int) -> tuple[list[int], list[int]]:
    """Numbered datagrams both ways; gives those that came (at far, at near), in order."""
    with bound(link.near) as near, bound(link.far) as far:
        for number in range(count):
            near.sendto(number.to_bytes(4), (link.far.address, PORT))
            far.sendto(number.to_bytes(4), (link.near.address, PORT))
        deadline = time.monotonic() + PATIENCE_S
        while sum(c.put for c in link.counts()) < 2 * count or not link.is_empty:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        return drained(far), drained(near)


def drained(one: socket.socket) -> list[int]:
    one.setblocking(False)
    numbers = []
    while True:
        try:
            numbers.append(int.from_bytes(one.recv(4)))
        except BlockingIOError:
            return numbers


def test_packets_cross_in_both_directions_each_with_its_own_delay(link: EmulatedLink) -> None:
    link.shape(to_far=LATE)
    with bound(link.near) as near, bound(link.far) as far:
        begun = time.monotonic()
        near.sendto(b"there", (link.far.address, PORT))
        data, address = far.recvfrom(16)
        assert time.monotonic() - begun >= LATE.delay_s
        far.sendto(data + b" and back", address)
        assert near.recv(16) == b"there and back"
    assert link.lateness().worst >= 0.0


def test_what_the_line_loses_is_lost_and_counted_and_the_same_again_with_the_same_seed() -> None:
    came = []
    for _ in range(2):
        try:
            opened = EmulatedLink(Conditions(loss=0.3), Conditions(duplicate=0.5), seed=5)
        except NamespaceError as error:
            pytest.skip(f"NO LINK EMULATOR, not tested: {error}")
        with opened as link:
            to_far, to_near = exchange(link, 100)
            counts = link.counts()
            assert len(to_far) == 100 - counts[0].lost
            assert len(to_near) == 100 + counts[1].duplicated
            assert link.unwritten == 0
            came.append(to_far)
    assert came[0] == came[1]
    assert 50 < len(came[0]) < 90


def test_conditions_change_while_packets_flow(link: EmulatedLink) -> None:
    assert exchange(link, 20) == (list(range(20)), list(range(20)))
    link.shape(to_far=Conditions(dark=True))
    with bound(link.near) as near, bound(link.far) as far:
        near.sendto(b"into the dark", (link.far.address, PORT))
        while link.counts()[0].dark_lost == 0:
            time.sleep(0.005)
        link.shape(to_far=CLEAN)
        near.sendto(b"light", (link.far.address, PORT))
        assert far.recv(16) == b"light"


def test_tcp_brings_all_of_it_over_a_line_that_loses_reorders_and_spoils(
    link: EmulatedLink,
) -> None:
    bad = Conditions(loss=0.02, reorder=0.05, hold_s=0.005, duplicate=0.05, corrupt=0.02)
    link.shape(bad, bad)
    sent = bytes(range(256)) * 400
    with bound(link.far, socket.SOCK_STREAM) as listening:
        listening.listen()
        near = link.near.run(lambda: socket.create_connection((link.far.address, PORT), PATIENCE_S))
        with near, listening.accept()[0] as far:
            far.settimeout(4.0 * PATIENCE_S)
            near.sendall(sent)
            near.shutdown(socket.SHUT_WR)
            came = b""
            while part := far.recv(65_536):
                came += part
    assert came == sent


def test_a_damaged_datagram_reaches_the_program(link: EmulatedLink) -> None:
    link.shape(to_far=Conditions(corrupt=1.0))
    with bound(link.near) as near, bound(link.far) as far:
        near.sendto(bytes(100), (link.far.address, PORT))
        assert sum(byte.bit_count() for byte in far.recv(200)) == 1


def test_a_process_starts_inside_and_sees_that_network_alone(link: EmulatedLink) -> None:
    script = "import socket; print(*(name for _, name in socket.if_nameindex()))"
    done = subprocess.run(
        [sys.executable, "-c", script],
        preexec_fn=link.far.enter_for_life,
        capture_output=True,
        text=True,
    )
    assert set(done.stdout.split()) == {"lo", "wire"}


HOLDER = """
import subprocess, sys
from hardware.sim.network.emulated_link import EmulatedLink
with EmulatedLink() as link:
    inside = subprocess.Popen(["sleep", "600"], preexec_fn=link.far.enter_for_life)
    print(inside.pid, flush=True)
    sys.stdin.read()
"""


def test_killed_outright_it_leaves_no_process_and_no_network_behind(link: EmulatedLink) -> None:
    before = named_namespaces()
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout is not None
    assert holder.stdin is not None
    inside = int(holder.stdout.readline())
    network = network_of(inside)
    assert network != network_of("self")
    assert network in networks_in_use()
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    holder.stdin.close()
    holder.stdout.close()
    deadline = time.monotonic() + PATIENCE_S
    while network in networks_in_use():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert named_namespaces() == before


def network_of(pid: int | str) -> Path:
    return Path(f"/proc/{pid}/ns/net").readlink()


def networks_in_use() -> set[Path]:
    """Of all processes."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/ns/net"):
        try:
            found.add(path.readlink())
        except OSError:  # it has just ended
            continue
    return found


def named_namespaces() -> list[str]:
    folder = Path("/run/netns")
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def test_without_rights_it_says_what_it_takes() -> None:
    script = (
        "from hardware.sim.network.emulated_link import EmulatedLink; "
        "import os; os.setuid(65534); EmulatedLink()"
    )
    if os.geteuid() != 0:
        pytest.skip("not root: the rest of these tests is skipped, with the reason")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert "NamespaceError: no network of its own" in done.stderr
    assert "root" in done.stderr
