"""Watches one phone: what its check is made of, for as long as it is kept. Sans-I/O."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import inf, nan

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.glass.robot_of_light import GlassSeen
from pipeline.signals import PhoneImu
from pipeline.timing.clock_synchronisation import ClockSynchronisation
from pipeline.vision.detection import Detection
from server.diagnostics.link_log import MOST, LinkLog, Series
from server.diagnostics.phone_check.figures import Axes
from server.diagnostics.phone_check.rest import STILL_S, Rest, RestLog
from server.protocol.camera_messages import CameraHealth
from server.protocol.wire_records import Picture

LONG_S = 300.0
"""So long pictures are counted, for what heat does to their rate."""
LOOKS = 4000
"""Pictures of which all is kept: of a minute, 60 a second."""


@dataclass(frozen=True, slots=True, eq=False)
class PixelLook:
    """A picture that was looked at."""

    t: float
    """When it was taken [s]."""
    found: bool
    """The robot's place."""
    led: tuple[int, ...] = ()
    off_px: tuple[float, ...] = ()
    """Of each LED beside where the pose has it [px]."""
    own_px: float = 0.0
    """Noise of an LED's centre by the picture's own, per coordinate, RMS."""


def look_of(detection: Detection, camera: Camera, leds_in_b: Array) -> PixelLook:
    """What a detection tells of pixels; LEDs (n, 3) [m].

    The rows of a rolling shutter are read while the phone turns; the robot hardly turns meanwhile.
    """
    pose, rays, match = detection.pose, detection.rays, detection.match
    if pose is None or match is None or len(rays) == 0:
        return PixelLook(detection.t, pose is not None)
    omega, after = detection.prior.omega_cf_in_c, rays.t - pose.t
    at = leds_in_b[rays.led] @ pose.R_cb.T + pose.p_bc_in_c
    if omega is not None:
        at = at - after[:, None] * np.cross(omega, at)
    off = camera.focal_px * (rays.tangents - at[:, 1:] / at[:, :1])
    variances = np.trace(detection.spots.covariances[match.spot], axis1=1, axis2=2) / 2.0
    return PixelLook(
        detection.t,
        found=True,
        led=tuple(rays.led.tolist()),
        off_px=tuple(np.hypot(off[:, 0], off[:, 1]).tolist()),
        own_px=float(np.sqrt(variances.mean())),
    )


@dataclass(frozen=True, slots=True)
class ClockFacts:
    """What was known of the phone's clock at one time; NaN: nothing yet."""

    drift: float = nan
    """How much faster it runs than ours [s/s]."""
    error: float = nan
    """Bound of the error of its offset [s]."""
    round_trip: float = nan
    """The shortest of the last minute [s]."""

    @classmethod
    def of(cls, clock: ClockSynchronisation) -> ClockFacts:
        """What `clock`, which goes on learning, knows now."""
        return cls(clock.drift, clock.error, clock.round_trip) if clock.ready else cls()


@dataclass(frozen=True, slots=True, eq=False)
class PhoneFacts:
    """What others have learnt of the phone so far."""

    device: str
    since: float
    """When it came [s]."""
    clock: ClockFacts
    axes: Axes
    camera: Camera | None
    """What looks; None: nothing yet."""
    is_calibrated: bool
    health: CameraHealth | None
    complaints: tuple[str, ...]
    glass: GlassSeen | None


@dataclass(frozen=True, slots=True, eq=False)
class PhoneSeries:
    """All that figures are made of."""

    link: Series
    picture: Picture | None
    """The newest."""
    bytes: int
    """Of all pictures."""
    looks: tuple[PixelLook, ...]
    rest: Rest
    taken: tuple[float, ...]
    """When pictures were taken, of a longer time [s]."""
    heard_s: float
    """So long the phone was there, of what was asked for [s]."""
    undecodable: int
    """Pictures, after the first that was looked at."""
    facts: PhoneFacts


class PhoneWatch:
    """Told of all that comes of one phone; `add_look` may be called from another thread."""

    def __init__(self, link: LinkLog, long_s: float = LONG_S, most: int | None = MOST) -> None:
        """Begin empty; `link` is told of what comes by who tells this."""
        self._link, self._long_s = link, long_s
        self._picture: Picture | None = None
        looks = None if most is None else LOOKS
        self._sizes: deque[tuple[float, int]] = deque(maxlen=looks)
        """(When a picture came [s], its bytes)."""
        self._looks: deque[tuple[int, PixelLook]] = deque(maxlen=looks)
        """(Undecodable until then, look)."""
        self._taken: deque[float] = deque(maxlen=most)
        self._rest = RestLog(None if most is None else round(long_s / STILL_S))
        self._undecodable = self._counted = 0

    def add_motion(self, sample: PhoneImu) -> None:
        """A motion sample has come."""
        self._rest.add(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)

    def add_picture(self, t: float, came: float, picture: Picture) -> None:
        """A picture taken at `t` [s] `came` [s]."""
        self._picture = picture
        self._taken.append(t)
        self._sizes.append((came, len(picture.data)))

    def count(self, undecodable: int) -> None:
        """So many pictures were undecodable since the decoder in use began."""
        self._undecodable += undecodable - min(self._counted, undecodable)
        self._counted = undecodable

    def add_look(self, look: PixelLook) -> None:
        """A picture was looked at."""
        self._looks.append((self._undecodable, look))

    def series(self, now: float, seconds: float, facts: PhoneFacts) -> PhoneSeries:
        """The last `seconds`, as far as they are kept."""
        link = self._link.series(now, seconds)
        begin = link.pictures[0][0] if link.pictures else inf
        looks = [(before, look) for before, look in self._looks.copy() if look.t >= begin]
        undecodable = self._undecodable - looks[0][0] if looks else 0
        return PhoneSeries(
            link,
            self._picture,
            sum(size for came, size in self._sizes if came >= link.begin),
            tuple(look for _, look in looks),
            self._rest.stillest(link.begin),
            tuple(t for t in self._taken if t >= now - min(seconds, self._long_s)),
            min(seconds, now - facts.since),
            undecodable,
            facts,
        )
