"""What faults do to datagrams and to control's inputs; repeatable for a seed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from server.control.ipc import Input, OperatorInput, PhoneImuInput
from server.control.ipc_vision import SeenInput

Datagrams = Callable[[bytes], Sequence[bytes]]
Inputs = Callable[[list[Input]], list[Input]]
Change = Callable[[PhoneImuInput], PhoneImuInput]


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
    return lambda inputs: [change(one) if isinstance(one, PhoneImuInput) else one for one in inputs]


def no_number(sample: PhoneImuInput) -> PhoneImuInput:
    """Rates that are none."""
    return msgspec.structs.replace(sample, omega=(float("nan"),) * 3)


def infinite(sample: PhoneImuInput) -> PhoneImuInput:
    """An endless force."""
    return msgspec.structs.replace(sample, a=(float("inf"), 0.0, 0.0))


def turned_axes(sample: PhoneImuInput) -> PhoneImuInput:
    """Rates about x, y, z come as those about y, z, x."""
    x, y, z = sample.omega
    return msgspec.structs.replace(sample, omega=(y, z, x))


def turned_sign(sample: PhoneImuInput) -> PhoneImuInput:
    """Accelerations point the other way."""
    x, y, z = sample.a
    return msgspec.structs.replace(sample, a=(-x, -y, -z))


def stuck() -> Change:
    """Each sample says what the first one said."""
    first: list[PhoneImuInput] = []

    def stick(sample: PhoneImuInput) -> PhoneImuInput:
        first.append(sample)
        return msgspec.structs.replace(sample, omega=first[0].omega, a=first[0].a)

    return stick


def stale_touch() -> Inputs:
    """The last touch again and again, with the age that it has."""
    last: list[OperatorInput] = []

    def repeat(inputs: list[Input]) -> list[Input]:
        others = [one for one in inputs if not isinstance(one, OperatorInput)]
        if not last:
            last.extend(one for one in inputs if isinstance(one, OperatorInput))
        return [*others, *last[:1]]

    return repeat


def pictures(change: Callable[[SeenInput], SeenInput]) -> Inputs:
    """What pictures say is something else."""
    return lambda inputs: [change(one) if isinstance(one, SeenInput) else one for one in inputs]


def frozen() -> Callable[[SeenInput], SeenInput]:
    """Each picture shows what the first one did, with its own time."""
    first: list[SeenInput] = []

    def freeze(seen: SeenInput) -> SeenInput:
        first.append(seen)
        return stamped(first[0], seen.t - first[0].t)

    return freeze


def repeated(times: int) -> Callable[[SeenInput], SeenInput]:
    """Each picture is shown so often, with the time of the showing."""
    shown: list[SeenInput] = []

    def repeat(seen: SeenInput) -> SeenInput:
        shown.append(seen)
        first = shown[(len(shown) - 1) // times * times]
        return stamped(first, seen.t - first.t)

    return repeat


def stamped(seen: SeenInput, later_s: float) -> SeenInput:
    """Give a picture another time."""
    change = msgspec.structs.replace
    leds = [change(led, t=led.t + later_s) for led in seen.leds]
    pose = change(seen.pose, t=seen.pose.t + later_s) if seen.pose is not None else None
    return change(seen, t=seen.t + later_s, leds=leds, pose=pose)


def too_old(seen: SeenInput) -> SeenInput:
    """A picture that is said to be 0.1 s older than it is."""
    return stamped(seen, -0.1)


def mixed_up(seen: SeenInput) -> SeenInput:
    """LEDs have each other's names, and the pose is that of them."""
    names = [led.led for led in seen.leds]
    change = msgspec.structs.replace
    leds = [
        change(led, led=name) for led, name in zip(seen.leds, names[1:] + names[:1], strict=True)
    ]
    return change(seen, leds=leds, pose=None)


def beside_itself(seen: SeenInput) -> SeenInput:
    """A place that is no number."""
    change = msgspec.structs.replace
    leds = [change(led, tangents=(float("nan"), led.tangents[1])) for led in seen.leds]
    return change(seen, leds=leds)
