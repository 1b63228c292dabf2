"""LeRobotDataset v3.0: an episode from each press to its release, a row for each picture.

| feature | what |
|---|---|
| observation.images.phone | the picture |
| observation.state | body in the phone's axes, its velocity, the phone's attitude, of that moment |
| action | what control told the robot at its first tick from then on: thrusts, or a twist |
| … of one with a tool | behind it, how far that was last told to be open, 0 to 1 |
| capture_time_s, capture_sigma_s | when it was taken, since 1970, and how well that is known |
| acting_time_s | when that tick was |

LeRobot's own `timestamp` is nominal, number / rate: the true times are those above. Discarded
episodes are left out, and so are pictures about which control knew nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipeline.frames import Array
from server.export.decoded import DatedPicture, DecodedRecording, RecordedState
from server.export.episodes import Episode
from server.export.lerobot_files import (
    COUNTED,
    FIRST,
    Feature,
    FilmWriter,
    info_of,
    stats_of,
    write_data,
    write_episodes,
    write_json,
    write_tasks,
)
from server.export.pictures import ColourDecoder
from server.recording.writer import RecordingError

CAMERA = "observation.images.phone"
STATE: Final = (
    *("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "vx_m_s", "vy_m_s", "vz_m_s"),
    *("phone_qw", "phone_qx", "phone_qy", "phone_qz"),
)
QUATERNIONS: Final = (slice(3, 7), slice(10, 14))
"""Where they stand in a state."""
UNNAMED = "follow the phone"
"""The task of an episode that nobody named."""
GAP_S = 0.1
"""Between two ticks of control, five times what it is: nothing is known in longer ones."""


def write(decoded: DecodedRecording, episodes: Sequence[Episode], folder: Path) -> str:
    """Write the dataset `folder`; gives a line about it.

    Raises:
        RecordingError: the recording is damaged, or nothing in it can be learnt from.
        OSError: it can't be written.
    """
    kept = [episode for episode in episodes if episode.keep]
    ticks = _Ticks(decoded)
    fps = _rate(decoded)
    shots: list[_Shot] = []
    with FilmWriter(folder, CAMERA, fps) as film:
        for shot, image in _shots(decoded, kept, ticks):
            shots.append(shot)
            film.add(image)
    if not shots:
        what = "holds no episode with pictures and poses"
        raise RecordingError(decoded.recording.path, what, "hold the button while it records")
    _Dataset(decoded, kept, shots, film).write(folder)
    taken = len({shot.episode for shot in shots})
    return f"{taken} episodes of {len(episodes)}, {len(shots)} pictures at {fps} a second"


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    """A row, but for what is counted."""

    episode: int
    """Which of those that are kept."""
    t: float
    sigma_s: float
    state: Array
    t_acted: float
    command: Array


class _Ticks:
    """What control knew and did."""

    def __init__(self, decoded: DecodedRecording) -> None:
        states = [item for item in decoded.items() if isinstance(item, RecordedState)]
        known = [(state.t, row) for state in states if (row := _row(state)) is not None]
        self._t = np.array([t for t, _ in known])
        self._rows = np.array([row for _, row in known]).reshape(-1, len(STATE))
        for where in QUATERNIONS:  # q and -q are one attitude: those beside each other agree
            q = self._rows[:, where]
            signs = np.sign(np.einsum("ij,ij->i", q[1:], q[:-1]))
            q[1:] *= np.cumprod(np.where(signs < 0.0, -1.0, 1.0))[:, None]
        self._t_acted = np.array([state.t for state in states])
        self._commands = [np.array(state.command) for state in states]
        if decoded.robot.robot.tool:
            openings = _held([state.tool_opening for state in states])
            self._commands = list(map(np.append, self._commands, openings))

    def state(self, t: float) -> Array | None:
        """(14,) at `t` [s], between two ticks; None: nobody knew."""
        after = int(np.searchsorted(self._t, t))
        if not 0 < after < len(self._t) or self._t[after] - self._t[after - 1] > GAP_S:
            return None
        a, b = self._t[after - 1], self._t[after]
        share = (t - a) / (b - a)
        state: Array = (1.0 - share) * self._rows[after - 1] + share * self._rows[after]
        for where in QUATERNIONS:
            state[where] /= np.linalg.norm(state[where])
        return state

    def action(self, t: float) -> tuple[float, Array] | None:
        """When [s], and what was told, at the first tick from `t` [s] on; None: there was none."""
        k = int(np.searchsorted(self._t_acted, t))
        if k == len(self._t_acted) or self._t_acted[k] - t > GAP_S:
            return None
        return float(self._t_acted[k]), self._commands[k]


def _held(told: Sequence[float | None]) -> list[float]:
    """What stays when nothing is told: the last one; before the first one that, or 0."""
    last = next((one for one in told if one is not None), 0.0)
    return [last := last if one is None else one for one in told]


def _row(state: RecordedState) -> list[float] | None:
    p, q, u, phone = state.p_bc_in_c, state.R_cb_wxyz, state.u_bf_in_c, state.R_fc_wxyz
    if p is None or q is None or u is None or phone is None:
        return None
    return [*p, *q, *u, *phone]


def _rate(decoded: DecodedRecording) -> int:
    """Pictures a second, nominal."""
    times = [item.t for item in decoded.items() if isinstance(item, DatedPicture)]
    apart = np.diff(times)
    return max(1, round(1.0 / float(np.median(apart)))) if len(apart) else 1


def _shots(
    decoded: DecodedRecording, episodes: Sequence[Episode], ticks: _Ticks
) -> Iterator[tuple[_Shot, Any]]:
    """Each row with its picture."""
    decoder = ColourDecoder()
    for item in decoded.items():
        if not isinstance(item, DatedPicture):
            continue
        image = decoder.decoded(item)
        within = (k for k, one in enumerate(episodes) if one.t_begin <= item.t <= one.t_end)
        episode = next(within, None)
        if image is None or episode is None:
            continue
        state, action = ticks.state(item.t), ticks.action(item.t)
        if state is not None and action is not None:
            yield _Shot(episode, item.t, item.sigma_s, state, *action), image


class _Dataset:
    """Tables of a film that is written."""

    def __init__(
        self,
        decoded: DecodedRecording,
        episodes: Sequence[Episode],
        shots: Sequence[_Shot],
        film: FilmWriter,
    ) -> None:
        self._decoded, self._film = decoded, film
        self._episodes = [episodes[k] for k in sorted({shot.episode for shot in shots})]
        """Those that have rows."""
        self._tasks = list(dict.fromkeys(one.task or UNNAMED for one in self._episodes))
        names = decoded.command_names + ("tool_opening",) * bool(decoded.robot.robot.tool)
        self._features = {
            "observation.state": Feature("float32", STATE),
            "action": Feature("float32", names),
            "capture_time_s": Feature("float64", ()),
            "capture_sigma_s": Feature("float64", ()),
            "acting_time_s": Feature("float64", ()),
            **COUNTED,
        }
        self._columns = self._gather(shots)

    def _gather(self, shots: Sequence[_Shot]) -> dict[str, Array]:
        unix = self._decoded.unix_ns
        places = np.array([shot.episode for shot in shots])
        _, numbers = np.unique(places, return_inverse=True)
        starts = np.searchsorted(numbers, numbers)
        within = np.arange(len(shots)) - starts
        tasks = [self._tasks.index(one.task or UNNAMED) for one in self._episodes]
        return {
            "observation.state": np.array([shot.state for shot in shots]),
            "action": np.array([shot.command for shot in shots]),
            "capture_time_s": np.array([1e-9 * unix(shot.t) for shot in shots]),
            "capture_sigma_s": np.array([shot.sigma_s for shot in shots]),
            "acting_time_s": np.array([1e-9 * unix(shot.t_acted) for shot in shots]),
            "timestamp": within / self._film.fps,
            "frame_index": within,
            "episode_index": numbers,
            "index": np.arange(len(shots)),
            "task_index": np.array(tasks)[numbers],
        }

    def write(self, folder: Path) -> None:
        rows = [self._episode(k) for k in range(len(self._episodes))]
        stats = {name: stats_of(column) for name, column in self._columns.items()}
        features = {name: feature.info for name, feature in self._features.items()}
        counts = {"episodes": len(rows), "frames": self._film.count, "tasks": len(self._tasks)}
        info = info_of(
            self._decoded.robot.robot.name,
            self._film.fps,
            counts,
            {CAMERA: self._film.info, **features},
        )
        write_data(folder, self._features, self._columns)
        write_episodes(folder, rows)
        write_tasks(folder, self._tasks)
        write_json(folder / "meta/stats.json", {CAMERA: self._film.stats(), **stats})
        write_json(folder / "meta/info.json", info)

    def _episode(self, k: int) -> dict[str, Any]:
        rows = np.flatnonzero(self._columns["episode_index"] == k)
        begin, end = int(rows[0]), int(rows[-1]) + 1
        fps, film = self._film.fps, f"videos/{CAMERA}"
        row: dict[str, Any] = {
            "episode_index": k,
            "tasks": [self._episodes[k].task or UNNAMED],
            "length": end - begin,
            "dataset_from_index": begin,
            "dataset_to_index": end,
            **{f"data/{name}": number for name, number in FIRST.items()},
            **{f"{film}/{name}": number for name, number in FIRST.items()},
            f"{film}/from_timestamp": begin / fps,
            f"{film}/to_timestamp": end / fps,
            **{f"meta/episodes/{name}": number for name, number in FIRST.items()},
        }
        for name, column in self._columns.items():
            for what, value in stats_of(column[begin:end]).items():
                row[f"stats/{name}/{what}"] = value
        return row
