"""The default estimator: LED rays and two IMUs in an error-state filter on SO(3), 22 states.

`gravity_free` says what moves, `out_of_sequence` when each picture is fused, this file what to
believe: where to start, which pictures to refuse, when to begin again, and how much is known.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from pipeline.estimation.adaptive_noise import AdaptiveNoise
from pipeline.estimation.aliased_tone import AliasedTone
from pipeline.estimation.bias_steps import BiasSteps
from pipeline.estimation.date_noise import DateNoise
from pipeline.estimation.estimator import MAX_SLEEP_S, Fusion, Health
from pipeline.estimation.misdated_picture import STUMBLE_S, MisdatedPictures
from pipeline.estimation.out_of_sequence import Checkpoint
from pipeline.estimation.relative_kernels import BIASES, OFFSET, X_BIASES, X_OFFSET, N, X
from pipeline.estimation.relative_noise import initial_biases
from pipeline.estimation.relative_start import (
    Learnt,
    can_start,
    correct_by_pose,
    first_checkpoint,
    is_better_start,
)
from pipeline.estimation.relative_track import RelativeTrack
from pipeline.estimation.sanity import is_believable, is_imu_sample
from pipeline.estimation.sensor_doubts import MEND_TONE, aliased_tones, sensor_doubts
from pipeline.estimation.spot_noise import SpotNoise
from pipeline.estimation.told_motion import for_body
from pipeline.estimation.tones import PICTURES, Tones
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import Array, log
from pipeline.robot import ToldMotion
from pipeline.signals import (
    BodyImu,
    PhoneImu,
    RelativePose,
    RelativeState,
    StampOffset,
    VisionMeasurement,
)
from pipeline.so3_kernels import largest_sigma
from pipeline.timing.offset_watch import OffsetMonitor

DATED_S: Final = 0.005
"""While the pictures' time is known worse [s], a miss tells of it, not of the motion samples."""
ONE_DATE_S: Final = 0.002
"""While it is known worse [s], a miss along the motion tells of it, not of one picture's date."""
FRESH_S: Final = 2.0
"""A restart so soon after the last one: what was kept of the sensors is wrong as well."""
NIS_PICTURES: Final = 30
"""Over which the innovations are averaged: a second."""


class RelativeFilter:
    """Relative pose and motion at any time from LED rays and two IMUs."""

    def __init__(
        self, config: RelativeConfig, leds_in_b: Array, motion: ToldMotion | None = None
    ) -> None:
        """Knows nothing until the first picture with a pose and samples of both sides near it.

        `motion` is how a robot without motion sensors on its body tells its own.
        """
        self._motion, self._leds_in_b = motion, leds_in_b
        self._config = config = for_body(config, motion)
        self._initial = initial_biases(config)
        if not config.body_steps:
            self._initial[:2] = 0.0
        self.pictures: Counter[Fusion] = Counter()
        """What became of them."""
        self.leds_rejected = 0
        self.samples_late = self.samples_duplicate = self.samples_invalid = 0
        """IMU samples not used: from before the horizon, there already, nonsense or from the
        future."""
        self.failures = 0
        """Times the estimate was thrown away: not finite, or asleep for too long."""
        self._now = np.inf
        self.reset()

    def reset(self) -> None:
        """Forget everything but the counts."""
        self._track = RelativeTrack(self._config, self._leds_in_b, self._motion)
        self._started = False
        self._learnt: Learnt | None = None
        self._recent: deque[float] = deque(maxlen=64)
        self._misses, self._t_seen, self._t_start = 0, -np.inf, -np.inf
        self._nis: deque[tuple[float, int]] = deque(maxlen=NIS_PICTURES)
        self._offset = OffsetMonitor()
        self._adaptive_noise, self._spot_noise = AdaptiveNoise(), SpotNoise()
        self._date_noise = DateNoise()
        self._bias_steps, self._misdated = BiasSteps(self._initial), MisdatedPictures()
        self._off, self._aliased = Tones(PICTURES), AliasedTone()

    def add_phone_imu(self, sample: PhoneImu) -> None:
        """Remember a sample of the phone, in any order; what can't be used is counted."""
        t, rate, force = sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c
        insert = partial(self._track.insert, self._track.phone, t, rate, force)
        self._remember(t, rate, force, insert)

    def add_body_imu(self, sample: BodyImu) -> None:
        """Remember a sample of the robot, in any order; what can't be used is counted."""
        rate, force = sample.omega_m_bf_in_b, sample.a_m_bf_in_b
        insert = partial(self._track.insert_body, sample)
        is_used = self._remember(sample.t, rate, force, insert)
        if is_used and self._config.body_steps:  # what is told shakes nothing
            self._aliased.feel(sample.t, rate, force)

    def _remember(self, t: float, rate: Array, force: Array, insert: Callable[[], bool]) -> bool:
        """Whether it can be used."""
        if not is_imu_sample(t, rate, force) or t > self._now + MAX_SLEEP_S:
            self.samples_invalid += 1
        elif self._started and t <= self._track.base.t:
            self.samples_late += 1
        elif not insert():
            self.samples_duplicate += 1
        else:
            return True
        return False

    def add_seen(self, seen: VisionMeasurement, now: float) -> Fusion:
        """Fuse the LEDs of a picture when it was taken; tells, and counts, what became of it."""
        fusion = self._judge(seen, now)
        self.pictures[fusion] += 1
        return fusion

    def _judge(self, seen: VisionMeasurement, now: float) -> Fusion:
        if not is_believable(seen, len(self._leds_in_b)):
            return Fusion.INVALID
        if len(seen.rays) == 0:
            return Fusion.BLIND
        if seen.t > now:
            return Fusion.EARLY
        if seen.t in self._recent:
            return Fusion.DUPLICATE
        if now - seen.t > self._config.horizon_s:
            return Fusion.LATE
        self._keep_up(now)
        if seen.offset is not None:
            self._offset.coarse = seen.offset
        seen = self._spot_noise.inflated(seen)
        if not self._started:
            return self._start(seen, now)
        t = seen.t + float(self._track.newest.x[X_OFFSET])
        if t <= self._track.base.t:
            return Fusion.LATE
        if self._track.tone is None and self._aliased.tone is not None:
            # it may have seemed to be one, or to be the phone's
            self._bias_steps.walks[:] = 0.0
            self._adaptive_noise = AdaptiveNoise()
            self._track.walk(self._bias_steps.walks)
            self._track.doubt_phone(1.0)
        self._track.sway(self._aliased.tone)
        # gating in this order: a prediction too unsure to gate by is corrected by the pose, or
        # replaced; then what the sensors may be off by inflates it, before each LED is gated by it
        predicted = self._track.predicted(min(t, now))
        if is_better_start(seen, predicted.P, self._config) and (
            self._carry_on(seen, predicted) or self._start(seen, now)
        ):
            return Fusion.STARTED
        return self._fuse(seen, predicted, now)

    def _doubted(
        self, seen: VisionMeasurement, predicted: Checkpoint[VisionMeasurement]
    ) -> tuple[VisionMeasurement, float]:
        """What is believed of it, and how far what is predicted must be doubted for it.

        Learns of the sensors, if it is not the date that is wrong.
        """
        variance = float(self._track.newest.P[OFFSET, OFFSET])
        dated = variance < DATED_S**2
        track, passing = self._track, self._track.passing(predicted)
        if seen.pose is None or not dated or not can_start(seen, self._config):
            return self._by_its_date(seen, predicted, passing), 1.0
        e, P = _missed(seen.pose, predicted), track.in_picture(predicted)
        if variance < ONE_DATE_S**2:
            self._date_noise.learn(e, P + seen.pose.covariance, passing)
        seen = self._by_its_date(seen, predicted, passing)
        assert seen.pose is not None
        C = seen.pose.covariance
        self._off.add(seen.t, e[3:], e[:3])
        self._aliased.miss(seen.t, e, walks=bool(self._bias_steps.walks.any()))
        if variance < ONE_DATE_S**2:
            misdated = self._misdated.explained(seen, self._leds_in_b, e, P + C, passing)
            if misdated is not None:
                return misdated, 1.0
            # a robot that only tells its motion may have done another one: it dates no picture
            if self._misdated.are_redated and self._motion is None:
                track.redate(STUMBLE_S)
                predicted.copy(track.predicted(predicted.t))
                return seen, 1.0
        moved = self._bias_steps.learn(predicted.t, e, P + C, predicted.P)
        track.walk(self._bias_steps.walks)
        if moved.any():
            track.moved(moved)
            predicted.copy(track.predicted(predicted.t))
            e, P = _missed(seen.pose, predicted), track.in_picture(predicted)
            self._adaptive_noise = AdaptiveNoise()  # another sensor was at fault
        inflation = self._adaptive_noise.judge(e, P, C)
        track.doubt_phone(self._adaptive_noise.factor)
        return seen, inflation

    def _by_its_date(
        self, seen: VisionMeasurement, at: Checkpoint[VisionMeasurement], passing: Array
    ) -> VisionMeasurement:
        return self._date_noise.inflated(seen, self._leds_in_b, at.x[0:3], at.R, passing)

    def _fuse(
        self, seen: VisionMeasurement, here: Checkpoint[VisionMeasurement], now: float
    ) -> Fusion:
        """Fuse, or begin again when too many pictures in a row didn't fit."""
        seen, inflation = self._doubted(seen, here)
        chi2 = self._track.fuse(here, seen, len(seen.rays), inflation)
        self._recent.append(seen.t)
        used = int((here.use == 1).sum()) if here.use is not None else 0
        self.leds_rejected += len(seen.rays) - used
        # soundness before statistics: NaN must reach neither χ² nor the counts of misses
        if not np.isfinite(chi2):
            self._give_up()
            return self._start(seen, now)
        if used:
            self._nis.append((chi2, 2 * used))
            self._spot_noise.learn(*self._track.misfit(here))
        if 2 * used > len(seen.rays):
            self._misses = 0
        else:
            self._misses += 1
            hopeless = self._misses >= self._config.misses_before_restart
            if hopeless and can_start(seen, self._config):
                return self._start(seen, now)
        if used:
            self._t_seen = max(self._t_seen, seen.t)
        newest = self._track.newest
        if self._track.tone is not None:
            self._aliased.judge(newest.t, *self._track.amplitudes)
        surer = self._offset.surer(*_learnt_offset(newest))
        # a base that knows it better has pictures after it whose dates are doubted
        if surer is not None and self._offset.surer(*_learnt_offset(self._track.base)) is not None:
            self._track.date(surer)
        value, sigma = _learnt_offset(newest)
        if self._offset.must_begin_again(value, sigma, seen.t):
            self._t_start = seen.t  # nothing learnt at a wrong time is worth keeping
            self._bias_steps, self._adaptive_noise = BiasSteps(self._initial), AdaptiveNoise()
            self._track.walk(self._bias_steps.walks)
            self._track.doubt_phone(1.0)
            return self._start(seen, now)
        return Fusion.FUSED if used else Fusion.GATED

    def _start(self, seen: VisionMeasurement, now: float) -> Fusion:
        """Begin at a pose, the body at rest in f; what was learnt of the sensors stays."""
        if not can_start(seen, self._config):
            return Fusion.BLIND
        if self._track.body.near(seen.t) is None or self._track.phone.near(seen.t) is None:
            return Fusion.WAITING
        if self._started:
            self._keep_learnt(seen.t)
        self._track.begin(first_checkpoint(seen, self._learnt, now, self._config))
        self._started, self._misses = True, 0
        self._t_seen = self._t_start = seen.t
        self._recent.append(seen.t)
        return Fusion.STARTED

    def _carry_on(self, seen: VisionMeasurement, predicted: Checkpoint[VisionMeasurement]) -> bool:
        """Begin at the picture's own pose with all else that is known, how it moves too."""
        assert seen.pose is not None
        e, passing = _missed(seen.pose, predicted), self._track.passing(predicted)
        if not correct_by_pose(seen, predicted, e, passing, self._config):
            return False
        self._track.carry_on(predicted)
        self._misses, self._t_seen = 0, max(self._t_seen, seen.t)
        self._recent.append(seen.t)
        return True

    def _keep_learnt(self, t: float) -> None:
        if abs(t - self._t_start) < FRESH_S:
            self._learnt = None
            return
        newest = self._track.newest
        self._learnt = newest.x[X_BIASES:X].copy(), newest.P[BIASES:N, BIASES:N].copy()

    def _give_up(self) -> None:
        """Throw the estimate away, keep the samples for the next start."""
        self.failures += 1
        self._started, self._learnt = False, None

    def _keep_up(self, now: float) -> None:
        self._now = now
        if not self._started:
            return
        if now - self._track.base.t > MAX_SLEEP_S:
            self._give_up()
        else:
            self._track.settle(now - self._config.horizon_s)

    def state(self, now: float) -> RelativeState | None:
        """The estimate at time `now` [s]; None while nothing is known.

        Raises:
            ValueError: `now` is not a number, or before the last picture.
        """
        if not self._started:
            self._now = now
            return None
        if not now >= self._track.newest.t:
            raise ValueError(f"state at {now} s: time can't go back before {self._track.newest.t}")
        self._keep_up(now)
        if self._started and not self._track.to_now(now):
            self._give_up()
        return self._seen_now(now) if self._started else None

    def _seen_now(self, t: float) -> RelativeState:
        track, here = self._track, self._track.now
        inputs = track.inputs_now()
        return RelativeState(
            t=t,
            p_bc_in_c=here.x[0:3].copy(),
            R_cb=here.R.copy(),
            u_bf_in_c=here.x[3:6] + track.told_velocity(here),
            omega_bf_in_b=inputs[0:3],
            omega_cf_in_c=inputs[6:9],
            R_ic=here.R_ic.copy(),
            sigma_p=largest_sigma(here.P, 0),
            sigma_theta=largest_sigma(here.P, 3),
            age=t - self._t_seen,
            f_cf_in_c=inputs[9:12],
            f_bf_in_b=inputs[3:6],
        )

    @property
    def covariance(self) -> Array:
        """(6, 6) of (δp in c [m], θ in b [rad]) with R = R̂ Exp(θ), at the last `state`."""
        P: Array = self._track.now.P[:6, :6].copy() if self._started else np.diag([np.inf] * 6)
        return P

    def last_fused(self) -> tuple[float, Array, Array, Array] | None:
        """(t, p, R, covariance (6, 6)) right after the newest picture; None before the first."""
        if not self._started:
            return None
        newest = self._track.newest
        return newest.t, newest.x[0:3].copy(), newest.R.copy(), newest.P[:6, :6].copy()

    @property
    def time_offset(self) -> StampOffset | None:
        """Of the pictures' stamps, as learnt; None while it is not known, or not believed."""
        if not self._started or self.complaint:
            return None
        return StampOffset(*_learnt_offset(self._track.newest), self._t_start)

    @property
    def complaint(self) -> str:
        """Why the learnt time offset can't be believed, in words for the operator."""
        return self._offset.complaint

    @property
    def refusals(self) -> tuple[str, ...]:
        """See `Estimator`: whose samples sway by a vibration, and what to do."""
        swaying = aliased_tones(self._now, self._aliased.t_sure)
        return tuple(words + MEND_TONE for words in swaying)

    @property
    def health(self) -> Health:
        """Telemetry."""
        fused = sum(count for fusion, count in self.pictures.items() if fusion)
        freedom = sum(dof for _, dof in self._nis)
        known = Health(
            fused=fused,
            dropped=self.pictures.total() - fused,
            late=self.pictures[Fusion.LATE],
            leds_rejected=self.leds_rejected,
            nis=sum(chi2 for chi2, _ in self._nis) / freedom if freedom else np.nan,
        )
        if not self._started:
            return known
        newest = self._track.newest
        biases = newest.x[X_BIASES:X_OFFSET].reshape(4, 3).copy()
        return replace(
            known,
            time_offset=float(newest.x[X_OFFSET]),
            time_offset_sigma=np.inf
            if self.complaint
            else float(np.sqrt(newest.P[OFFSET, OFFSET])),
            bias_omega_b=biases[0],
            bias_a_b=biases[1],
            bias_omega_c=biases[2],
            bias_a_c=biases[3],
            doubts=sensor_doubts(
                newest.t,
                self._t_start,
                self._track.t_clipped.ravel(),
                self._track.t_vibrating.ravel(),
                self._off.t_heard,
                self._aliased.t_sure,
                self._bias_steps.t_stepped,
                self._track.body_noise,
                self._spot_noise.factor,
                self._date_noise.sigma_s,
                of_body=self._motion is None,
            ),
        )


def _missed(pose: RelativePose, predicted: Checkpoint[VisionMeasurement]) -> Array:
    """(6,) by how much a picture's own pose is off what was predicted: δp in c, θ in b."""
    turn = log(predicted.R.T @ pose.R_cb)
    return np.concatenate((pose.p_bc_in_c - predicted.x[0:3], turn))


def _learnt_offset(here: Checkpoint[VisionMeasurement]) -> tuple[float, float]:
    """The pictures' time offset there, and its standard deviation [s]."""
    return float(here.x[X_OFFSET]), float(np.sqrt(here.P[OFFSET, OFFSET]))
