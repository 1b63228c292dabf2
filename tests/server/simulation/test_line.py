"""What a phone's line does in virtual time: nothing twice, nothing too soon, in order."""

from __future__ import annotations

from functools import partial

from hypothesis import given
from hypothesis import strategies as st

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.simulation.line import Kind, Transit
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

TICKS = st.lists(st.integers(0, 400), max_size=40).map(sorted)


class Odd:
    """Loses every third, holds every second back until the next full second."""

    def __init__(self) -> None:
        self.count = 0

    def out(self, t: float, kind: Kind) -> float | None:
        self.count += 1
        if self.count % 3 == 0:
            return None
        return float(int(t) + 1) if self.count % 2 == 0 else t


@given(TICKS)
def test_what_is_not_lost_comes_once_and_never_before_the_line_lets_it(ticks: list[int]) -> None:
    transit, came = Transit(), list[tuple[int, float]]()
    transit.line = Odd()
    now = [0.0]

    def take(number: int) -> None:
        came.append((number, now[0]))

    for number, tick in enumerate(ticks):
        now[0] = 0.005 * tick
        transit.deliver(now[0])
        transit.send(now[0], "motion", partial(take, number))
    now[0] = 10.0
    transit.deliver(now[0])
    again = Odd()
    due = {n: again.out(0.005 * tick, "motion") for n, tick in enumerate(ticks)}
    through = {n: t for n, t in due.items() if t is not None}
    assert sorted(n for n, _ in came) == sorted(through)
    assert transit.lost == len(due) - len(through)
    assert all(t >= through[n] for n, t in came)


@given(TICKS)
def test_a_clean_line_keeps_the_order_and_the_time(ticks: list[int]) -> None:
    transit, came = Transit(), list[int]()
    for number, tick in enumerate(ticks):
        transit.send(0.005 * tick, "touch", partial(came.append, number))
        transit.deliver(0.005 * tick)
        assert came == list(range(number + 1))


class Dark:
    """Loses all from a second on."""

    def out(self, t: float, kind: Kind) -> float | None:
        return t if t < 1.0 else None


def test_a_dark_line_keeps_everything_of_the_phone_from_control() -> None:
    loop = VirtualTimeSimulation(
        load_robot("ames"), TeleopConfig(), SimulationOptions(seed=3, led_noise_px=0.02)
    )
    loop.transit.line = Dark()
    ages = loop.advance().ages
    while loop.t < 1.5:
        ages = loop.advance().ages
    assert min(ages.operator, ages.phone_imu, ages.pose) > 0.45
    assert ages.body_imu < 0.02
