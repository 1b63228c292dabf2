"""How a LeRobotDataset v3.0 lies on the disk: Parquet tables, one film, JSON that describes them.

One file each is enough for a recording: chunk 0, file 0. Times of pictures in the film are nominal,
number / rate, which is how LeRobot finds them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import av
import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from av.video.stream import VideoStream

from pipeline.frames import Array
from pipeline.signals import Image

VERSION = "v3.0"
PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA, VIDEO = f"data/{PLACE}.parquet", "videos/{video_key}/" + PLACE + ".mp4"
EPISODES = f"meta/episodes/{PLACE}.parquet"
FIRST: Final = {"chunk_index": 0, "file_index": 0}
CHUNK_FILES, DATA_MB, VIDEO_MB = 1000, 100, 500
"""LeRobot's defaults: files in a chunk, and sizes beyond which it begins another file."""
QUANTILES: Final = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
X264: Final = {"crf": "18", "preset": "veryfast", "bf": "0", "g": "2"}
"""Close to the picture as it came, and quick to enter anywhere."""
EVERY, THINNED = 10, 8
"""Statistics of pictures look at each so many pictures, and of these at each so many rows."""
Stats = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Feature:
    """A column of numbers."""

    dtype: str
    names: tuple[str, ...]
    """Of its components; none: it is one number."""

    @property
    def arrow(self) -> pa.DataType:
        """As a type of Arrow."""
        one = pa.type_for_alias(self.dtype)
        return pa.list_(one, len(self.names)) if self.names else one

    @property
    def info(self) -> dict[str, Any]:
        """As `info.json` has it."""
        shape = [len(self.names)] if self.names else [1]
        return {"dtype": self.dtype, "shape": shape, "names": list(self.names) or None}


COUNTED: Final = {
    "timestamp": Feature("float32", ()),
    "frame_index": Feature("int64", ()),
    "episode_index": Feature("int64", ()),
    "index": Feature("int64", ()),
    "task_index": Feature("int64", ()),
}
"""Columns of every dataset."""


class FilmWriter:
    """The film of one camera, picture after picture at a nominal rate."""

    def __init__(self, folder: Path, key: str, fps: int) -> None:
        """Begin a film of the feature `key`."""
        self.key, self.fps = key, fps
        self.size = 0, 0
        """Width and height of the first picture, made even; others are brought to it [px]."""
        self.count = 0
        self._samples: list[Array] = []
        self._path = folder / VIDEO.format(video_key=key, **FIRST)
        self._path.parent.mkdir(parents=True)
        self._container = av.open(str(self._path), "w")
        self._stream: VideoStream | None = None

    def add(self, image: Image) -> None:
        """Append (height, width, 3) BGR."""
        if self._stream is None:
            height, width = image.shape[:2]
            self.size = width - width % 2, height - height % 2
            self._stream = self._container.add_stream("libx264", rate=self.fps, options=dict(X264))
            self._stream.width, self._stream.height = self.size
            self._stream.pix_fmt = "yuv420p"
            self._stream.codec_context.time_base = Fraction(1, self.fps)
        if image.shape[1::-1] != self.size:
            image = np.asarray(cv2.resize(image, self.size), dtype=np.uint8)
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="bgr24")
        frame.pts, frame.time_base = self.count, Fraction(1, self.fps)
        self._container.mux(self._stream.encode(frame))
        if self.count % EVERY == 0:
            thin = image[::THINNED, ::THINNED, ::-1] / 255.0
            self._samples.append(thin.reshape(-1, 3))
        self.count += 1

    def __enter__(self) -> Self:
        """Write while this lasts."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the film."""
        if self._stream is not None:
            self._container.mux(self._stream.encode(None))
        self._container.close()

    def stats(self) -> Stats:
        """Of its colours, each channel by itself, from 0 to 1."""
        stats = stats_of(np.concatenate(self._samples))
        shaped = {
            name: np.reshape(value, (3, 1, 1)).tolist()
            for name, value in stats.items()
            if name != "count"
        }
        return shaped | {"count": [len(self._samples)]}

    @property
    def info(self) -> dict[str, Any]:
        """As `info.json` has it."""
        width, height = self.size
        return {
            "dtype": "video",
            "shape": [height, width, 3],
            "names": ["height", "width", "channels"],
            "info": {
                "video.height": height,
                "video.width": width,
                "video.codec": "h264",
                "video.pix_fmt": "yuv420p",
                "video.is_depth_map": False,
                "video.fps": self.fps,
                "video.channels": 3,
                "has_audio": False,
            },
        }


def stats_of(column: Array) -> Stats:
    """Of a column (n,) or (n, k)."""
    rows = np.asarray(column, dtype=np.float64).reshape(len(column), -1)
    stats = {"min": rows.min(0), "max": rows.max(0), "mean": rows.mean(0), "std": rows.std(0)}
    stats |= {name: np.quantile(rows, q, axis=0) for name, q in QUANTILES.items()}
    return {name: value.tolist() for name, value in stats.items()} | {"count": [len(rows)]}


def write_data(folder: Path, features: Mapping[str, Feature], columns: Mapping[str, Array]) -> None:
    """Write the rows of all episodes."""
    arrays = [pa.array(columns[name].tolist(), feature.arrow) for name, feature in features.items()]
    _write(pa.table(arrays, names=list(features)), folder / DATA.format(**FIRST))


def write_episodes(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write what there is to know of each episode."""
    _write(pa.Table.from_pylist([dict(row) for row in rows]), folder / EPISODES.format(**FIRST))


def write_tasks(folder: Path, tasks: Sequence[str]) -> None:
    """Write the tasks: a table of pandas, whose index they are."""
    text = {"pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    number = {"pandas_type": "int64", "numpy_type": "int64", "metadata": None}
    metadata = {
        "index_columns": ["task"],
        "column_indexes": [{"name": None, "field_name": None, **text}],
        "columns": [
            {"name": "task_index", "field_name": "task_index", **number},
            {"name": "task", "field_name": "task", **text},
        ],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.2.0",
    }
    numbers = pa.array(range(len(tasks)), pa.int64())
    table = pa.table({"task_index": numbers, "task": pa.array(tasks, pa.string())})
    _write(
        table.replace_schema_metadata({"pandas": json.dumps(metadata)}),
        folder / "meta/tasks.parquet",
    )


def write_json(path: Path, description: Mapping[str, Any]) -> None:
    """Write a description."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(description, indent=4, ensure_ascii=False), encoding="utf-8")


def info_of(
    robot: str,
    fps: int,
    counts: Mapping[str, int],
    features: Mapping[str, Any],
) -> dict[str, Any]:
    """What `info.json` says; `counts` are the totals of episodes, frames and tasks."""
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        **{f"total_{name}": count for name, count in counts.items()},
        "chunks_size": CHUNK_FILES,
        "data_files_size_in_mb": DATA_MB,
        "video_files_size_in_mb": VIDEO_MB,
        "fps": fps,
        "splits": {"train": f"0:{counts['episodes']}"},
        "data_path": DATA,
        "video_path": VIDEO,
        "features": dict(features),
    }


def _write(table: pa.Table, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path, compression="snappy")
