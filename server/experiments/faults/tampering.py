"""What faults do to datagrams and to control's inputs; repeatable for a seed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.signals import PhoneImu, TouchState, VisionMeasurement
from server.control.ipc_inputs import Input

Datagrams = Callable[[bytes], Sequence[bytes]]
Inputs = Callable[[list[Input]], list[Input]]
Change = Callable[[PhoneImu], PhoneImu]
PictureChange = Callable[[VisionMeasurement], VisionMeasurement]


def nothing(_: bytes) -> Sequence[bytes]:
    """All are lost."""
    return ()


def twice(data: bytes) -> Sequence[bytes]:
    """Each comes twice."""
    return data, data


def late(ticks: int) -> Datagrams:
    """Each comes so many ticks later."""
    waiting: deque[bytes] = deque()

    def hold(data: bytes) -> Sequence[bytes]:
        waiting.append(data)
        return (waiting.popleft(),) if len(waiting) > ticks else ()

    return hold


def replayed(ticks: int) -> Datagrams:
    """Beside each comes the one of so many ticks ago."""
    kept: deque[bytes] = deque(maxlen=ticks + 1)

    def repeat(data: bytes) -> Sequence[bytes]:
        kept.append(data)
        return (data, kept[0]) if len(kept) > ticks else (data,)

    return repeat


def spoilt(share: float, seed: int) -> Datagrams:
    """A share of them has a bit turned."""
    rng = np.random.default_rng((seed, 31))

    def turn(data: bytes) -> Sequence[bytes]:
        if rng.uniform() >= share:
            return (data,)
        damaged = bytearray(data)
        bit = int(rng.integers(8 * len(data)))
        damaged[bit // 8] ^= 1 << bit % 8
        return (bytes(damaged),)

    return turn


def flooded(count: int, seed: int) -> Datagrams:
    """Garbage before each."""
    rng = np.random.default_rng((seed, 37))

    def flood(data: bytes) -> Sequence[bytes]:
        return (*(rng.bytes(int(rng.integers(1, 200))) for _ in range(count)), data)

    return flood


def motion(change: Change) -> Inputs:
    """The phone's motion samples are other ones."""
    return lambda inputs: [change(one) if isinstance(one, PhoneImu) else one for one in inputs]


def no_number(sample: PhoneImu) -> PhoneImu:
    """Rates that are none."""
    return replace(sample, omega_m_cf_in_c=np.full(3, np.nan))


def infinite(sample: PhoneImu) -> PhoneImu:
    """An endless force."""
    return replace(sample, a_m_cf_in_c=np.array((np.inf, 0.0, 0.0)))


def turned_axes(sample: PhoneImu) -> PhoneImu:
    """Rates about x, y, z come as those about y, z, x."""
    return replace(sample, omega_m_cf_in_c=np.roll(sample.omega_m_cf_in_c, -1))


def turned_sign(sample: PhoneImu) -> PhoneImu:
    """Accelerations point the other way."""
    return replace(sample, a_m_cf_in_c=-sample.a_m_cf_in_c)


def stale_touch() -> Inputs:
    """The last touch again and again, with the age that it has."""
    last: list[TouchState] = []

    def repeat(inputs: list[Input]) -> list[Input]:
        others = [one for one in inputs if not isinstance(one, TouchState)]
        if not last:
            last.extend(one for one in inputs if isinstance(one, TouchState))
        return [*others, *last[:1]]

    return repeat


def pictures(change: PictureChange) -> Inputs:
    """What pictures say is something else."""
    return lambda inputs: [
        change(one) if isinstance(one, VisionMeasurement) else one for one in inputs
    ]


def frozen() -> PictureChange:
    """Each picture shows what the first one did, with its own time."""
    first: list[VisionMeasurement] = []

    def freeze(seen: VisionMeasurement) -> VisionMeasurement:
        first.append(seen)
        return stamped(first[0], seen.t - first[0].t)

    return freeze


def repeated(times: int) -> PictureChange:
    """Each picture is shown so often, with the time of the showing."""
    shown: list[VisionMeasurement] = []

    def repeat(seen: VisionMeasurement) -> VisionMeasurement:
        shown.append(seen)
        first = shown[(len(shown) - 1) // times * times]
        return stamped(first, seen.t - first.t)

    return repeat


def stamped(seen: VisionMeasurement, later_s: float) -> VisionMeasurement:
    """Give a picture another time."""
    rays = replace(seen.rays, t=seen.rays.t + later_s)
    pose = replace(seen.pose, t=seen.pose.t + later_s) if seen.pose is not None else None
    return replace(seen, t=seen.t + later_s, rays=rays, pose=pose)


def too_old(seen: VisionMeasurement) -> VisionMeasurement:
    """A picture that is said to be 0.1 s older than it is."""
    return stamped(seen, -0.1)


def mixed_up(seen: VisionMeasurement) -> VisionMeasurement:
    """LEDs have each other's names, and the pose is that of them."""
    return replace(seen, rays=replace(seen.rays, led=np.roll(seen.rays.led, -1)), pose=None)


def beside_itself(seen: VisionMeasurement) -> VisionMeasurement:
    """A place that is no number."""
    beside = seen.rays.tangents * (np.nan, 1.0)
    return replace(seen, rays=replace(seen.rays, tangents=beside))
