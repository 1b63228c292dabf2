"""A display's lag is found to 3 ms by the pictures of a light that sweeps over it."""

import numpy as np
import pytest

from pipeline.glass.display_lag import MOST_LAG_S, DisplayLagMeter, swept

A_M = 0.1


def film(lag, seconds=3.0, noise_m=3e-4, seed=0, rate_hz=30.0, middle=0.004):
    """(t, right) of each picture of the sweep, for so long."""
    rng, seen = np.random.default_rng(seed), []
    for k in range(int(seconds * rate_hz)):
        t = 100.0 + k / rate_hz
        right = A_M * float(swept(np.array(t - lag))) + middle + noise_m * rng.standard_normal()
        seen.append((t, right))
    return seen


def met(seen):
    """A meter that has seen all that."""
    meter = DisplayLagMeter(A_M)
    for t, right in seen:
        meter.add_position(t, right)
    return meter


def filmed(lag, **options):
    return met(film(lag, **options))


@pytest.mark.parametrize("seed", range(1000, 1005))
@pytest.mark.parametrize("lag", [0.020, 0.040, 0.060, 0.100, 0.0, -0.010])
def test_lags_are_found_to_three_milliseconds(lag, seed):
    found = filmed(lag, noise_m=1e-3, seed=seed).lag()
    assert found is not None
    assert abs(found.value - lag) < 0.003
    assert abs(found.value - lag) < 4.0 * found.sigma
    assert found.is_fit() == (lag <= MOST_LAG_S)


@pytest.mark.parametrize("share", [0.05, 0.15])
def test_pictures_of_another_light_are_left_out(share):
    """As before the sweep is on the glass: then the first pictures show something else."""
    seen, rng = film(0.04, seed=1000), np.random.default_rng(5)
    for k in range(round(share * len(seen))):
        seen[k] = seen[k][0], rng.uniform(-A_M, A_M)
    found = met(seen).lag()
    assert found is not None
    assert abs(found.value - 0.04) < 0.002


def test_where_a_third_shows_another_light_nothing_is_said():
    rng = np.random.default_rng(5)
    seen = [
        (t, right if k % 3 else rng.uniform(-A_M, A_M)) for k, (t, right) in enumerate(film(0.04))
    ]
    assert met(seen).lag() is None


def test_it_is_not_said_before_two_seconds_were_filmed():
    assert filmed(0.04, seconds=1.9).lag() is None


@pytest.mark.parametrize("what", ["still", "noise"])
def test_what_does_not_sweep_gives_no_lag(what):
    rng, meter = np.random.default_rng(3), DisplayLagMeter(A_M)
    for k in range(100):
        meter.add_position(k / 30.0, 0.02 if what == "still" else rng.uniform(-A_M, A_M))
    assert meter.lag() is None


def test_a_light_seen_the_wrong_way_round_is_no_display_one_may_lead_on():
    found = filmed(0.5 + 0.04).lag()
    assert found is not None
    assert not found.is_fit()
