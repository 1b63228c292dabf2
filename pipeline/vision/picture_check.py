"""Each picture is held against what both motion sensors predict from the pictures before it.

A stabiliser shifts the picture, a zoom, another lens or a focus that breathes scales it, a camera
that hangs shows an old one: and LEDs still fit each other, so no residual tells. But phone and
robot measure how they turn and accelerate. The relative filter's own model carries the robot's
place on from `LAG_S` ago without the pictures since; what is seen beside it by more than both
doubts bear, χ² with three degrees of freedom, is a lie of the camera, and seen so in the first
pictures.

* What is a little beside is believed less: its covariance takes in how far it is. If that happens
  too often across the line of sight, the phone's samples are worse than they should be, and
  predict less (`check_noise`); unless the picture is steadied.
* What alone is beside where the picture before predicted it, however far, is dated badly, as a busy
  browser does it now and then: it is believed less, and moves what is predicted next less.
* What is far beside is not believed. After `NAMED_S` the lie is named, and the camera is on trial:
  nothing is believed until it was right for `TRIAL_S` in which one that stands still had been
  refused, and a zoom is taken back. Where nothing moves, time acquits nobody.
* What is steadied is named as well, be it ever so little beside (`steadied_picture`).

Nothing is judged without fresh samples of both sides, or before the pictures' time is known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, log, sqrt
from typing import Final

import numpy as np

from pipeline.camera.verdict import FOCAL, SURE
from pipeline.estimation.believed_less import widened
from pipeline.estimation.misdated_picture import STUMBLE_S, RunningDates, late_by
from pipeline.estimation.out_of_sequence import Checkpoint
from pipeline.estimation.relative_kernels import BIASES, X_BIASES, X_OFFSET
from pipeline.estimation.relative_start import Learnt, can_start, first_checkpoint
from pipeline.estimation.relative_track import RelativeTrack
from pipeline.estimation.told_motion import for_body
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import Array
from pipeline.imu_stream import ImuStream
from pipeline.robot import ToldMotion
from pipeline.signals import BodyImu, PhoneImu, RelativePose, VisionMeasurement
from pipeline.vision.camera_lies import BACK, SHIFTED, CameraLie, is_far, named, scaled
from pipeline.vision.check_noise import CheckNoise
from pipeline.vision.gating import UNGATED
from pipeline.vision.rays import NO_RAYS
from pipeline.vision.steadied_picture import SteadiedPicture

LAG_S: Final = 0.25
"""So long the motion sensors alone are trusted."""
REFUSED_CHI2: Final = 30.0
"""Once in a million pictures by chance; models err by more than noise."""
GAP_S: Final = 0.045
"""Samples farther apart than this, two of a phone's lost, say too little of what is between."""
DOUBTED_CHI2: Final = 5.0
"""Once in six pictures by chance; it costs little."""
LONE_CHI2: Final = 9.0
"""Once in 34 by chance; beyond, and if the one before was not, a picture is dated badly."""
BEND_PHONE, BEND_BODY = 0.14, 0.09
"""Second differences of samples of specific force that the model's noise makes, squared [m²/s⁴]: 2
times white jerk between a phone's samples, 6 times a robot's white noise."""
LEAST_APART: Final = 0.1
"""Share of the usual time between two samples; through nearer ones no curve can be trusted."""
EXTREME: Final = np.array([0.5, 0.5, 0.5, 14.0, 14.0, 14.0])
"""Rates [rad/s] and forces [m/s²] beyond which a sensor that says the same twice says no more."""
LATELY, SURPRISED = 0.1, 2.5
"""Share of each picture in what is remembered; mean of χ²/3 beyond which all are doubted."""
NAMED_S: Final = 0.06
NAMED_PICTURES: Final = 3
"""Refused in a row before the camera is blamed."""
AMISS_CHI2, SHIFTED_CHI2 = 12.0, 20.0
"""Of the last of them, from before all pictures that may have misled the next: once in 140 by
chance; and of one that is shifted, as samples that have just become worse shift it as well."""
TRIAL_S: Final = 1.5
"""In the right so long, by pictures between which enough moved to show that they are."""
FLOOR_RAD: Final = 2e-4
"""How far an LED may be from where picture and robot file have it, beside noise: 0.2 px."""
KNOWN_S: Final = 1.5
"""After so long enough is known of the motion sensors to refuse a picture, and to be kept."""
RETURNED: Final = 0.04
"""By how much the scale may differ after a zoom was taken back; what is left the camera watch
measures."""


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What became of a picture's pose."""

    is_believed: bool
    beside: tuple[Array, ...] = ()
    """By how much (3,) the robot may be seen beside its place [m], each by itself."""


FINE: Final = Judged(True)
REFUSED: Final = Judged(False)


@dataclass(frozen=True, slots=True, eq=False)
class Missed:
    """A picture's innovation."""

    off: Array
    """(3,) where the robot is seen from where it was predicted [m]."""
    S: Array
    """(3, 3) its covariance [m²]."""
    chi2: float
    predicted: Checkpoint[VisionMeasurement]


class PictureCheck:
    """Samples and pictures come from one thread, each sort in the order of its arrival."""

    def __init__(self, leds_in_b: Array, motion: ToldMotion | None = None) -> None:
        """Of a robot with LEDs (n, 3) [m]; nothing known. `motion`: it has no motion sensors."""
        self._config = for_body(RelativeConfig(gate_chi2=UNGATED), motion)
        self._leds_in_b = leds_in_b
        self._track = RelativeTrack(self._config, leds_in_b, motion, doubts_dates=False)
        self._knows = False
        self._learnt: Learnt | None = None
        """Of the motion sensors, while the camera told the truth."""
        self._noise, self._jumps = CheckNoise(), SteadiedPicture()
        self._stretch = 1.0
        """Of what is predicted, for a robot that shakes more than the model says."""
        self._was_beside = False
        """The picture before was beside its place."""
        self._dates = RunningDates()
        self._t_begun = -np.inf
        self._right_s = 0.0
        """So long pictures were right since that could have been wrong."""
        self._shown: list[VisionMeasurement] = []
        """The last that was not refused, and those since."""
        self._surprise, self._off2 = 1.0, np.zeros(3)
        """Lately: χ²/3, and by how much it was missed (3,) [m²]."""
        self._scale = 0.0
        """Log of how much larger the picture became by what was refused."""
        self.t_named = -np.inf
        self.complaint = ""
        """Why nothing is believed; empty if all is well."""

    def go_on_from(self, before: PictureCheck) -> None:
        """The same lens makes pictures of another size or angle: its trial begins anew."""
        self.complaint, self.t_named = before.complaint, before.t_named
        self._scale = before._scale

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Take a motion sample of either side, in any order."""
        track = self._track
        if self._knows and sample.t <= track.base.t:
            return
        if isinstance(sample, PhoneImu):
            track.insert(track.phone, sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)
        else:
            track.insert_body(sample)

    def believed(self, seen: VisionMeasurement) -> VisionMeasurement:
        """The same with what is believed of it: nothing, or all, as sure as one may be."""
        judged, pose, rays = self.judge(seen), seen.pose, seen.rays
        if not judged.is_believed:
            return replace(seen, pose=None, rays=NO_RAYS, lie=self.complaint)
        if pose is not None:
            for off in judged.beside:
                pose, rays = widened(pose, rays, self._leds_in_b, off)
        return replace(seen, pose=pose, rays=rays)

    def judge(self, seen: VisionMeasurement) -> Judged:
        """Hold a picture with a pose against what was predicted for it."""
        if seen.pose is None:
            return REFUSED if self.complaint else FINE
        seen, pose = _bounded(seen, seen.pose)
        if not self._knows or not self._hears(seen.t):
            self._begin(seen)
            return self._with_scale(FINE, pose)
        track = self._track
        t = seen.t + float(track.newest.x[X_OFFSET])
        is_gone = t - track.newest.t > 4.0 * LAG_S or t <= track.base.t
        if is_gone or any(_is_deaf(imu, t) for imu in (track.phone, track.body)):
            self._begin(seen)
            return self._with_scale(FINE, pose)
        track.settle(t - LAG_S)
        track.doubt_phone(max(self._noise.phone, _bent(track.phone, t, BEND_PHONE)))
        self._stretch = _bent(track.body, t, BEND_BODY)
        misses = self._misses(pose, t)
        if self._are_redated(misses[1]) and not self.complaint:
            track.redate(STUMBLE_S)
            misses = self._misses(pose, t)
        self._match_noise(pose, misses[1])
        known_s = KNOWN_S if self._learnt is None else LAG_S
        is_known = seen.t - self._t_begun > known_s
        far_amiss, near_amiss = (self._is_amiss(miss) for miss in misses)
        if is_known and (far_amiss or (near_amiss and self._was_beside)):
            return self._refuse(seen, misses)
        if is_known and self._jumps.is_steadied:
            return self._name(seen, CameraLie(SHIFTED))
        self._shown = [seen]
        self._acquit(misses[0])
        near = misses[1].predicted
        if not np.isfinite(track.fuse(near, self._inflated(seen, pose, misses[1]), len(seen.rays))):
            self._begin(seen)
        self._noise.add_innovation(max(miss.chi2 for miss in misses))
        self._surprise += LATELY * (misses[0].chi2 / 3.0 - self._surprise)
        self._off2 += LATELY * (np.square(misses[0].off) - self._off2)
        doubted = [miss.off for miss in misses if miss.chi2 > DOUBTED_CHI2]
        if self._surprise > SURPRISED:
            doubted.append(np.sqrt(self._off2))
        return self._with_scale(
            Judged(True, (max(doubted, key=_square),)) if doubted else FINE, pose
        )

    def _inflated(
        self, seen: VisionMeasurement, pose: RelativePose, near: Missed
    ) -> VisionMeasurement:
        """The same, believed less if it alone is beside its place.

        One that is dated badly would leave a speed behind, and what that predicts would blame
        pictures which are right.
        """
        is_beside = near.chi2 > LONE_CHI2
        is_lone, self._was_beside = is_beside and not self._was_beside, is_beside
        if not is_lone or self._jumps.is_still:
            return seen
        pose, rays = widened(pose, seen.rays, self._leds_in_b, near.off)
        return replace(seen, pose=pose, rays=rays)

    def _misses(self, pose: RelativePose, t: float) -> tuple[Missed, Missed]:
        """Beside what was predicted without the last pictures, and with them."""
        track = self._track
        far, near = track.predicted(t, t - LAG_S), track.predicted(t)
        return self._missed(pose, far), self._missed(pose, near)

    def _are_redated(self, near: Missed) -> bool:
        """Whether this picture and the one before are beside their places by the same date."""
        if not near.chi2 > LONE_CHI2:
            return self._dates.are_alike(inf)
        passing = self._track.passing(near.predicted)[:3]
        return self._dates.are_alike(late_by(near.off, near.S, passing))

    def _missed(self, pose: RelativePose, predicted: Checkpoint[VisionMeasurement]) -> Missed:
        """Where it is seen from where it was predicted."""
        P: Array = self._track.in_picture(predicted)[:3, :3]
        S = self._stretch * P + pose.covariance[:3, :3]
        return _beside(pose.p_bc_in_c, S, predicted)

    def _match_noise(self, pose: RelativePose, near: Missed) -> None:
        """Learn how well the phone's samples predict, from one picture to the next."""
        since, predicted = self._track.newest.x[1:3], near.predicted.x[1:3]
        aside, off, S = pose.p_bc_in_c[1:], near.off[1:], near.S[1:, 1:]
        chi2 = float(off @ np.linalg.solve(S, off))
        t, t_since = near.predicted.t, self._track.newest.t
        self._jumps.add(t, t_since, aside - since, predicted - since, float(np.trace(S)))
        self._noise.add_lateral_innovation(chi2, self._jumps.is_clear)

    def measured(self, focal: float, sigma: float) -> None:
        """Things look by so much larger than calibrated, ± `sigma`, as somebody measured since."""
        if SURE * sigma > max(FOCAL, abs(focal)):
            return  # says neither that the scale is right nor that it is wrong
        self._scale = 0.0 if abs(focal) < FOCAL else log(1.0 + focal)

    def _with_scale(self, judged: Judged, pose: RelativePose) -> Judged:
        if self.complaint:
            return REFUSED
        if self._scale == 0.0:
            return judged
        along = np.array([self._scale * float(pose.p_bc_in_c[0]), 0.0, 0.0])
        return Judged(True, (*judged.beside, along))

    def _hears(self, t: float) -> bool:
        """Whether both IMUs were heard about `t` [s]."""
        return self._track.phone.near(t) is not None and self._track.body.near(t) is not None

    def _begin(self, seen: VisionMeasurement) -> None:
        """Predict from this picture on."""
        if self._knows and not self.complaint and seen.t - self._t_begun > KNOWN_S:
            base = self._track.base
            self._learnt = base.x[X_BIASES:].copy(), base.P[BIASES:, BIASES:].copy()
        known = seen.offset is not None or self._learnt is not None
        self._knows = known and can_start(seen, self._config) and self._hears(seen.t)
        self._shown = [seen]
        self._right_s = 0.0
        if self._knows:
            self._track.begin(first_checkpoint(seen, self._learnt, np.inf, self._config))
            self._t_begun = seen.t

    def _is_amiss(self, miss: Missed) -> bool:
        return miss.chi2 > self._noise.chi2 * REFUSED_CHI2 and self._is_far(miss)

    def _is_far(self, miss: Missed) -> bool:
        return is_far(miss.off, miss.predicted.x[0:3], *self._turned(miss.predicted.t))

    def _turned(self, t: float) -> tuple[float, float]:
        """How far the phone turned in the time before `t` [rad], and how fast to and fro."""
        rates = _lately(self._track.phone, t)[:, :3]
        if len(rates) == 0:
            return 0.0, 0.0
        return LAG_S * sqrt(_square(rates.mean(axis=0))), sqrt(_square(rates) / len(rates))

    def _refuse(self, seen: VisionMeasurement, misses: tuple[Missed, Missed]) -> Judged:
        """Believe nothing of it; `misses` from before all pictures that may mislead, and since."""
        self._shown.append(seen)
        refused, far = self._shown[1:], misses[0]
        off = max((miss.off for miss in misses), key=_square)
        lie = named(self._shown, off, far.predicted.x[0:3])
        least = self._noise.chi2 * (SHIFTED_CHI2 if lie.words == SHIFTED else AMISS_CHI2)
        is_lie = far.chi2 > least and seen.t - refused[0].t >= NAMED_S
        if len(refused) < NAMED_PICTURES or not is_lie:
            return REFUSED
        return self._name(seen, lie)

    def _name(self, seen: VisionMeasurement, lie: CameraLie) -> Judged:
        """Put the camera on trial."""
        was_scaled = abs(self._scale) >= RETURNED
        self._scale += lie.scale
        self._begin(seen)
        is_scaled = abs(self._scale) >= RETURNED
        self.complaint = scaled(self._scale) if is_scaled or lie.scale != 0.0 else lie.words
        if was_scaled and not is_scaled:
            self.complaint = BACK
        self.t_named = seen.t
        return REFUSED

    def _acquit(self, far: Missed) -> None:
        """End the trial of a camera that was right for long enough.

        So it was in this picture if the base's, shown again, would have been amiss.
        """
        if not self.complaint:
            return
        shown_again = _beside(self._track.base.x[0:3], far.S, far.predicted)
        if self._is_amiss(shown_again):
            self._right_s += far.predicted.t - self._track.newest.t
        if self._right_s > TRIAL_S and abs(self._scale) < RETURNED:
            self.complaint = ""


def _beside(p: Array, S: Array, predicted: Checkpoint[VisionMeasurement]) -> Missed:
    """A place p (3,) [m] as known as S (3, 3), from where it was predicted."""
    off = p - predicted.x[0:3]
    return Missed(off, S, float(off @ np.linalg.solve(S, off)), predicted)


def _lately(stream: ImuStream, t: float) -> Array:
    """Samples (n, 6) of the time that is predicted, up to `t` [s]."""
    since, until = np.searchsorted(stream.times, (t - LAG_S, t))
    return stream.values[since:until]


def _bent(stream: ImuStream, t: float, usual: float) -> float:
    """How many times the `usual` second differences of the specific force are lately; at least 1.

    What shakes quicker than it is sampled predicts less.
    """
    bends = np.diff(_lately(stream, t)[:, 3:6], 2, axis=0)
    return max(1.0, float(np.square(bends).mean()) / usual) if len(bends) else 1.0


def _is_deaf(stream: ImuStream, t: float) -> bool:
    """Whether samples lately are missing or misdated, or are clipped: shaken beyond the range."""
    since, until = np.searchsorted(stream.times, (t - LAG_S, t))
    since = max(since - 1, 0)
    values, apart = stream.values[since:until, :6], np.diff(stream.times[since:until])
    if len(apart) == 0:
        return True
    is_clipped = ((np.diff(values, axis=0) == 0.0) & (np.abs(values[1:]) > EXTREME)).any()
    is_misdated = apart.min() < LEAST_APART * np.median(apart)
    return bool(is_clipped or is_misdated or apart.max() > GAP_S)


def _bounded(seen: VisionMeasurement, pose: RelativePose) -> tuple[VisionMeasurement, RelativePose]:
    """The same, with LEDs known no better than `FLOOR_RAD`."""
    C = seen.rays.covariances
    more = 1.0 + FLOOR_RAD**2 / float(np.trace(C, axis1=1, axis2=2).mean() / 2.0)
    pose = replace(pose, covariance=more * pose.covariance)
    rays = replace(seen.rays, covariances=C + FLOOR_RAD**2 * np.eye(2))
    return replace(seen, rays=rays, pose=pose), pose


def _square(v: Array) -> float:
    return float(np.square(v).sum())
