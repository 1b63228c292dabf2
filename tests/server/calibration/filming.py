"""Films of a ChArUco board with the truth: corners alone, or rendered pictures."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from pipeline.frames import R_co, exp, log
from server.calibration.board import Board
from server.calibration.lens import normalised, project
from server.calibration.projection import rotated
from server.calibration.views import BoardView

BOARD = Board(9, 6, 0.03, 0.0225)


@dataclass
class Phone:
    """The true camera."""

    width: int = 1280
    height: int = 720
    model: str = "plumb_bob"
    lens: tuple = (930.0, 934.0, 646.0, 352.0, 0.08, -0.15, 0.0008, -0.0006, 0.02)
    readout_s: float = 0.022

    @property
    def size(self):
        return self.width, self.height

    @property
    def vector(self):
        return np.array(self.lens)


def scaled(phone, width):
    """The same phone at another picture size."""
    k = width / phone.width
    fx, fy, cx, cy, *rest = phone.lens
    lens = (k * fx, k * fy, k * (cx + 0.5) - 0.5, k * (cy + 0.5) - 0.5, *rest)
    return Phone(width, round(k * phone.height), phone.model, lens, phone.readout_s)


@dataclass
class Motion:
    """A hand that shows the board from all sides; a smooth function of time."""

    tilt: float = 0.55
    reach: float = 0.75
    """Of half the picture that the board's middle wanders."""
    distance_m: tuple = (0.28, 0.55)
    speed: float = 1.0
    seed: int = 0
    tremor: float = 0.01
    phases: np.ndarray = field(init=False)

    def __post_init__(self):
        self.phases = np.random.default_rng(self.seed).uniform(0, 2 * np.pi, (6, 3))

    def wave(self, k, t, hz):
        slow, tremble, _ = self.phases[k]
        return np.sin(2 * np.pi * hz * self.speed * t + slow) + self.tremor * np.sin(
            2 * np.pi * (5.0 + 0.6 * k) * t + tremble
        )

    def pose(self, t, phone):
        """R_og, p_go_in_o at time t."""
        middle = np.array([0.5 * BOARD.columns, 0.5 * BOARD.rows, 0.0]) * BOARD.square_m
        turn = np.array(
            [
                self.tilt * self.wave(0, t, 0.31),
                self.tilt * self.wave(1, t, 0.23),
                0.4 * self.wave(2, t, 0.17),
            ]
        )
        near, far = self.distance_m
        z = 0.5 * (near + far) + 0.5 * (far - near) * self.wave(3, t, 0.11)
        half = 0.5 * np.array(phone.size) / phone.lens[0]
        x = half[0] * self.reach * self.wave(4, t, 0.19) * z
        y = half[1] * self.reach * self.wave(5, t, 0.27) * z
        R = exp(turn)
        return R, np.array([x, y, z]) - R @ middle


def omega_cf_in_o(motion, phone, t, step=1e-4):
    """What an ideal gyroscope in optical axes feels, the board being at rest [rad/s]."""
    before, after = motion.pose(t - step, phone)[0], motion.pose(t + step, phone)[0]
    return -log(after @ before.T) / (2 * step)


KNOTS = np.linspace(-0.5, 0.5, 7)
"""Rows, in heights from the middle, between which a motion is a parabola."""


def at_rows(phone, motion, t, rows):
    """R_og in the middle, and for rows (m,) what turns it further (m, 3) and p_go_in_o (m, 3)."""
    poses = [motion.pose(t + r * phone.readout_s, phone) for r in KNOTS]
    R = poses[len(KNOTS) // 2][0]
    turns = np.array([log(R_row @ R.T) for R_row, _ in poses])
    table = np.hstack((turns, [p for _, p in poses]))
    fine = np.polynomial.polynomial.polyfit(KNOTS, table, 4)
    values = np.polynomial.polynomial.polyval(rows, fine).T
    return R, values[:, :3], values[:, 3:]


def seen(phone, motion, t, noise_px, rng, blur_px=2.5):
    """The corners that a picture at time t shows, without rendering it."""
    corners = BOARD.corners()
    rows = np.zeros(len(corners))
    for _ in range(4):
        R, turns, places = at_rows(phone, motion, t, rows)
        points = rotated(turns, corners @ R.T) + places
        pixels = project(phone.model, phone.vector, points)[0]
        rows = np.clip(pixels[:, 1] / phone.height - 0.5, -0.5, 0.5)
    inside = (pixels > 3).all(axis=1) & (pixels < np.array(phone.size) - 4).all(axis=1)
    ids = np.flatnonzero(inside)
    return BoardView(t, ids, pixels[ids] + rng.normal(0, noise_px, (len(ids), 2)), blur_px)


def corner_film(phone, motion, seconds=20.0, fps=30.0, noise_px=0.1, seed=0):
    rng = np.random.default_rng(seed)
    times = 1.0 + np.arange(round(seconds * fps)) / fps
    views = [seen(phone, motion, float(t), noise_px, rng) for t in times]
    return [view for view in views if len(view) >= 12]


def gyro_rows(phone, motion, R_ci, offset_s, seconds=20.0, hz=60.0, bias=(0.01, -0.02, 0.005)):
    """(n, 7) samples on a clock by which a picture was taken at its stamp plus `offset_s`."""
    t = 0.8 + np.arange(round((seconds + 0.4) * hz)) / hz
    rate = np.array([R_ci.T @ R_co @ omega_cf_in_o(motion, phone, one) for one in t])
    rate = np.round((rate + bias) / np.deg2rad(0.1)) * np.deg2rad(0.1)
    return np.column_stack((t + offset_s, rate, np.zeros((len(t), 3))))


def upright(views, phone):
    """The same views in pictures that a browser turned clockwise by a quarter."""
    last = phone.height - 1.0
    return [
        replace(view, pixels=np.column_stack((last - view.pixels[:, 1], view.pixels[:, 0])))
        for view in views
    ]


class Studio:
    """Renders pictures of the board, row by row at its own time."""

    def __init__(self, phone, board=BOARD, scale=24):
        self.phone, self.board, self.scale = phone, board, scale
        drawn = board.drawn_by_opencv().generateImage(
            (board.columns * scale, board.rows * scale), marginSize=0
        )
        self.paper = cv2.copyMakeBorder(
            drawn, scale, scale, scale, scale, cv2.BORDER_CONSTANT, value=255
        )
        u, v = np.meshgrid(np.arange(phone.width), np.arange(phone.height))
        pixels = np.column_stack((u.ravel(), v.ravel())).astype(float)
        flat = normalised(phone.model, phone.vector, pixels)
        self.rays = np.column_stack((flat, np.ones(len(flat)))).reshape(
            phone.height, phone.width, 3
        )
        self.rows = np.arange(phone.height) / phone.height - 0.5

    def picture(self, motion, t, exposure_s=0.0, noise=2.0, rng=None, exposures=1, psf_px=0.7):
        total = 0.0
        for k in range(exposures):
            total = total + self._sharp(motion, t + ((k + 0.5) / exposures - 0.5) * exposure_s)
        image = cv2.GaussianBlur(total / exposures, (0, 0), psf_px)
        if rng is not None:
            image = image + rng.normal(0.0, noise, image.shape)
        return np.clip(np.round(30 + 0.75 * image), 0, 255).astype(np.uint8)

    def _sharp(self, motion, t):
        R0, turns, place = at_rows(self.phone, motion, t, self.rows)
        R = np.array([exp(x) for x in turns]) @ R0
        way = self.rays @ R  # = Rᵀ ray for each row
        origin = -np.einsum("hji,hj->hi", R, place)
        s = -origin[:, None, 2] / way[..., 2]
        xy = origin[:, None, :2] + s[..., None] * way[..., :2]
        per_m = self.scale / self.board.square_m
        maps = (xy * per_m + self.scale - 0.5).astype(np.float32)
        return cv2.remap(
            self.paper, maps, None, cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT, borderValue=110,
        ).astype(np.float64)  # fmt: skip
