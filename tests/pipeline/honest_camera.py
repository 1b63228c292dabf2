"""Honest pictures under all that happens to a phone: nothing in them is a lie.

`python -m tests.pipeline.honest_camera --films 8` watches an hour of them.
"""

from __future__ import annotations

import argparse
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hardware.sim.world.sensors import body_samples, give, phone_samples
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.config import PERIOD_S
from pipeline.estimation.relative_filter import RelativeFilter
from pipeline.estimator_config import RelativeConfig
from pipeline.signals import LedRays, PhoneImu, StampOffset
from pipeline.vision.picture_check import PictureCheck
from tests.pipeline.faulty_camera import Faults, looks
from tests.pipeline.lying_camera import measured

USUAL = Faults(led_m=0.001, focal=1.004, middle_px=(8.0, -8.0), gyro=1.004)
"""Errors of a good calibration and a robot file that somebody measured."""
SECONDS, FIRST = 25.0, 2000
COARSE_S = 4.0
"""After so long the coarse offset tells what dates have become: most of its window."""
BOTH = (True, True)


@dataclass(frozen=True)
class Adversity:
    """What happens; lengths in s."""

    world: dict[str, Any] = field(default_factory=dict)
    clipped: float = 1.0
    """Share of the phone's greatest rate at which its gyroscope ends."""
    body_noise: float = 0.0
    """σ more of the robot's forces [m/s²]; a 50th of it of its rates [rad/s]."""
    hole: tuple[float, float] | None = None
    """Shortest and longest time without samples, every `every`."""
    every: float = 4.0
    restarts: bool = False
    """In a hole there are no pictures either, and no sample of either side."""
    dated: float = 0.0
    """Pictures are dated wrongly by up to so much, either way [s]."""
    stumbles: float = 0.0
    """Share of the pictures that are dated wrongly by 10 to 35 ms."""
    redated: tuple[float, float] = (0.0, 0.0)
    """In the middle of the film pictures become dated so much later for good [s], within so long:
    another exposure, another rate, another way through the browser."""
    occluded: bool = False
    """Some LEDs or all are hidden for up to 2 s, every `every`."""
    refused: float = 0.01
    """Share of the pictures that may be refused."""


LATELY_WORSE = 0.02
"""... where samples or dates are worse than was learnt of them: it takes a second."""


def of_hand(hand: str, **more: Any) -> Adversity:
    """Beside a measured hand."""
    return Adversity({"hand": hand, **more})


ADVERSITIES = {
    "usual": Adversity({"tremor_relaxation": 0.15}),
    **{
        name: of_hand(name)
        for name in ("filming", "walking", "shaken", "quiet", "at_rest", "put_down")
    },
    **{name: of_hand(name) for name in ("before_target", "trembling_6_hz", "trembling_13_hz")},
    "clipped gyroscope": replace(of_hand("shaken"), clipped=0.6),
    "samples lost": of_hand("filming", lost=0.1),
    "samples late and misdated": of_hand("filming", delayed=0.05, stamp_jitter=0.003),
    "samples held": Adversity({"tremor_relaxation": 0.15, "held": (0.01, 0.02)}),
    "samples of a busy browser": Adversity({"tremor_relaxation": 0.15, "held": (0.01, 0.04)}),
    "a browser becomes busy": Adversity(
        {"tremor_relaxation": 0.15, "held": (0.01, 0.04), "held_since": 8.0}, refused=LATELY_WORSE
    ),
    "filming, and becomes busy": replace(
        of_hand("filming", held=(0.01, 0.03), held_since=8.0), refused=LATELY_WORSE
    ),
    "trembling, samples held": of_hand("trembling_13_hz", held=(0.01, 0.03)),
    "pictures misdated": Adversity({"tremor_relaxation": 0.15}, dated=0.012),
    "a browser out of breath": Adversity(
        {"tremor_relaxation": 0.15, "held": (0.01, 0.03)}, dated=0.015, refused=LATELY_WORSE
    ),
    "dates that stumble": Adversity(
        {"tremor_relaxation": 0.15, "held": (0.01, 0.02)}, stumbles=0.04
    ),
    "filming, dates that stumble": replace(of_hand("filming", held=(0.01, 0.02)), stumbles=0.04),
    "a starved browser": Adversity(
        {"tremor_relaxation": 0.15, "held": (0.01, 0.03), "lost": 0.4},
        stumbles=0.04,
        refused=LATELY_WORSE,
    ),
    "a longer exposure": replace(of_hand("filming"), redated=(-0.008, 0.5)),
    "a shorter exposure": replace(of_hand("walking"), redated=(0.008, 0.3)),
    "dates half a frame earlier": Adversity({"tremor_relaxation": 0.15}, redated=(-0.016, 0.0)),
    "propellers shake": replace(of_hand("filming"), body_noise=1.0),
    "a slow line": of_hand("filming", time_offset=0.06, picture_delay=(0.1, 0.25)),
    "holes": replace(of_hand("walking"), hole=(0.1, 0.6)),
    "occlusion": replace(of_hand("walking"), occluded=True),
    "restarts": replace(of_hand("filming"), hole=(0.5, 4.0), every=9.0, restarts=True),
}


def judged(name: str, seed: int, seconds: float) -> tuple[int, int, dict[str, float]]:
    """Pictures, those not believed, and when [s] something was complained of first."""
    it = ADVERSITIES[name]
    told = {"time_offset": 0.03, **it.world, "seed": seed, "duration": seconds}
    world = World(WorldOptions(**told))
    rng = np.random.default_rng((seed, 77))
    check, pictures, refused, named = PictureCheck(LEDS_IN_B), 0, 0, dict[str, float]()
    happening = [*_samples(world, it, rng), *_pictures(world, it, rng)]
    for _, event in sorted(_arriving(happening, world, it, rng), key=lambda one: one[0]):
        if hasattr(event, "rays"):
            pictures, believed = pictures + 1, check.judge(event).is_believed
            refused += not believed
            if check.complaint:
                named.setdefault(check.complaint, event.t)
        else:
            check.add_imu(event)
    return pictures, refused, named


def followed(name: str, seed: int, seconds: float) -> tuple[float, float]:
    """Farthest error [m] of the default estimator behind the check, and its largest σ [m].

    From 5 s on; what is off throughout is the calibration's, and left out.
    """
    it = ADVERSITIES[name]
    world = World(WorldOptions(**{"time_offset": 0.03, **it.world, "seed": seed}, duration=seconds))
    rng = np.random.default_rng((seed, 77))
    check, estimator = PictureCheck(LEDS_IN_B), RelativeFilter(RelativeConfig(), LEDS_IN_B)
    happening = [*_samples(world, it, rng), *_pictures(world, it, rng)]
    queue = deque(sorted(_arriving(happening, world, it, rng), key=lambda one: one[0]))
    off, sigma = [], 0.0
    for now in np.arange(0.1, seconds - 0.01, PERIOD_S).tolist():
        while queue and queue[0][0] <= now:
            event = queue.popleft()[1]
            if hasattr(event, "rays"):
                estimator.add_seen(check.believed(event), now)
            else:
                check.add_imu(event)
                give(estimator, event, now)
        state = estimator.state(now)
        if state is not None and now > 5.0:
            off.append(state.p_bc_in_c - world.p[world.index(state.t)])
            sigma = max(sigma, state.sigma_p)
    errors = np.array(off) - np.median(off, axis=0)
    return float(np.linalg.norm(errors, axis=1).max()), sigma


def _samples(world, it, rng):
    phone = [(t, one, USUAL.gyro * one.omega_m_cf_in_c) for t, one in phone_samples(world)]
    most = it.clipped * max(float(np.abs(omega).max()) for _, _, omega in phone)
    for t, one, omega in phone:
        yield t, replace(one, omega_m_cf_in_c=np.clip(omega, -most, most))
    for t, one in body_samples(world):
        omega, force = rng.normal(0.0, it.body_noise, (2, 3))
        yield (
            t,
            replace(
                one,
                omega_m_bf_in_b=one.omega_m_bf_in_b + omega / 50.0,
                a_m_bf_in_b=one.a_m_bf_in_b + force,
            ),
        )


def _pictures(world, it, rng):
    truth, middle = world.setup.time_offset, 0.5 * world.setup.duration
    hidden = _windows(world, it.every, (0.1, 2.0), rng) if it.occluded else []
    shown = [int(rng.integers(len(LEDS_IN_B))) for _ in hidden]
    told = zip(world.pictures.arrival.tolist(), looks(world, USUAL, world.setup.seed), strict=True)
    for arrival, look in told:
        t = look.t + rng.uniform(-it.dated, it.dated)
        if it.stumbles and rng.uniform() < it.stumbles:
            t += rng.choice((-1.0, 1.0)) * rng.uniform(0.010, 0.035)
        t += it.redated[0] * min(max((look.t - middle) / max(it.redated[1], 1e-9), 0.0), 1.0)
        later = it.redated[0] if arrival > middle + COARSE_S else 0.0
        offset = StampOffset(truth + 0.002 - later, 0.002, max(look.t - 5.0, 0.0))
        seen = measured(replace(look, t=t), offset if arrival > 0.5 else None)
        for (begin, end), n in zip(hidden, shown, strict=True):
            if begin < look.t < end:
                rays = seen.rays
                first = LedRays(rays.led[:n], rays.t[:n], rays.tangents[:n], rays.covariances[:n])
                seen = replace(seen, rays=first, pose=seen.pose if n > 3 else None)
        yield arrival, seen


def _arriving(happening, world, it, rng):
    setup = world.setup
    holes = [] if it.hole is None else _windows(world, it.every, it.hole, rng)
    silent = [BOTH if it.restarts else ((True, False), (False, True))[k % 2] for k in range(99)]
    for arrival, event in happening:
        is_picture, side = hasattr(event, "rays"), 0 if isinstance(event, PhoneImu) else 1
        inside = [k for k, (begin, end) in enumerate(holes) if begin < event.t < end]
        if any(it.restarts if is_picture else silent[k][side] for k in inside):
            continue
        if rng.uniform() < setup.lost:
            continue
        late = not is_picture and rng.uniform() < setup.delayed
        yield arrival + (rng.uniform(0.0, 0.1) if late else 0.0), event


def _windows(world, every, lengths, rng):
    return [(t, t + rng.uniform(*lengths)) for t in np.arange(3.0, world.setup.duration, every)]


def main() -> int:
    """Watch films of all adversities; the exit code is 1 if anything was complained of."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--films", type=int, default=1, help="of each sort")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each film")
    parser.add_argument("--first", type=int, default=FIRST, help="seed")
    arguments = parser.parse_args()
    alarms = 0
    for name in ADVERSITIES:
        films = [
            judged(name, arguments.first + k, arguments.seconds) for k in range(arguments.films)
        ]
        pictures, refused = (sum(film[k] for film in films) for k in (0, 1))
        named = [film[2] for film in films if film[2]]
        alarms += len(named)
        print(f"{name:26} {pictures:6} pictures, {refused:3} refused, {named or 'no alarm'}")
    minutes = arguments.films * len(ADVERSITIES) * arguments.seconds / 60.0
    print(f"{minutes:.1f} min: alarms in {alarms} films")
    return int(alarms > 0)


if __name__ == "__main__":
    raise SystemExit(main())
