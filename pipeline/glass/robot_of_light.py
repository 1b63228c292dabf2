"""A robot of light, sans-I/O: what a phone saw of the glass in, what the glass shall show out.

First the phone finds the glass, then it measures how late the glass is and, where nobody did so
before, its own lens, then it sees the robot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.frames import Array, R_from_wxyz
from pipeline.glass.display_lag import SWEEP_SHARE, DisplayLag, DisplayLagMeter
from pipeline.glass.eye import OLD_S, Eye, EyeTracker
from pipeline.glass.lag_tracker import LagTracker
from pipeline.glass.lens_meter import SPREAD_S, TILT, GlassCorners, GlassViews, LensMeter
from pipeline.glass.turn_meter import HeldTurning, TurnMeter
from pipeline.glass.window import Glass, Hanging, pierced, seen_through
from pipeline.signals import PhoneImu, StampOffset, VisionMeasurement

Phase = Literal["search", "sweep", "robot"]
"""Fiducials alone; and a light that sweeps, drawn by the page itself; and the robot's LEDs."""
PathAhead = Callable[[float], Sequence[tuple[float, Array, Array]]]
"""Where the robot goes within so long [s], oldest first: (t [s], wxyz_fb, p_bf_in_f [m])."""
STEP_S = 0.01
"""Between the places of a light that are told at once."""
DRAWN = 2
"""Of the places that are told at once, the one that the page draws from: on its way, and until the
next frame, 20 ms pass. The others are told again, as they are then known."""
HORIZON_S = 0.06
"""So far beyond the display lag: the way to the page, and a frame of the glass."""
NEAREST_M = 0.30
FARTHEST_WIDTHS = 2.5
"""Beyond, in widths of the glass, the LEDs are too small in the picture."""
CORRECTED_S = 0.003
"""By so much at most a picture corrects a lag: the lights jump by it times their speed."""
LOOK = "Point the phone at the screen, all four corners in the picture."
MEASURES = "Hold the phone still: measuring how late this screen is."
LAGS = (
    "This screen shows everything {late_ms:.0f} ms late, which is too late to lead by: choose its "
    "game mode, or another one."
)
LEADS = "The light is seen before it is drawn: the clocks are not known yet. Wait a moment."
LATE = (
    "The phone's pictures come {late_ms:.0f} ms late, too late to show a robot by: "
    "use a 5 GHz Wi-Fi or a cable."
)
SURE = 2.0
"""Standard deviations by which a lag must be wrong before it is corrected."""
LEAST_PER_HEIGHT = 1.15
"""Height of the glass, of the LEDs' own: less, and they hardly stay on it."""


@dataclass(frozen=True, slots=True, eq=False)
class Lights:
    """What the glass shall show."""

    phase: Phase
    why: str = ""
    """What is wrong, in words for the person who can mend it."""
    t: float = 0.0
    """Of the light of the first places [s]; the others follow, `STEP_S` apart."""
    places: Array | None = None
    """(k, n, 2) of each LED on the glass [m], right and up; NaN where there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class GlassSeen:
    """What one camera has shown of one glass so far."""

    lag: DisplayLag | None
    """From drawing to the date of the picture that shows it: what dates are wrong by is in it."""
    t_lag: float
    """Of the picture that said so last [s]."""
    views: GlassViews
    """For the focal length."""
    held: HeldTurning | None
    """What share of its trembling pictures hide."""


def least_height(leds_in_b: Array) -> float:
    """Of a glass that these LEDs (n, 3) fit [m]."""
    return LEAST_PER_HEIGHT * float(np.ptp(leds_in_b[:, 2]))


class RobotOfLight:
    """One robot behind one glass, for one phone."""

    def __init__(self, leds_in_b: Array, glass: Glass) -> None:
        """Nothing is known of the phone and of the display."""
        self.glass, self._leds_in_b = glass, leds_in_b
        self._eye = EyeTracker(glass)
        self._meter = self._new_meter()
        self._tracker = LagTracker()
        self._lens: LensMeter | None = None
        """None: the lens is calibrated, or was measured."""
        self.dated_lag: DisplayLag | None = None
        """From drawing to a picture's date, once it is measured; followed from then on."""
        self._t_lag = -np.inf
        self.is_shown = False
        """To the camera in use, since its lag was fit."""
        self._views: GlassViews | None = None
        self._turns = TurnMeter()
        self.eye: Eye | None = None
        """At the last step."""
        self._late_s = 0.0
        """How old the newest picture of the glass was when it came [s]."""

    def begin_camera(self, camera: Camera, *, is_guessed: bool) -> None:
        """Another camera films the glass now; one whose lens `is_guessed` is measured first."""
        self._eye, self.eye = EyeTracker(self.glass), None
        # through another lens lights seem elsewhere, which a meter would take for a lag
        self._meter = self._new_meter()
        self._tracker, self.is_shown = LagTracker(), False
        self._lens = LensMeter(camera, self.glass) if is_guessed else None
        self._turns = TurnMeter()
        self._views = GlassViews(camera, self.glass, SPREAD_S)

    def _new_meter(self) -> DisplayLagMeter:
        return DisplayLagMeter(SWEEP_SHARE * self.glass.width_m)

    def lens_of(self, camera: Camera) -> SimpleLens | None:
        """What a camera that was guessed truly has, once it is measured."""
        meter = self._lens
        return meter.lens if meter is not None and meter.camera is camera else None

    @property
    def seen(self) -> GlassSeen | None:
        """What the camera in use has shown of the glass; any thread may ask."""
        views = self._views
        if views is None:
            return None
        return GlassSeen(self.dated_lag, self._t_lag, views, self._turns.held())

    @property
    def lag(self) -> DisplayLag | None:
        """Of the display; what dates are wrong by, as far as the glass knows it, is not in it.

        Control dates pictures by that, too: both must, or the robot is drawn for another moment
        than the one at which control believes to see it.
        """
        lag = self.dated_lag
        return None if lag is None else DisplayLag(lag.value + self._misdated_s, lag.sigma)

    @property
    def _misdated_s(self) -> float:
        """So much later than it is dated a picture was taken [s]."""
        offset = self.time_offset
        return 0.0 if offset is None else offset.value

    @property
    def time_offset(self) -> StampOffset | None:
        """Of the camera's stamps, by the glass: how late lights are is not in it."""
        return self._eye.time_offset

    def add_phone_imu(self, sample: PhoneImu) -> None:
        """The phone has moved."""
        self._eye.add_phone_imu(sample)
        self._turns.add_phone_imu(sample)

    def add_corners(self, corners: GlassCorners) -> None:
        """The phone has seen corners of fiducials."""
        if self._lens is not None:
            self._lens.add_corners(corners)
        if self._views is not None:
            self._views.add(corners)

    def add_seen(self, seen: VisionMeasurement, lights_in_c: Array, now: float) -> None:
        """The phone has seen the glass, and lights in directions (n, 3), the brightest first."""
        self._eye.add_seen(seen, now)
        self._late_s = now - seen.t
        if seen.pose is None:
            return
        self._turns.add_pose(seen.pose)
        if not len(lights_in_c):
            return
        R_gc = seen.pose.R_cb.T
        places = seen_through(-R_gc @ seen.pose.p_bc_in_c, lights_in_c @ R_gc.T)
        lag = self.lag
        if lag is None or self.dated_lag is None or not self._is_fit(lag):
            self._measure(seen.t, places)
        else:
            self._tracker.add_seen(seen.t, places[self.glass.has(places)])
            self._follow(self.dated_lag, seen.t)

    def _is_fit(self, lag: DisplayLag) -> bool:
        """Whether it may be led by; one that no longer is, is measured from nothing."""
        is_fit = lag.is_fit(is_shown=self.is_shown)
        if not is_fit and self.is_shown:
            self.is_shown, self._meter = False, self._new_meter()
        return is_fit

    def _measure(self, t: float, places: Array) -> None:
        """Take where a light sweeps: the brightest of all on its line, clear of the fiducials.

        These seem brighter than it from farther away, where it is smaller.
        """
        right, up = np.abs(places).T
        sweeps = up < 0.5 * self.glass.tile_m
        sweeps &= right < SWEEP_SHARE * self.glass.width_m + 0.5 * self.glass.tile_m
        if sweeps.any():
            self._meter.add_position(t, float(places[sweeps][0, 0]))
            found = self._meter.lag()
            if found is not None:
                self.dated_lag, self._t_lag, self._tracker = found, t, LagTracker()

    def _follow(self, lag: DisplayLag, t: float) -> None:
        """Correct a lag that the robot's own lights deny."""
        error = self._tracker.error()
        if error is not None:
            self._t_lag = t
        if error is not None and abs(error.value) > SURE * error.sigma:
            step = min(max(error.value, -CORRECTED_S), CORRECTED_S)
            self.dated_lag = DisplayLag(lag.value - step, error.sigma)
            self._tracker.corrected(step)

    def step(self, now: float, robot: PathAhead) -> Lights:
        """What to show from `now` [s] on."""
        if self.glass.height_m < least_height(self._leds_in_b):
            return Lights("search", "This robot does not fit the screen: choose a larger screen, "
                          "or start with --robot screen.")  # fmt: skip
        self.eye = eye = self._eye.at(now)
        up_in_g = self._eye.up_in_g
        if eye is None or up_in_g is None or not eye.is_sure:
            late_s = self._late_s
            is_late = late_s > OLD_S and eye is not None and eye.age < late_s + OLD_S
            return Lights("search", LATE.format(late_ms=1e3 * late_s) if is_late else LOOK)
        lag = self.lag
        if lag is None:
            return Lights("sweep", self._misplaced(eye) or MEASURES)
        if not self._is_fit(lag):
            # measured on: another mode of the display, or clocks that are known by then, mend it
            late_ms = 1e3 * lag.value
            return Lights("sweep", LAGS.format(late_ms=late_ms) if late_ms > 0.0 else LEADS)
        if self._lens is not None:
            return Lights("search", self._misplaced(eye) or TILT)
        return self._shown(eye, up_in_g, now, lag, robot)

    def _shown(
        self, eye: Eye, up_in_g: Array, now: float, lag: DisplayLag, robot: PathAhead
    ) -> Lights:
        start, hanging = now + lag.value, Hanging.of(up_in_g, self._leds_in_b)
        path = robot(max(lag.value, 0.0) + HORIZON_S)
        times, wxyz, p = (np.array(part) for part in zip(*path, strict=True))
        places = np.empty((round(HORIZON_S / STEP_S) + 1, len(self._leds_in_b), 2))
        for k in range(len(places)):
            t = start + k * STEP_S
            i = int(np.abs(times - t).argmin())  # of a path with a step of a few milliseconds
            leds_in_g = hanging.leds_in_g(R_from_wxyz(wxyz[i]), p[i], self._leds_in_b)
            places[k] = pierced(eye.at(t), leds_in_g)
        self._tracker.add_drawn(start + DRAWN * STEP_S - self._misdated_s, places[DRAWN])
        self.is_shown = True
        return Lights("robot", self._misplaced(eye), start, places)

    def _misplaced(self, eye: Eye) -> str:
        distance = -float(eye.p_in_g[0])
        if distance < NEAREST_M:
            return "The phone is too near: go back a little."
        if distance > FARTHEST_WIDTHS * self.glass.width_m:
            return "The phone is too far away: come nearer."
        return ""
