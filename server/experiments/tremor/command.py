"""`lightleash experiments tremor`: what of the hand's turns reaches the robot, by frequency."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import radians
from pathlib import Path

import numpy as np
from scipy.signal import welch

from pipeline.config import PERIOD_S, VirtualCameraConfig
from pipeline.control.cutoff import time_constants
from pipeline.control.virtual_camera import VirtualCamera
from pipeline.frames import Array, log, rotation_about_z
from server.common.ranges import number, seed_number
from server.common.runtime_parameters import FASTEST_HZ, SLOWEST_HZ
from server.common.text import Column, table
from server.experiments.runner import ExperimentReport, experiment
from server.experiments.tremor.hand import (
    REST_S,
    SHORTEST_S,
    attitudes_of_hand,
    attitudes_of_recording,
)
from server.experiments.tremor.picture import Spectrum, Turn, draw
from server.recording.reader import read
from server.recording.writer import RecordingError

BAND_HZ = (4.0, 12.0)
SETTLE_S = 4.0
"""From the first attitude: the hand has begun to move, the virtual camera follows."""
SEGMENT_S = 10.0
"""Of Welch's averaged periodograms."""
TURN_SEED, TURN_S = 1, 4.0  # of the hand that turns once


@dataclass(frozen=True, slots=True)
class Tremor:
    """Figures of one camera; bands are RMS over all axes between the frequencies of `BAND_HZ`."""

    name: str
    across_deg: float
    """Of turns across the line of sight, in the band."""
    about_deg: float
    """Of turns about it."""
    band_mm: float
    """What the former move the reference."""
    band_mm_s: float
    band_m_s2: float
    all_mm_s: float
    """Speed and acceleration of the reference, RMS, all frequencies."""
    all_m_s2: float


COLUMNS: tuple[Column, ...] = (
    ("name", "virtual camera", "{}"),
    ("across_deg", "across °", "{:.5f}"),
    ("about_deg", "about °", "{:.5f}"),
    ("band_mm", "mm", "{:.4f}"),
    ("band_mm_s", "mm/s", "{:.3f}"),
    ("band_m_s2", "m/s²", "{:.4f}"),
    ("all_mm_s", "all mm/s", "{:.2f}"),
    ("all_m_s2", "all m/s²", "{:.3f}"),
)


def cameras(cutoff: float) -> dict[str, VirtualCameraConfig]:
    """Virtual cameras compared; without limit and guard, which tremor never meets."""
    full = VirtualCameraConfig(*time_constants(cutoff), max_speed_m_s=0.0, guard=False)
    return {
        "off": replace(full, mode="off"),
        "full": full,
        "selective": replace(full, mode="selective"),
        "selective at once": replace(full, mode="selective", tau_parallel=0.0),
        "adaptive 2": replace(full, adaptive_beta=2.0),
    }


def through(config: VirtualCameraConfig, R_fc: Array, p_ref: Array) -> Array:
    """(n, 3, 3) R_fv of a camera that turns as (n, 3, 3) R_fc."""
    camera = VirtualCamera(config)
    return np.array([camera.follow(R, p_ref, PERIOD_S, p_ref) for R in R_fc])


def rates(R: Array) -> Array:
    """(n - 1, 3) angular velocities [rad/s], in the turning axes."""
    return np.array([log(before.T @ after) / PERIOD_S for before, after in pairwise(R)])


def judge(name: str, R: Array, p_ref: Array) -> tuple[Tremor, Spectrum]:
    """Figures and spectrum of turns (n, 3, 3), for a reference (3,) [m] in their axes."""
    omega, n = rates(R), p_ref / np.linalg.norm(p_ref)
    about = omega @ n
    across = omega - about[:, None] * n
    hz, density = _density(across)
    _, density_about = _density(about[:, None])
    w2 = (2.0 * np.pi * hz) ** 2
    distance = float(np.linalg.norm(p_ref))
    in_band = partial(_rms_in_band, hz)
    velocity = np.einsum("kij,kj->ki", R[:-1], np.cross(omega, p_ref))
    tremor = Tremor(
        name=name,
        across_deg=float(np.rad2deg(in_band(density / w2))),
        about_deg=float(np.rad2deg(in_band(density_about / w2))),
        band_mm=1e3 * distance * in_band(density / w2),
        band_mm_s=1e3 * distance * in_band(density),
        band_m_s2=distance * in_band(density * w2),
        all_mm_s=1e3 * _rms(velocity),
        all_m_s2=_rms(np.diff(velocity, axis=0)) / PERIOD_S,
    )
    to_deg2 = np.rad2deg(1.0) ** 2 / w2
    return tremor, Spectrum(hz, to_deg2 * density, to_deg2 * density_about)


def _density(omega: Array) -> tuple[Array, Array]:
    """(m,) frequencies [Hz] above 0 and (m,) density of (n, k) rates, summed over the axes."""
    segment = min(len(omega), round(SEGMENT_S / PERIOD_S))
    hz, density = welch(omega, 1.0 / PERIOD_S, nperseg=segment, axis=0)
    return hz[1:], density[1:].sum(axis=1)


def _rms_in_band(hz: Array, density: Array) -> float:
    inside = (hz >= BAND_HZ[0]) & (hz <= BAND_HZ[1])
    return float(np.sqrt(density[inside].sum() * (hz[1] - hz[0])))


def _rms(rows: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(rows**2, axis=1))))


def turns(cutoff: float, p_ref: Array) -> Iterator[Turn]:
    """A turn of 3° in 0.3 s, held in a phone: yaw of each virtual camera over time."""
    times, R_fc, R_true = attitudes_of_hand("turn_z", REST_S + TURN_S, TURN_SEED)
    since = times - REST_S
    yield Turn("hand", since, _yaw(R_true))
    for name, config in cameras(cutoff).items():
        yield Turn(name, since, _yaw(through(config, R_fc, p_ref)))


def _yaw(R: Array) -> Array:
    """(n,) turn about the vertical since the start [°]."""
    return np.array([np.rad2deg(log(R[0].T @ one)[2]) for one in R])


def measure(arguments: argparse.Namespace) -> tuple[list[Tremor], dict[str, Spectrum]]:
    """Each camera's figures and spectrum, the hand's own first.

    Raises:
        RecordingError: the recording can't be used.
        ValueError: no such hand.
    """
    p_ref = place(arguments)
    hands = {}
    if arguments.recording is not None:
        _, R_fc = attitudes_of_recording(read(arguments.recording))
    else:
        seconds, seed = arguments.seconds, arguments.seed
        _, R_fc, hands["hand"] = attitudes_of_hand(arguments.hand, seconds, seed)
    for name, config in cameras(arguments.cutoff_hz).items():
        hands[name] = through(config, R_fc, p_ref)
    skip = round(SETTLE_S / PERIOD_S)
    judged = {name: judge(name, R[skip:], p_ref) for name, R in hands.items()}
    return [figures for figures, _ in judged.values()], {k: s for k, (_, s) in judged.items()}


def place(arguments: argparse.Namespace) -> Array:
    """Where the robot should be, in v (3,) [m]."""
    ahead: Array = rotation_about_z(radians(arguments.side_deg)) @ (arguments.distance_m, 0.0, 0.0)
    return ahead


@experiment("tremor", RecordingError, ValueError)
def run(arguments: argparse.Namespace) -> ExperimentReport:
    """Each virtual camera's figures, with spectra and a turn as a picture."""
    figures, spectra = measure(arguments)
    source = arguments.recording or f"hand {arguments.hand}, seed {arguments.seed}"
    print(
        f"{source}; {arguments.cutoff_hz:g} Hz, robot {arguments.distance_m:g} m away, "
        f"{arguments.side_deg:g}° beside the axis; RMS at {BAND_HZ[0]:g}-{BAND_HZ[1]:g} Hz, of "
        "turns across and about the line of sight and of the reference"
    )

    def drawn(folder: Path) -> list[Path]:
        seen = list(turns(arguments.cutoff_hz, place(arguments)))
        return [draw(spectra, seen, BAND_HZ, folder / "tremor.png")]

    return ExperimentReport(figures, table(COLUMNS, figures), draw=drawn)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--hand", default="steady", help="of the virtual phone")
    parser.add_argument("--seed", type=seed_number, default=1)
    parser.add_argument("--seconds", type=number(SHORTEST_S, 3600.0), default=64.0)
    parser.add_argument("--recording", type=Path, default=None, help="MCAP: its phone's motion")
    parser.add_argument("--cutoff-hz", type=number(SLOWEST_HZ, FASTEST_HZ), default=0.28)
    parser.add_argument("--distance-m", type=number(0.3, 12.0), default=2.5)
    parser.add_argument("--side-deg", type=number(-60.0, 60.0), default=0.0, help="off the axis")
    parser.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
