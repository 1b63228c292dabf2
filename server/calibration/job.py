"""A calibration in a process of its own: what goes in and comes out can be pickled."""

from __future__ import annotations

import multiprocessing
from dataclasses import dataclass
from multiprocessing.connection import Connection

from pipeline.frames import Array
from server.calibration.board import Board
from server.calibration.camera_imu import FEWEST_SAMPLES, gyro_of
from server.calibration.camera_yaml import yaml_of
from server.calibration.lens import COEFFICIENTS
from server.calibration.solve import CalibrationSolution, solve
from server.calibration.verdict import TOO_FEW, Verdict, judge, judge_views
from server.calibration.views import BoardView
from server.common.child import be_ordinary, raise_niceness

KINDER = 10
"""Less urgent than what keeps a robot flying: `nice`."""
MODEL = next(iter(COEFFICIENTS))


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationJob:
    """Views and motion samples of a video, to be calibrated from."""

    board: Board
    size: tuple[int, int]
    views: list[BoardView]
    pictures: int
    motion: Array
    """(n, 4) t, gyroscope in c [s, rad/s]."""
    device: str
    screen_angle_deg: int
    date: str


@dataclass(frozen=True, slots=True)
class CalibrationOutcome:
    """Result of a calibration."""

    verdict: Verdict
    text: str
    """Of the camera file; "" when refused."""
    figures: list[str]


def run(job: CalibrationJob) -> CalibrationOutcome:
    """Calibrate and judge."""
    verdict = judge_views(job.views, job.pictures, job.board, job.size)
    if verdict is not None:
        return CalibrationOutcome(verdict, "", [])
    gyro = gyro_of(job.motion) if len(job.motion) >= FEWEST_SAMPLES else None
    found = solve(job.views, job.board, job.size, MODEL, gyro)
    if found is None:
        return CalibrationOutcome(Verdict("refused", ["Too few views."], [TOO_FEW]), "", [])
    verdict = judge(found)
    if gyro is None:
        verdict.worsen("usable", "The motion sensors said too little while filming.", "")
    if verdict.level == "refused":
        return CalibrationOutcome(verdict, "", figures(found))
    text = yaml_of(found, verdict, job.device, job.screen_angle_deg, job.date)
    return CalibrationOutcome(verdict, text, figures(found))


def figures(found: CalibrationSolution) -> list[str]:
    """Figures for the person at the phone."""
    value, sigma = found.shared, found.sigma
    lines = [
        f"Focal length {value[0]:.1f} ± {sigma[0]:.1f} px",
        f"Corners within {found.held_out_px:.2f} px",
    ]
    if found.readout_known:
        lines.append(f"Readout {1e3 * value[-1]:.1f} ± {1e3 * sigma[-1]:.1f} ms")
    if found.imu is not None:
        offset, sure = 1e3 * found.imu.time_offset_s, 1e3 * found.imu.sigma[3]
        lines.append(f"Pictures {offset:+.0f} ± {sure:.0f} ms beside the motion sensors")
    return lines


class Solving:
    """A job under way in a process of its own, which dies with its parent or when it is stopped."""

    def __init__(self, job: CalibrationJob) -> None:
        """Begin."""
        context = multiprocessing.get_context("spawn")
        self._answer, far = context.Pipe(duplex=False)
        self._process = context.Process(target=_work, args=(job, far), daemon=True)
        self._process.start()
        if self._process.pid is not None:
            be_ordinary(self._process.pid)
        far.close()

    @property
    def done(self) -> bool:
        """Whether `outcome` is there, or never will be."""
        return self._answer.poll() or not self._process.is_alive()

    def outcome(self) -> CalibrationOutcome | None:
        """Result; None: the process died."""
        try:
            outcome: CalibrationOutcome = self._answer.recv()
        except EOFError:
            return None
        return outcome

    def stop(self) -> None:
        """Give up."""
        self._process.kill()


def _work(job: CalibrationJob, answer: Connection) -> None:
    raise_niceness(KINDER)
    answer.send(run(job))
