"""A page that films a simulated robot: a canvas for a camera, a hand for sensors; any browser."""

from __future__ import annotations

import json
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hardware.sim.hand import Hand
from hardware.sim.reference_trajectory import Pose, ReferenceTrajectory
from hardware.sim.truth import Truth, TruthClient
from pipeline.camera.lens import Camera
from pipeline.config import VirtualCameraConfig
from pipeline.frames import GRAVITY, R_cd, exp, log
from tests.e2e.chromium_channel import SENSORS
from tests.e2e.page_scripts import FELT, PAINTED_CAMERA, TICKER
from tests.e2e.witness import PERIOD_S, Hole, Witness

STEP_S = 0.01
"""The hand is told so often, to the page where that manages."""
AHEAD_S = 1e-3 * np.array((0, 10, 20, 30, 40, 60, 80, 100, 120, 150, 180, 210, 250, 300, 350, 400))
"""When the lights are told from now on: a page that is told late still shows where the hand is."""
RECENT_S = 0.02
"""The robot's last motion, which is taken to go on."""


def _camera(width: int) -> Camera:
    """16:9, 69° wide."""
    f, c = 930.0 * width / 1280, 0.5 * width
    K = np.array([[f, 0.0, c], [0.0, f, 0.5625 * c], [0.0, 0.0, 1.0]])
    return Camera(width, width * 9 // 16, K, "plumb_bob", np.zeros(5))


CAMERA, HD_CAMERA = _camera(640), _camera(1280)
"""Robots are filmed in small pictures: two processors paint, encode, decode, fly and judge."""


CANVAS = """
(() => {
  const canvas = Object.assign(document.createElement('canvas'), {width: WIDTH, height: HEIGHT});
  const paint = canvas.getContext('2d', {alpha: false});
  // A frame shows the lights where they are when it is painted, from what was told of the future.
  let told = null;
  window.tellSpots = (times, spots) => { told = {times, spots}; };
  const at = (now, {times, spots}) => {
    const t = Math.min(now, times.at(-1));
    const next = Math.max(1, times.findIndex((later) => later >= t));
    const share = (t - times[next - 1]) / (times[next] - times[next - 1]);
    const mix = (from, to) => from.map((value, k) => value + share * (to[k] - value));
    return spots[next - 1].map((spot, i) => mix(spot, spots[next][i]));
  };
  const draw = (spots) => {
    paint.fillStyle = '#1c1c1c';
    paint.fillRect(0, 0, canvas.width, canvas.height);
    for (const [u, v, r] of spots) {
      const light = paint.createRadialGradient(u, v, 0, u, v, r + 1);
      light.addColorStop(0, '#fff');
      light.addColorStop(r / (r + 1), '#eee');
      light.addColorStop(1, 'rgba(28,28,28,0)');
      paint.fillStyle = light;
      paint.beginPath();
      paint.arc(u, v, r + 1, 0, 7);
      paint.fill();
    }
  };
  const paintAt = (now) => draw(told ? at(now, told) : []);
  PAINTED_CAMERA
})();
"""
CANVAS = CANVAS.replace("WIDTH", str(CAMERA.width)).replace("HEIGHT", str(CAMERA.height))
CANVAS = CANVAS.replace("PAINTED_CAMERA", PAINTED_CAMERA)
PLAYED = CANVAS + FELT + TICKER


@dataclass(frozen=True, slots=True, eq=False)
class Felt:
    """What the sensors of a phone in a hand feel."""

    hand: Hand
    R_dc: np.ndarray

    def __call__(self, t: float) -> dict[str, np.ndarray]:
        """At `t` [s], in d: force with and without gravity, turn rate.

        By the names of the Generic Sensor API, each (3,) [m/s², m/s², rad/s].
        """
        force_in_d = self.R_dc @ self.hand.specific_force_in_c(t)
        up_in_d = self.R_dc @ self.hand.pose(t)[0][2] * GRAVITY
        omega_in_d = self.R_dc @ self.hand.omega_in_c(t)
        return {
            "accelerometer": force_in_d,
            "gyroscope": omega_in_d,
            "linear-acceleration": force_in_d - up_in_d,
        }


class PlayedPhone(ABC):
    """Plays a hand into a page: moves the picture and the sensors together."""

    def __init__(
        self, hand: Hand, leds_in_b: np.ndarray, truth_port: int, screen_angle_deg: float
    ) -> None:
        """`leds_in_b` (n, 3) [m]; the page's `screen.orientation.angle` [°]."""
        self._hand, self._leds_in_b = hand, leds_in_b
        self.moves_at = -np.inf
        """When the hand begins to move [s, monotonic]."""
        self._truth = TruthClient(truth_port, timeout=1.0)
        self._felt = Felt(hand, R_cd(screen_angle_deg).T)
        self._stepped = time.monotonic()
        self._page_shown, self._epoch = "", 0.0
        self._felt_in, self._felt_until = 0.0, 0.0
        """The epoch of the page that was told what will be felt, and until when [s]."""
        self._witness = Witness(PERIOD_S)
        self._still: list[Hole] = []
        """When what is played stood still, as no phone's hardware does."""
        ReferenceTrajectory.warm_up()

    @property
    @abstractmethod
    def address(self) -> str:
        """Of the page."""

    @abstractmethod
    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression."""

    @abstractmethod
    def _tell(self, future: str) -> None:
        """Run a JavaScript expression that tells what will be seen and felt."""

    @abstractmethod
    def tap(self, selector: str) -> None:
        """Touch an element shortly."""

    @abstractmethod
    def hold(self) -> None:
        """Put a finger on the big button."""

    @abstractmethod
    def let_go(self) -> None:
        """Take it off."""

    def close(self) -> None:
        """Give the truth's socket back, dismiss the witness."""
        self._witness.close()
        self._truth.close()

    def holes(self, since: float) -> list[Hole]:
        """Of the machine and of the page, after a time [s, monotonic]."""
        page = [
            Hole("page", self._page_epoch() + 1e-3 * end, 1e-3 * length)
            for end, length in self.evaluate("pageHoles.splice(0)")
        ]
        own = (*page, *self._still)
        return [*self._witness.holes(since), *(hole for hole in own if hole.t >= since)]

    def step(self) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Show what the camera would see now; gives the poses of hand and body."""
        time.sleep(max(0.0, self._stepped + STEP_S - time.monotonic()))
        truth = self._truth.latest()
        told_until = self._stepped + AHEAD_S[-1]
        self._stepped = time.monotonic()
        self._tell(f"({self._shown(truth)}, {self._felt_ahead()}, null)")
        if (late_s := time.monotonic() - told_until) > 0.0:
            self._still.append(Hole("lights", time.monotonic(), late_s))
        t = float(truth.t[-1])
        return self._hand.pose(t), truth.at(t)

    def _shown(self, truth: Truth) -> str:
        """The expression that paints the lights from now on."""
        t = float(truth.t[-1])
        times = (1e3 * (t - self._page_epoch() + AHEAD_S)).tolist()
        bodies = _onwards(truth)
        hands = [self._hand.pose(t + ahead) for ahead in AHEAD_S]
        spots = self._spots(hands, bodies).round(4).tolist()
        return f"tellSpots({json.dumps(times)}, {json.dumps(spots)})"

    def _felt_ahead(self) -> str:
        """The expression that tells what sensors will feel, where that was not told yet."""
        epoch, now = self._page_epoch(), self._stepped
        if epoch != self._felt_in:
            self._felt_in, self._felt_until = epoch, now
        times = np.arange(max(self._felt_until, now), now + AHEAD_S[-1], STEP_S)
        if len(times):
            self._felt_until = times[-1] + STEP_S
        rows = [[1e3 * (t - epoch), *self._felt_at(t)] for t in times.tolist()]
        return f"tellFelt({json.dumps(rows)})"

    def _felt_at(self, t: float) -> list[float]:
        felt = self._felt(t)
        return np.concatenate([felt[name] for name in SENSORS]).tolist()

    def _spots(self, hands: Sequence[Pose], bodies: Sequence[Pose]) -> np.ndarray:
        """(n, LEDs, 3) u, v, radius [px] of each LED, for each pair of poses."""
        poses = zip(hands, bodies, strict=True)
        q = np.concatenate([(b[1] - h[1] + self._leds_in_b @ b[0].T) @ h[0] for h, b in poses])
        radius = CAMERA.K[0, 0] * 0.008 / q[:, :1]
        return np.hstack((CAMERA.pixels(q), radius)).reshape(len(hands), -1, 3)

    def _page_epoch(self) -> float:
        """When the page's clock began [s]; from the quickest of some questions."""
        if self._page_shown != self.address:
            self._page_shown, answers = self.address, []
            for _ in range(10):
                asked = time.monotonic()
                elapsed = 1e-3 * float(self.evaluate("performance.now()"))
                answered = time.monotonic()
                answers.append((answered - asked, 0.5 * (asked + answered) - elapsed))
            self._epoch = min(answers)[1]
        return self._epoch

    def play(self, seconds: float) -> None:
        """Play without measuring."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.step()

    def play_until(self, condition: str, seconds: float) -> None:
        """Play until a JavaScript expression is true.

        Raises:
            TimeoutError: it never was.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.step()
            if self.evaluate(condition):
                return
        raise TimeoutError(f"{condition} within {seconds} s; the page says: {self.words()}")

    def choose(self, selector: str, value: str) -> None:
        """In a list, as a person does, who can't be imitated in a list of the system's own."""
        list_is = f"list = document.querySelector({json.dumps(selector)})"
        choice = f"list.value = {json.dumps(value)}; list.dispatchEvent(new Event('change'));"
        self.evaluate(f"(({list_is}) => {{ {choice} }})()")

    def words(self) -> str:
        """All that is written on the page."""
        return str(self.evaluate("document.body.innerText")).replace("\n", " · ")

    def track(
        self,
        seconds: float,
        meanwhile: Iterable[tuple[float, Callable[[], object]]] = (),
        is_over: Callable[[], bool] = lambda: False,
        rest_s: float = 0.0,
    ) -> list[tuple[float, float]]:
        """Play while the button is held: (time [s], distance from where the hand means it [m]).

        Times count from `rest_s` from now, when the hand begins to move. `meanwhile` is what to do
        when, in order; no longer than until it `is_over`.
        """
        waiting = deque(meanwhile)
        hand, body = self.step()
        before = time.monotonic()
        started = before + rest_s
        intent = ReferenceTrajectory(VirtualCameraConfig(), hand, body)
        distances: list[tuple[float, float]] = []
        while (now := time.monotonic()) < started + seconds and not is_over():
            hand, body = self.step()
            _, p_rf = intent.step(hand, now - before)
            before = now
            distances.append((now - started, float(np.linalg.norm(body[1] - p_rf))))
            if waiting and now - started >= waiting[0][0]:
                waiting.popleft()[1]()
        return distances

    @staticmethod
    def rms_mm(distances: list[tuple[float, float]], after_s: float) -> float:
        """RMS of what came after the first seconds [mm]."""
        kept = [distance for t, distance in distances if t >= after_s]
        return 1e3 * float(np.sqrt(np.mean(np.square(kept))))


def _onwards(truth: Truth) -> list[Pose]:
    """Of the body at all times predicted, if it goes on as it did."""
    t = float(truth.t[-1])
    (R_before, p_before), (R, p) = truth.at(t - RECENT_S), truth.at(t)
    v, turn = (p - p_before) / RECENT_S, log(R @ R_before.T) / RECENT_S
    return [(exp(ahead * turn) @ R, p + ahead * v) for ahead in AHEAD_S]
