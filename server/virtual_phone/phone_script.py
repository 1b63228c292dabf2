"""What the page of a virtual phone sends, and what the person holding it does. Sans-I/O."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hardware.codec import Encoder
from hardware.sim.phone import BodyHistory, VirtualPhone
from hardware.sim.reference_trajectory import ReferenceTrajectory, missed_by
from pipeline.config import VirtualCameraConfig
from server.protocol.messages import VIRTUAL_DEVICE, Command
from server.protocol.wire import Kind
from server.protocol.wire_records import Codec, Motion, Picture, Pong, Record, Touch

DEVICE = VIRTUAL_DEVICE
TOUCH_S = 1.0 / 30.0
RELEASED_S = 0.3
"""Between a press that changed nothing and the next."""
SYNCHRONISED_PONGS = 10
"""After so many answers the server can date what comes, unless the network is slow or jitters."""
SCORE_STEP_S = 0.005
ALL = np.ones(6, dtype=np.bool_)
CODECS = {"jpeg": Codec.JPEG, "h264": Codec.H264, "vp8": Codec.VP8}


@dataclass(frozen=True, slots=True)
class Manners:
    """How the person behaves."""

    press_after_s: float = 0.7
    """Between ARMED and the press."""
    hold_s: float = 1.0
    """A press that changed nothing is given up after this, and soon made anew."""
    pause_s: float = 1.0
    """Before a press after HOLD, and between requests to arm."""
    not_before_s: float = -np.inf
    """No press while ARMED before this time."""
    again: bool = True
    """After HOLD press again, after DISARMED arm again; else once is enough."""


class VirtualOperator:
    """The person: asks to arm when that would be granted, then holds the button to move."""

    def __init__(self, manners: Manners = Manners()) -> None:
        """Begin with nothing seen."""
        self._manners = manners
        self.mode, self._since = "LOST", -np.inf
        self._asked = -np.inf
        self._flights = 0
        self._held, self.presses, self.t_press = False, 0, -np.inf
        self.leaving = False
        """Set it to let go and press no more."""

    def see(self, mode: str, ready: bool, t: float) -> Command | None:
        """Read the status shown at `t` [s]; gives the request it leads to, if any."""
        if mode != self.mode:
            self._flights += mode == "TRACK"
            self.mode, self._since = mode, t
        if mode != "DISARMED" or not ready or self.leaving:
            return None
        tired = self._flights > 0 and not self._manners.again
        if tired or t - self._asked < self._manners.pause_s:
            return None
        self._asked = t
        return Command("arm")

    def touch(self, t: float) -> tuple[bool, int]:
        """(held, count of presses) at `t` [s]."""
        held = self._wants_to_hold(t)
        if held and not self._held:
            self.presses, self.t_press = self.presses + 1, t
        self._held = held
        return held, self.presses

    def _wants_to_hold(self, t: float) -> bool:
        if self.leaving or self.mode == "LOST":
            return False
        manners, waited = self._manners, t - self._since
        if self.mode in ("TRACK", "COAST"):
            return self._held
        if self.mode == "ARMED":
            waited = min(waited - manners.press_after_s, t - manners.not_before_s)
        elif self.mode == "HOLD" and manners.again:
            waited -= manners.pause_s
        else:
            return False
        return waited >= 0.0 and waited % (manners.hold_s + RELEASED_S) < manners.hold_s


class PhoneScript:
    """Packs what a virtual phone gives into records of the wire."""

    def __init__(self, phone: VirtualPhone, encoder: Encoder, operator: VirtualOperator) -> None:
        """One page of one phone; `encoder` keeps state between pictures."""
        self.phone, self.operator = phone, operator
        self._encoder = encoder
        self._sequences = dict.fromkeys(Kind, 0)
        self._nonce = 0
        self.pongs = 0

    def motion(self, t: float) -> Record:
        """MOTION of the sensors at `t` [s]."""
        reading = self.phone.motion(t)
        x, y, z = reading.omega_m_in_d.tolist()
        a_x, a_y, a_z = reading.a_m_in_d.tolist()
        angle = reading.screen_angle_deg
        body = Motion((x, y, z), (a_x, a_y, a_z), reading.R_ed_wxyz, angle)
        return self._record(Kind.MOTION, t, body)

    def picture(self, t: float, robot: BodyHistory, key: bool = False) -> Record:
        """FRAME exposed around `t` [s], decodable alone if `key`; in the order of time only."""
        data, key = self._encoder.encode(self.phone.picture(t, robot), key)
        camera, angle = self.phone.camera, self.phone.options.screen_angle_deg
        codec = CODECS[self._encoder.codec]
        body = Picture(codec, key, camera.width, camera.height, angle, data)
        return self._record(Kind.FRAME, self.phone.dated(t), body)

    def touch(self, t: float) -> Record:
        """TOUCH at `t` [s]; call it every `TOUCH_S`."""
        held, press = self.operator.touch(t)
        return self._record(Kind.TOUCH, t, Touch(held, True, press, self._nonce))

    def pong(self, nonce: int, server_time_us: int, t: float) -> Record:
        """The answer to a PING that reached the page at `t` [s]."""
        self._nonce = nonce
        self.pongs += 1
        return self._record(Kind.PONG, t, Pong(nonce, server_time_us))

    def _record(self, kind: Kind, t: float, body: Motion | Picture | Touch | Pong) -> Record:
        sequence = self._sequences[kind]
        self._sequences[kind] = (sequence + 1) & 0xFFFFFFFF
        return Record(sequence, round(1e6 * self.phone.clock.at(t)), body)


class TrackingMetrics:
    """How well the robot kept to what the hand meant: RMS over all the time of tracking."""

    def __init__(
        self, phone: VirtualPhone, config: VirtualCameraConfig, axes: npt.NDArray[np.bool_] = ALL
    ) -> None:
        """`config` is the virtual camera's, whose lag is part of the intent; `axes` the robot's."""
        ReferenceTrajectory.warm_up()
        self._phone, self._config, self._axes = phone, config, axes
        self._reference: ReferenceTrajectory | None = None
        self._t = -np.inf
        self._sum_m2 = self._sum_rad2 = 0.0
        self.max_m = 0.0
        self._steps = 0

    @property
    def tracked_s(self) -> float:
        """Time of tracking so far."""
        return self._steps * SCORE_STEP_S

    @property
    def rms_m(self) -> float:
        """Distance of the body from the intended place, RMS [m]; NaN before the first tracking."""
        return float(np.sqrt(self._sum_m2 / self._steps)) if self._steps else float("nan")

    @property
    def rms_rad(self) -> float:
        """RMS error of the attitude [rad]."""
        return float(np.sqrt(self._sum_rad2 / self._steps)) if self._steps else float("nan")

    def tune(self, config: VirtualCameraConfig) -> None:
        """The virtual camera is another one from now on."""
        if config != self._config and self._reference is not None:
            self._reference.tune(config)
        self._config = config

    def start(self, t: float, robot: BodyHistory) -> None:
        """The button was pressed at `t` [s]: from here the robot is to be led."""
        self._reference = ReferenceTrajectory(self._config, self._phone.hand.pose(t), robot(t))
        self._t = t

    def advance(self, t: float, robot: BodyHistory, *, counted: bool = True) -> None:
        """Follow the intent up to `t` [s]; `counted`: the robot is tracking it."""
        while self._reference is not None and self._t + SCORE_STEP_S <= t:
            self._t += SCORE_STEP_S
            intended = self._reference.step(self._phone.hand.pose(self._t), SCORE_STEP_S)
            if not counted:
                continue
            offset, turn = missed_by(robot(self._t), intended, self._axes)
            distance2 = float(offset @ offset)
            self._sum_m2 += distance2
            self._sum_rad2 += float(turn @ turn)
            self.max_m = max(self.max_m, float(np.sqrt(distance2)))
            self._steps += 1
