"""Films of a robot at rest, for surveys: a phone that walks about it in a hand."""

from dataclasses import dataclass

import cv2
import numpy as np

from hardware.led_layout.viewpoints import attitude
from hardware.sim.render import RenderOptions, render
from pipeline.frames import exp, log
from pipeline.signals import Spots
from server.tools.survey.reconstruction.detections import FrameSpots

TREMOR_RAD, TREMOR_HZ = np.radians(0.15), 9.0
SWAY_RAD = np.radians(3.0)


@dataclass(frozen=True)
class Walk:
    """Poses of a phone over time, and what its gyroscope and accelerometer feel."""

    azimuth_deg: float = 30.0
    elevation_deg: float = 15.0
    distance: float = 2.5
    seconds: float = 5.0

    def pose(self, t):
        turn = 2.0 * np.pi * t / self.seconds
        azimuth = np.radians(self.azimuth_deg) * np.sin(turn)
        elevation = np.radians(self.elevation_deg) * np.sin(2.0 * turn + 0.3)
        flat = np.cos(elevation)
        to_camera = np.array([-np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(elevation)])
        sway = SWAY_RAD * np.sin(2.0 * np.pi * np.array([0.7, 0.9, 0.5]) * t + np.arange(3))
        tremor = TREMOR_RAD * np.sin(2.0 * np.pi * TREMOR_HZ * t + np.arange(3))
        R_cb = exp(sway + tremor) @ attitude(to_camera)
        return R_cb, -R_cb @ to_camera * self.distance * (1.0 + 0.1 * np.sin(turn))

    def imu(self, hz=200.0):
        """Samples (m, 7) with the specific force of gravity alone."""
        times, step = np.arange(-0.1, self.seconds + 0.1, 1.0 / hz), 1e-4
        rows = []
        for t in times:
            before, after = self.pose(t - step)[0], self.pose(t + step)[0]
            rate = log(before @ after.T) / (2.0 * step)
            rows.append([t, *rate, *(9.81 * self.pose(t)[0][:, 2])])
        return np.array(rows)


def pixels_at(camera, walk, leds_in_b, t):
    """Each LED when its row is exposed."""
    places = []
    for led in leds_in_b:
        delay = 0.0
        for _ in range(4):
            R, p = walk.pose(t + delay)
            pixel = camera.pixels((p + R @ led)[None])[0]
            delay = float(camera.delays(pixel[None])[0])
        places.append(pixel)
    return np.array(places)


def spots_only(camera, walk, leds_in_b, frames, rng, noise_px=0.05, hidden=0.0):
    """Sightings without pictures: true places with noise, some missing, in any order."""
    film = []
    for k in range(frames):
        t = walk.seconds * k / frames
        px = pixels_at(camera, walk, leds_in_b, t) + rng.normal(0.0, noise_px, (len(leds_in_b), 2))
        px = rng.permutation(px[rng.uniform(size=len(px)) >= hidden])
        n = len(px)
        covariances = np.tile(noise_px**2 * np.eye(2), (n, 1, 1))
        film.append(FrameSpots(str(k), t, Spots(px, covariances, np.ones(n), np.full(n, 20.0))))
    return film


def write_film(folder, camera, walk, leds_in_b, frames, seed=1):
    """Rendered pictures with times.csv, and imu.csv beside them."""
    rng = np.random.default_rng(seed)
    rows = ["frame,t_s"]
    for k in range(frames):
        t = walk.seconds * k / frames
        picture = render(camera, lambda dt, t=t: walk.pose(t + dt), leds_in_b, RenderOptions(), rng)
        cv2.imwrite(str(folder / f"{k:05d}.png"), picture)
        rows.append(f"{k:05d}.png,{t:.6f}")
    (folder / "times.csv").write_text("\n".join(rows) + "\n")
    imu = folder.parent / "imu.csv"
    table = "\n".join(",".join(f"{x:.9f}" for x in row) for row in walk.imu())
    imu.write_text("t_s,gx,gy,gz,ax,ay,az\n" + table + "\n")
    return imu
