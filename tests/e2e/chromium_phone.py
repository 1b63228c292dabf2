"""A real Chromium on the phone page: a canvas for a camera, sensors fed through CDP."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from playwright.sync_api import BrowserContext, CDPSession, Page, sync_playwright

from hardware.sim.hand import Hand
from hardware.sim.intent import Intent, Pose
from hardware.sim.truth import Truth, TruthClient
from pipeline.camera.lens import Camera
from pipeline.config import VirtualCameraConfig
from pipeline.frames import GRAVITY, R_cd

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--use-fake-ui-for-media-stream",
    "--use-fake-device-for-media-stream",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-renderer-backgrounding",
    "--disable-backgrounding-occluded-windows",
]
LENS = "canvas camera"
AHEAD_S = 0.02
"""So far each picture is foretold."""
CAMERA = Camera(
    1280,
    720,
    np.array([[930.0, 0.0, 640.0], [0.0, 930.0, 360.0], [0.0, 0.0, 1.0]]),
    "plumb_bob",
    np.zeros(5),
)
CALIBRATION = """image_width: 1280
image_height: 720
camera_name: {name}
camera_matrix: {{rows: 3, cols: 3, data: [930, 0, 640, 0, 930, 360, 0, 0, 1]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
"""
CANVAS = """
(() => {
  const canvas = Object.assign(document.createElement('canvas'), {width: 1280, height: 720});
  const paint = canvas.getContext('2d', {alpha: false});
  // A frame shows the lights where they are when it is painted, from what was told of two moments.
  let told = null;
  window.tellSpots = (t, t_ahead, spots, ahead) => { told = {t, t_ahead, spots, ahead}; };
  const between = ({t, t_ahead, spots, ahead}) => {
    const share = Math.min(2, (performance.now() - t) / (t_ahead - t));
    return spots.map((spot, i) => spot.map((now, k) => now + share * (ahead[i][k] - now)));
  };
  const draw = (spots) => {
    paint.fillStyle = '#1c1c1c';
    paint.fillRect(0, 0, 1280, 720);
    for (const [u, v, r] of spots) {
      const light = paint.createRadialGradient(u, v, 0, u, v, r + 2);
      light.addColorStop(0, '#fff');
      light.addColorStop(r / (r + 2), '#eee');
      light.addColorStop(1, 'rgba(28,28,28,0)');
      paint.fillStyle = light;
      paint.beginPath();
      paint.arc(u, v, r + 2, 0, 7);
      paint.fill();
    }
  };
  const onFrame = () => {
    draw(told ? between(told) : []);
    requestAnimationFrame(onFrame);
  };
  onFrame();
  navigator.mediaDevices.getUserMedia = async () => {
    const stream = canvas.captureStream(30);
    const [track] = stream.getVideoTracks();
    Object.defineProperty(track, 'label', {value: 'LENS'});
    return stream;
  };
})();
""".replace("LENS", LENS)


@contextlib.contextmanager
def browser(
    executable: str, camera_file: Path | None = None, **options: object
) -> Iterator[BrowserContext]:
    """A context with everything granted that the phone page asks for.

    The camera plays `camera_file` (y4m) round and round, or else a pattern of Chromium's own.
    """
    played = [f"--use-file-for-fake-video-capture={camera_file}"] if camera_file else []
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=executable, args=FLAGS + played)
        context = chromium.new_context(
            ignore_https_errors=True,
            permissions=["camera", "accelerometer", "gyroscope", "magnetometer"],
            **options,  # type: ignore[arg-type]
        )
        try:
            yield context
        finally:
            chromium.close()


class ChromiumPhone:
    """Plays a hand into a page: moves the picture and the sensors together."""

    def __init__(
        self, context: BrowserContext, hand: Hand, leds_in_b: np.ndarray, truth_port: int
    ) -> None:
        """`leds_in_b` (n, 3) [m]."""
        self.page: Page = context.new_page()
        self.page.add_init_script(CANVAS)
        self._cdp: CDPSession = context.new_cdp_session(self.page)
        self._hand, self._leds_in_b = hand, leds_in_b
        self._truth = TruthClient(truth_port, timeout=1.0)
        self._R_dc = R_cd(90.0).T  # a phone emulated in landscape: screen.orientation.angle = 90
        self._stepped = time.monotonic()
        self._page_shown, self._epoch = "", 0.0
        Intent.warm_up()
        for kind in ("accelerometer", "gyroscope", "linear-acceleration"):
            self._override(kind, (0.0, 0.0, 0.0), enable=True)

    def _override(self, kind: str, xyz: tuple[float, float, float], enable: bool = False) -> None:
        if enable:
            self._cdp.send(
                "Emulation.setSensorOverrideEnabled",
                {"enabled": True, "type": kind, "metadata": {}},
            )
        reading = {"xyz": dict(zip("xyz", xyz, strict=True))}
        self._cdp.send("Emulation.setSensorOverrideReadings", {"type": kind, "reading": reading})

    def close(self) -> None:
        """Give the truth's socket back."""
        self._truth.close()

    def step(self) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Show what the camera would see and feel now; gives the poses of hand and body."""
        truth = self._truth.latest()
        t = float(truth.t[-1])
        body, hand = truth.at(t), self._hand.pose(t)
        self._show(t, hand, body, (self._hand.pose(t + AHEAD_S), _onwards(truth, AHEAD_S)))
        now = time.monotonic()
        t_felt, self._stepped = now + 0.5 * (now - self._stepped), now  # what is set is read on
        force_in_d = self._R_dc @ self._hand.specific_force_in_c(t_felt)
        up_in_d = self._R_dc @ self._hand.pose(t_felt)[0][2] * GRAVITY
        self._override("accelerometer", _triple(force_in_d))
        self._override("linear-acceleration", _triple(force_in_d - up_in_d))
        self._override("gyroscope", _triple(self._R_dc @ self._hand.omega_in_c(t_felt)))
        return hand, body

    def _show(self, t: float, hand: Pose, body: Pose, ahead: tuple[Pose, Pose]) -> None:
        t_page = 1e3 * (t - self._page_epoch())
        self.page.evaluate(
            "told => tellSpots(...told)",
            [t_page, t_page + 1e3 * AHEAD_S, self._spots(hand, body), self._spots(*ahead)],
        )

    def _spots(self, hand: Pose, body: Pose) -> list[list[float]]:
        """(u, v, radius) [px] of each LED."""
        q = (body[1] - hand[1] + self._leds_in_b @ body[0].T) @ hand[0]
        radius = 930.0 * 0.008 / q[:, :1]
        spots: list[list[float]] = np.hstack((CAMERA.pixels(q), radius)).tolist()
        return spots

    def _page_epoch(self) -> float:
        """When the page's clock began [s]; from the quickest of some questions."""
        if self._page_shown != self.page.url:
            self._page_shown, answers = self.page.url, []
            for _ in range(10):
                asked = time.monotonic()
                elapsed = 1e-3 * float(self.page.evaluate("performance.now()"))
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
            if self.page.evaluate(condition):
                return
        raise TimeoutError(f"{condition} within {seconds} s; the page says: {self.words()}")

    def words(self) -> str:
        """All that is written on the page."""
        return str(self.page.evaluate("document.body.innerText")).replace("\n", " · ")

    def hold(self) -> None:
        """Put a finger on the big button."""
        box = self.page.locator("#hold").bounding_box()
        assert box is not None
        point = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
        self._cdp.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [point]})

    def let_go(self) -> None:
        """Take it off."""
        self._cdp.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    def track(self, seconds: float) -> list[tuple[float, float]]:
        """Play while the button is held: (time [s], distance from where the hand means it [m])."""
        hand, body = self.step()
        started = before = time.monotonic()
        intent = Intent(VirtualCameraConfig(), hand, body)
        distances: list[tuple[float, float]] = []
        while (now := time.monotonic()) < started + seconds:
            hand, body = self.step()
            _, p_rf = intent.step(hand, now - before)
            before = now
            distances.append((now - started, float(np.linalg.norm(body[1] - p_rf))))
        return distances

    @staticmethod
    def rms_mm(distances: list[tuple[float, float]], after_s: float) -> float:
        """RMS of what came after the first seconds [mm]."""
        kept = [distance for t, distance in distances if t >= after_s]
        return 1e3 * float(np.sqrt(np.mean(np.square(kept))))


def _onwards(truth: Truth, seconds: float) -> Pose:
    """Of the body after the last known moment, if it goes on as it did."""
    t = float(truth.t[-1])
    (R_before, p_before), (R, p) = truth.at(t - seconds), truth.at(t)
    return R @ R_before.T @ R, 2.0 * p - p_before


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    return (float(v[0]), float(v[1]), float(v[2]))
