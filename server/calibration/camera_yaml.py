"""A calibrated camera as a file that `hardware.camera_file` and ROS read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hardware.camera_file import direction_of, load_camera, slug
from pipeline.frames import Array
from server.calibration.lens import matrix
from server.calibration.solve import CalibrationSolution
from server.calibration.verdict import Verdict
from server.common.runtime import replacement

PROFILES = "cameras"
"""Folder of the state directory that `lightleash serve` looks into."""
LENS_NAMES = ("fx_px", "fy_px", "cx_px", "cy_px")


def yaml_of(
    solution: CalibrationSolution,
    verdict: Verdict,
    name: str,
    screen_angle_deg: int | None,
    date: str,
) -> str:
    """The text of the file; `date` is written into it."""
    width, height = solution.size
    lens, readout = solution.shared[:-1], float(solution.shared[-1])
    lines = [
        f"# Calibrated by lightleash on {date}: {verdict.level}.",
        *(f"# {reason}" for reason in verdict.reasons),
        f"image_width: {width}",
        f"image_height: {height}",
        f"camera_name: {_quoted(name)}",
        "camera_matrix:",
        *_matrix(3, 3, matrix(lens).ravel()),
        f"distortion_model: {solution.model}",
        "distortion_coefficients:",
        *_matrix(1, len(lens) - 4, lens[4:]),
        "rectification_matrix:",
        *_matrix(3, 3, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
        "projection_matrix:",
        *_matrix(3, 4, _projection(lens)),
        "# From the first line's exposure to the last one's, and which way these lines follow each",
        "# other in the picture.",
        f"rolling_shutter_readout_s: {abs(readout) if solution.readout_known else 0.0:.6f}",
        f"rolling_shutter_direction: {direction_of(solution.readout_axis, readout)}",
    ]
    if screen_angle_deg is not None:
        lines.append(f"screen_angle_deg: {screen_angle_deg}")
    return "\n".join([*lines, *_imu(solution), *_quality(solution, verdict)]) + "\n"


def _projection(lens: Array) -> list[float]:
    fx, fy, cx, cy = map(float, lens[:4])
    return [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]


def _quoted(text: str) -> str:
    """As a YAML string, whatever a device says of itself."""
    safe = "".join(c if c.isprintable() else " " for c in text)
    return '"' + safe.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _matrix(rows: int, columns: int, numbers: Sequence[float] | Array) -> list[str]:
    data = ", ".join(_number(float(x)) for x in numbers)
    return [f"  rows: {rows}", f"  cols: {columns}", f"  data: [{data}]"]


def _number(x: float) -> str:
    """Never a whole one: ROS wants doubles."""
    text = f"{x:.9g}"
    return text if "." in text or "e" in text else f"{text}.0"


def _imu(solution: CalibrationSolution) -> list[str]:
    imu = solution.imu
    if imu is None:
        return []
    rotation = ", ".join(f"{x:.8f}" for x in imu.R_ci.ravel())
    return [
        "# Motion sensors: turns their axes into the camera's (x along the view, y left, z up); a",
        "# picture was taken at its stamp plus the offset, on the sensors' clock.",
        "camera_imu:",
        f"  rotation: [{rotation}]",
        f"  time_offset_s: {imu.time_offset_s:.6f}",
        f"  rotation_sigma_rad: [{', '.join(f'{x:.6f}' for x in imu.sigma[:3])}]",
        f"  time_offset_sigma_s: {imu.sigma[3]:.6f}",
    ]


def _quality(solution: CalibrationSolution, verdict: Verdict) -> list[str]:
    names = [*LENS_NAMES, *(f"d{k}" for k in range(len(solution.shared) - 5))]
    sigma = ", ".join(f"{name}: {x:.3g}" for name, x in zip(names, solution.sigma, strict=False))
    readout = f"{solution.sigma[-1]:.3g}" if solution.readout_known else "null"
    held_out = f"{solution.held_out_px:.4f}" if len(solution.choice.held_out) else "null"
    return [
        "calibration:",
        f"  verdict: {verdict.level}",
        f"  views: {len(solution.choice.fit)}",
        f"  views_left_out: {solution.left_out}",
        f"  reprojection_px: {solution.fitted_px:.4f}",
        f"  held_out_px: {held_out}",
        f"  sigma: {{{sigma}}}",
        f"  readout_sigma_s: {readout}",
    ]


def profile_path(folder: Path, name: str, size: tuple[int, int], angle: int | None) -> Path:
    """Where the profile of a (device and lens, size, orientation) is stored."""
    words = slug(name)[:120] or "camera"
    turned = "" if angle is None else f"-at-{angle}"
    return folder / f"{words}-{size[0]}x{size[1]}{turned}.yaml"


def store(path: Path, text: str) -> None:
    """Write a file so that whoever reads it finds the old one or the new one, whole and readable.

    Raises:
        CameraFileError: it could not be read again; nothing is written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacement(path) as fresh:
        fresh.write_text(text, encoding="utf-8")
        load_camera(fresh)  # what a fit found may be more than any camera's file may say
