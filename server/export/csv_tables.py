"""Plain CSV, one table for each kind of thing, units in the names of the columns.

`t_s` is the recorded server's clock, the same in all tables; `utc` the calendar's time, empty if
the record doesn't know it. Quaternions of states turn the body's axes into the phone's (x along its
view, y left, z up), those of phone and virtual camera theirs into level ones, that of the reference
its own into the virtual camera's. `robot.toml` and `camera.yaml` lie beside.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from pipeline.signals import BodyImu, PhoneImu
from server.export.decoded import (
    DatedNote,
    DatedPicture,
    DatedTouch,
    DecodedRecording,
    Happening,
    LogLine,
    RecordedState,
)
from server.export.episodes import Episode
from server.recording.writer import CAMERA_KEY, ROBOT_KEY

IMU: Final = ("gx_rad_s", "gy_rad_s", "gz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2")
TABLES: Final = {
    "pictures": (
        *("sigma_s", "received_s", "sequence", "codec", "key"),
        *("width_px", "height_px", "screen_angle_deg", "size_bytes"),
    ),
    "phone_imu": IMU,
    "robot_imu": IMU,
    "touches": ("held", "visible", "press"),
    "log": ("source", "alarms", "text"),
    "states": (
        *("mode", "pose_age_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"),
        *("sigma_position_m", "sigma_attitude_rad", "vx_m_s", "vy_m_s", "vz_m_s"),
        *("phone_qw", "phone_qx", "phone_qy", "phone_qz"),
        *("virtual_qw", "virtual_qx", "virtual_qy", "virtual_qz"),
        *("reference_x_m", "reference_y_m", "reference_z_m"),
        *("reference_qw", "reference_qx", "reference_qy", "reference_qz"),
        *("error_m", "error_rad", "picture_delay_s", "picture_delay_sigma_s", "saturated"),
        "battery_v",
    ),
    "episodes": ("end_s", "episode", "task", "keep"),
}
"""Columns beside `t_s` and `utc`; states end with what the robot was told, as `command_names`."""
FILES = {ROBOT_KEY: "robot.toml", CAMERA_KEY: "camera.yaml"}


def write(decoded: DecodedRecording, episodes: Sequence[Episode], folder: Path) -> str:
    """Write the tables into `folder`; gives a line about them.

    Raises:
        RecordingError: the recording is damaged.
        OSError: a file can't be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    counts = dict.fromkeys(TABLES, 0)
    with ExitStack() as stack:
        tables = {}
        for name, columns in TABLES.items():
            file = stack.enter_context((folder / f"{name}.csv").open("w", newline=""))
            tables[name] = csv.writer(file, lineterminator="\n")
            commands = decoded.command_names if name == "states" else ()
            tables[name].writerow(("t_s", "utc", *columns, *commands))

        def add(name: str, t: float, cells: Sequence[object]) -> None:
            tables[name].writerow((f"{t:.6f}", decoded.utc(t), *map(_cell, cells)))
            counts[name] += 1

        for episode in episodes:
            cells = (episode.t_end, episode.number, episode.task, episode.keep)
            add("episodes", episode.t_begin, cells)
        for item in decoded.items():
            if not isinstance(item, DatedNote):  # stands in what was said of its episode
                add(*_row(item))
    for key, name in FILES.items():
        if text := decoded.recording.metadata.get(key):
            (folder / name).write_text(text)
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def _row(item: Happening) -> tuple[str, float, Sequence[object]]:
    """Table, time [s] and cells."""
    match item:
        case DatedPicture(t, sigma, t_received, sequence, picture):
            shape = (picture.width, picture.height, picture.screen_angle_deg, len(picture.data))
            head = (sigma, t_received, sequence, picture.codec.name, picture.key)
            return "pictures", t, (*head, *shape)
        case PhoneImu(t, rate, force):
            return "phone_imu", t, (*rate.tolist(), *force.tolist())
        case BodyImu(t, rate, force):
            return "robot_imu", t, (*rate.tolist(), *force.tolist())
        case DatedTouch(t, held, visible, press):
            return "touches", t, (held, visible, press)
        case LogLine(t, source, text, alarms):
            return "log", t, (source, alarms, text)
        case RecordedState():
            return "states", item.t, _state(item)


def _state(state: RecordedState) -> Sequence[object]:
    nothing3, nothing4 = (None,) * 3, (None,) * 4
    return (
        *(state.mode_name, state.pose_age),
        *(state.p_bc_in_c or nothing3),
        *(state.R_cb_wxyz or nothing4),
        *(state.sigma_p, state.sigma_theta),
        *(state.u_bf_in_c or nothing3),
        *(state.R_fc_wxyz or nothing4),
        *(state.R_fv_wxyz or nothing4),
        *(state.reference_p_in_v or nothing3),
        *(state.reference_R_wxyz or nothing4),
        *(state.error_m, state.error_rad, state.time_offset, state.time_offset_sigma),
        *(state.saturated, state.battery_v),
        *state.command,
    )


def _cell(value: object) -> str:
    """Empty for what nobody knows."""
    match value:
        case None:
            return ""
        case bool():
            return str(int(value))
        case float():
            return f"{value:.9g}" if abs(value) < 1e3 else f"{value:.6f}"
        case _:
            return str(value)
