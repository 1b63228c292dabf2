"""The relative filter on the time axis of `out_of_sequence`: each LED ray at its moment."""

from __future__ import annotations

from math import sqrt
from typing import Final

import numpy as np

from pipeline.estimation.aliased_tone import WANDERS, Tone
from pipeline.estimation.doubted_date_kernels import AT
from pipeline.estimation.full_scale import LOUD, FullScale
from pipeline.estimation.hand_motion_kernels import WINDOW
from pipeline.estimation.hand_predictor import HandPredictor
from pipeline.estimation.imu_interpolation_kernels import sample_at
from pipeline.estimation.out_of_sequence import Checkpoint, OutOfSequence
from pipeline.estimation.picture_kernels import pose_in_picture, pose_rate
from pipeline.estimation.ray_kernels import fuse_rays, is_sound, misfit
from pipeline.estimation.relative_kernels import (
    BIASES,
    BODY,
    INPUTS,
    MOVING,
    OFFSET,
    TOLD,
    TONE,
    X_OFFSET,
    X_TONE,
    N,
    X,
    apply,
    inputs_at,
    transit,
)
from pipeline.estimation.relative_noise import initial_biases, noise_of, walks_of
from pipeline.estimation.sample_noise import SampleNoise
from pipeline.estimation.told_motion import ToldTwist, ToldVertical
from pipeline.estimation.tones import PHONE, ROBOT, Tones
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import Array, exp
from pipeline.imu_stream import ImuStream
from pipeline.robot import ToldMotion
from pipeline.signals import BodyImu, Flags, StampOffset, VisionMeasurement

KEPT: Final = 2 * WINDOW
"""Samples up to the base that are still interpolated from, or learnt from."""
MISLED: Final = (0.05, 0.05, 0.3)
"""By so much place [m], attitude [rad] and velocity [m/s] may be wrong before a tone is known."""
NOTHING_TOLD: Final = np.zeros(4)
LINEAR_S: Final = 0.003
"""A time offset known so well [s] is linear in all that a picture shows of it."""
AMPLITUDES: Final = 12
"""Of a tone."""
BENT: Final = 2
"""The curve through a new sample and those around it changes from so many before it on."""


class RelativeTrack(OutOfSequence[VisionMeasurement]):
    """State x (19,), attitude R and covariance P (22, 22) at any time since the base."""

    def __init__(
        self,
        config: RelativeConfig,
        leds_in_b: Array,
        motion: ToldMotion | None = None,
        doubts_dates: bool = True,
    ) -> None:
        """Take the noise as configured; LEDs (n, 3) [m]; `motion` of a body that tells its own.

        The config is then that of `told_motion.for_body`. Who judges pictures doubts no dates: they
        would be the excuse for each that lies.
        """
        super().__init__(X, N, MOVING, BENT, KEPT)
        self._told = self._vertical = None
        self._is_measured = float(motion is not None and motion.is_measured)
        if motion is not None:
            self._told, self._vertical = ToldTwist(motion), ToldVertical(motion)
            self.body = ImuStream(more=TOLD - BODY)
        self._leds_in_b, self._doubts_dates = np.ascontiguousarray(leds_in_b), doubts_dates
        self._walks, self._calm = walks_of(config), walks_of(config)
        self._hand, self._phone_factor = HandPredictor(config.hand), 1.0
        self._scales = [[FullScale(loud) for loud in LOUD] for _ in range(2)]
        self.t_clipped = np.full((2, 2), -np.inf)
        """When each sensor last said as much as it can, by device [s]."""
        self._noise = noise_of(config)
        self._configured = self._noise[:, :3].copy()
        self._heard = [SampleNoise(sigmas) for sigmas in self._configured[:, 0, :2]]
        self._tones = [Tones(limits) for limits in (ROBOT, PHONE)]
        self._has_news = [False, False]
        """Samples of the robot, of the phone, from which nothing was learnt yet."""
        self._initial, self._initial_offset = initial_biases(config), config.initial_offset
        self._gate, self._still = config.gate_chi2, config.offset_still
        self.tone: Tone | None = None
        """Whose amplitudes stand behind the rest of the state."""
        self._F, self._G = np.zeros((MOVING, MOVING)), np.zeros((MOVING, INPUTS))
        self._Q, self._steps = np.zeros((MOVING, MOVING)), np.zeros((13, 3, 3))
        self._products = np.zeros((2, MOVING, N))

    def insert_body(self, sample: BodyImu) -> bool:
        """Remember a sample of the robot; False: it was there, or lacks what such a robot tells."""
        if self._told is None or self._vertical is None:
            return self.insert(self.body, sample.t, sample.omega_m_bf_in_b, sample.a_m_bf_in_b)
        twist_in_b = sample.twist_m_bf_in_b
        if twist_in_b is None or not bool(np.isfinite(twist_in_b).all()):
            return False
        force = self._vertical.force(sample.t, twist_in_b[3:])
        more = np.concatenate((twist_in_b[:3], self._told.doubts(sample.t, twist_in_b)))
        return super().insert(self.body, sample.t, twist_in_b[3:], force, more)

    def insert(
        self, stream: ImuStream, t: float, rate: Array, force: Array, more: Array | None = None
    ) -> bool:
        """Remember a sample of `body` or `phone`, of whose hand it tells; False: it was there."""
        if not super().insert(stream, t, rate, force, more):
            return False
        device = int(stream is self.phone)
        for sensor, (scale, sample) in enumerate(
            zip(self._scales[device], (rate, force), strict=True)
        ):
            if scale.hear(sample):
                self.t_clipped[device, sensor] = max(t, self.t_clipped[device, sensor])
            self._noise[device, 3, sensor] = scale.limit
        self._heard[device].add(t, rate, force)
        self._tones[device].add(t, rate, force)
        self._has_news[device] = True
        return True

    def _learn(self) -> None:
        """What samples tell of noise and of the hand: once for all that came since it was used."""
        for device, has_news in enumerate(self._has_news):
            if has_news:
                self._set_sample_noise(device)
        if self._has_news[1]:
            self._hand.follow(self.phone)
        self._has_news = [False, False]

    @property
    def body_noise(self) -> Array:
        """(2,) how far samples of the robot's sensors scatter, by the configured noise."""
        noise: Array = self._heard[0].levels[:, 0] / self._configured[0, 0, :2]
        return noise

    @property
    def t_vibrating(self) -> Array:
        """(2, 2) when each sensor last had a tone, by device [s]."""
        return np.array([one.t_heard for one in self._tones])

    def doubt_phone(self, factor: float) -> None:
        """From now on the variances of the phone's samples are so many times the configured."""
        if factor != self._phone_factor:
            self._phone_factor = factor
            self._set_sample_noise(1)

    def _set_sample_noise(self, device: int) -> None:
        """Let its samples be as uncertain as configured, as they scatter, or as pictures say."""
        noise = self._noise[device]
        noise[:3] = self._configured[device]
        white, rough = self._heard[device].levels.T
        noise[0, :2] = np.maximum(noise[0, :2], white)
        if device:  # a robot's samples are near enough for all that it does
            noise[1, 1] = max(noise[1, 1], rough[1])
            noise[:3] *= sqrt(self._phone_factor)

    def moved(self, by: Array) -> None:
        """The sensors' biases are off by so much (4,) about each axis."""
        variances = np.zeros(len(self.base.P))
        variances[BIASES:OFFSET] = np.repeat(by * by, 3)
        self.open(variances)

    def redate(self, sigma: float) -> None:
        """Pictures since the base may be dated otherwise, by `sigma` [s]."""
        variances = np.zeros(len(self.base.P))
        variances[OFFSET] = sigma * sigma
        self.open(variances)

    def date(self, offset: StampOffset) -> None:
        """Pictures since the base are dated as somebody else found, who is surer."""
        base = self.base
        known = base.P[OFFSET].copy()
        gain = known / (known[OFFSET] + offset.sigma**2)
        step = gain * (offset.value - base.x[X_OFFSET])
        base.x[0:3] += step[0:3]
        base.x[3:] += step[6:]
        base.R[:] = base.R @ exp(step[3:6])
        base.P -= np.outer(gain, known)
        self._replay_from = min(self._replay_from, base.t)
        self._repair()

    def walk(self, densities: Array) -> None:
        """Biases walk by `densities` (4,) [unit²/s] more than configured, by sensor."""
        self._walks[:INPUTS] = self._calm[:INPUTS] + np.repeat(densities, 3)

    def begin(self, start: Checkpoint[VisionMeasurement]) -> None:
        """See `OutOfSequence`; a tone goes on, and a vertical that was not known is learnt."""
        if self._vertical is not None:
            self._vertical.learn(start.t, start.R, self.phone, self.body)
        super().begin(self._with_tone(start) if self.tone is not None else start)
        if self._is_date_doubted(self.base):
            self._doubt_date(self.base)

    def _is_date_doubted(self, here: Checkpoint[VisionMeasurement]) -> bool:
        return self._doubts_dates and bool(here.P[OFFSET, OFFSET] >= LINEAR_S**2)

    def _doubt_date(self, start: Checkpoint[VisionMeasurement]) -> None:
        """Let it be where its picture shows it at its date, not at its stamp: P of [1 −a] and u."""
        A = np.eye(len(start.P))
        A[:6, OFFSET] = -self.passing(start)
        start.P[:] = A @ start.P @ A.T
        start.P[:3, :3] += start.P[OFFSET, OFFSET] * start.P[6:9, 6:9]

    def carry_on(self, here: Checkpoint[VisionMeasurement]) -> None:
        """Begin at what was predicted there, corrected since, with all that it is."""
        super().begin(here)

    def sway(self, tone: Tone | None) -> None:
        """Let the robot's samples have this tone since the base, or none."""
        if tone is self.tone:
            return
        if self.tone is not None and tone is not None and self.tone.sizes == tone.sizes:
            self.tone = tone  # followed
            self._replay_from = min(self._replay_from, self.base.t)
            return
        if self.tone is not None:
            self._resize(0)
            for one in (*self.checkpoints, self.now, self._frontier):
                one.x, one.P = one.x[:X].copy(), np.ascontiguousarray(one.P[:N, :N])
                one.opened = None if one.opened is None else one.opened[:N]
        self.tone = tone
        if tone is None:
            return
        self._resize(AMPLITUDES)
        self._walks[N - BIASES :] = WANDERS**2 * self._tone_variances()
        for one in (*self.checkpoints, self.now, self._frontier):
            self._with_tone(one)
        self.base.P[:N, :N] += np.diag(self._misled(tone))
        self._replay_from = min(self._replay_from, self.base.t)

    def _misled(self, tone: Tone) -> Array:
        """Variances (22,) by which it may have misled what was known without it."""
        moving, biases = np.repeat(MISLED, 3), np.repeat(self._initial, 3)
        biases[:BODY] += np.repeat(tone.sizes, 3)
        sigmas = np.concatenate((moving, biases, [self._initial_offset]))
        variances: Array = np.square(sigmas)
        return variances

    def _resize(self, more: int) -> None:
        """Make room for so many amplitudes."""
        self._sizes = X + more, N + more
        self._G = np.zeros((MOVING, INPUTS + more))
        self._products = np.zeros((2, MOVING, N + more))
        walks = np.zeros(N + more - BIASES)
        walks[: N - BIASES] = self._walks[: N - BIASES]
        self._walks = walks

    def _tone_variances(self) -> Array:
        """(12,) of amplitudes that may be as large as they seem."""
        sizes = (0.0, 0.0) if self.tone is None else self.tone.sizes
        variances: Array = np.square(np.repeat((*sizes, *sizes), 3))
        return variances

    def _with_tone(self, one: Checkpoint[VisionMeasurement]) -> Checkpoint[VisionMeasurement]:
        """The same, with amplitudes of which nothing is known."""
        x, P = np.zeros(self._sizes[0]), np.zeros((self._sizes[1], self._sizes[1]))
        x[:X], P[:N, :N] = one.x, one.P
        np.fill_diagonal(P[N:, N:], self._tone_variances())
        one.x, one.P = x, P
        if one.opened is not None:
            one.opened = np.append(one.opened, np.zeros(AMPLITUDES))
        return one

    @property
    def amplitudes(self) -> tuple[Array, Array]:
        """Of the tone at the newest picture (12,), and their covariance (12, 12)."""
        newest = self.newest
        return newest.x[X_TONE:].copy(), newest.P[TONE:, TONE:].copy()

    @property
    def _key(self) -> tuple[float, float]:
        return (0.0, 0.0) if self.tone is None else self.tone.key

    def misfit(self, here: Checkpoint[VisionMeasurement]) -> tuple[float, int]:
        """χ² of the LEDs fused there about the pose that fits them best; its degrees of freedom."""
        seen, use = here.seen, here.use
        if seen is None or use is None:
            return 0.0, 0
        rays, freedoms = seen.rays, 2 * int((use == 1).sum()) - 6
        if freedoms <= 0:
            return 0.0, 0
        ahead = rays.t + (here.x[X_OFFSET] - here.t)
        leds, inputs = self._leds_in_b[rays.led], self._inputs(here)
        tangents = np.array(rays.tangents, dtype=np.float64, order="C")
        C = np.array(rays.covariances, dtype=np.float64, order="C")
        told = self._told_at(here)
        return float(misfit(here.x, here.R, inputs, told, leds, ahead, tangents, C, use)), freedoms

    def in_picture(self, here: Checkpoint[VisionMeasurement]) -> Array:
        """P (6, 6) of the pose in a picture stamped for the time of `here`: that is doubted too.

        The pose passes at ṗ = u − ω_c × p, Ṙ = R [ω_b − Rᵀ ω_c]×.
        """
        P: Array = pose_in_picture(here.P, self.passing(here))
        return P

    def passing(self, here: Checkpoint[VisionMeasurement]) -> Array:
        """(6,) how the pose passes there: ṗ in c [m/s], the attitude's rate in b [rad/s]."""
        rate: Array = pose_rate(here.x, here.R, self._inputs(here), self._told_at(here))
        return rate

    def told_velocity(self, here: Checkpoint[VisionMeasurement]) -> Array:
        """(3,) in c [m/s] of a body that tells its own, which x has not; zeros of another."""
        return self._told_at(here)[:3]

    def _told_at(self, here: Checkpoint[VisionMeasurement]) -> Array:
        """(4,) as `ray_kernels` takes it."""
        if self._told is None:
            return NOTHING_TOLD
        times, said = self.body.times, np.empty(TOLD)
        last = int(np.searchsorted(times, here.t, side="right")) - 1
        sample_at(times, self.body.values, last, here.t, said)
        return np.append(here.R @ said[6:9], self._is_measured)

    def inputs_now(self) -> Array:
        """(12,) ω_b, f_b, ω_c, f_c at the time of `now`, biases removed."""
        return self._inputs(self.now)

    def _around(self, here: Checkpoint[VisionMeasurement]) -> Array:
        """(1, 12) inputs there, or (3, 12) as `doubt_date` takes them."""
        if not self._is_date_doubted(here):
            return self._inputs(here)[None]
        apart = AT * sqrt(here.P[OFFSET, OFFSET])
        return np.array([self._inputs(here, by) for by in (-apart, 0.0, apart)])

    def _inputs(self, here: Checkpoint[VisionMeasurement], later: float = 0.0) -> Array:
        body, phone, hand = self.body, self.phone, self._hand.forecast
        return np.asarray(
            inputs_at(
                here.t + later,
                here.x,
                body.times,
                body.values,
                phone.times,
                phone.values,
                hand,
                self._key,
            )
        )

    def _fuse(
        self, here: Checkpoint[VisionMeasurement], seen: VisionMeasurement, use: Flags
    ) -> float:
        rays = seen.rays
        return float(
            fuse_rays(
                here.x,
                here.R,
                here.P,
                self._around(here),
                self._told_at(here),
                self._leds_in_b[rays.led],
                rays.t + (here.x[X_OFFSET] - here.t),
                np.array(rays.tangents, dtype=np.float64, order="C"),  # compiled for such alone
                np.array(rays.covariances, dtype=np.float64, order="C"),
                self._gate,
                np.inf if seen.is_drawn else self._still,
                use,
            )
        )

    def _is_sound(self, here: Checkpoint[VisionMeasurement]) -> bool:
        return bool(is_sound(here.x, here.R, here.P))

    def _advance(self, here: Checkpoint[VisionMeasurement], t: float) -> None:
        self._learn()
        body, phone = self.body, self.phone
        transit(
            here.x,
            here.R,
            here.R_ic,
            self._F,
            self._G,
            self._Q,
            (here.t, t),
            body.times,
            body.values,
            phone.times,
            phone.values,
            self._noise,
            self._hand.forecast,
            self._steps,
            self._key,
        )
        apply(here.P, self._F, self._G, self._Q, self._walks, t - here.t, self._products)
        here.t = t
