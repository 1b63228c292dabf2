"""Camera files: ROS camera_info YAML and Kalibr camchains, found by device and picture size."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from itertools import accumulate
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import yaml

from pipeline.camera.extrinsics import IDENTITY, Extrinsics
from pipeline.camera.lens import COLUMNS, MODELS, QUARTERS, ROWS, Camera
from pipeline.frames import Array

CAMERAS = Path(__file__).parent / "cameras"
KALIBR_MODELS = {"radtan": "plumb_bob", "equidistant": "equidistant"}
SIZES_PX = (16, 8192)
READOUTS_S = (-0.1, 0.1)
"""Negative: the other way round than the direction says."""
DIRECTIONS = {
    "top_to_bottom": (ROWS, 1.0),
    "bottom_to_top": (ROWS, -1.0),
    "left_to_right": (COLUMNS, 1.0),
    "right_to_left": (COLUMNS, -1.0),
}
"""Of a rolling shutter in the picture, as data sets call them: what counts its lines, and whether
the first or the last is exposed first."""
SCREEN_ANGLES_DEG = (0, 90, 180, 270)
TIME_OFFSETS_S = (-0.5, 0.5)
YAML_FAULTS = (yaml.YAMLError, ValueError, LookupError, AttributeError)
"""What the library raises of text that is no YAML, of a 13th month and of `!!bool x`."""
MOST_NUMBERS = 64
MOST_NESTED = 16
"""Brackets that are open at once; the library's time grows as the square of theirs."""
TOO_DEEP = "lists within too many others"
MOST_KEPT = 256
"""Of what was read: a text takes 3 ms, and all are looked through for each camera, also in flight,
when a page makes its pictures smaller."""
SKEW = 1e-3
"""What rounding may take from a rotation."""


class CameraFileError(ValueError):
    """A camera file that can't be used, or none for a camera.

    Attributes:
        file: Which file, or which camera was looked for.
        key: Which key of it.
        allowed: What would have been allowed.
    """

    def __init__(self, file: str, key: str, allowed: str) -> None:
        super().__init__(f"{file}: {key}: {allowed}" if key else f"{file}: {allowed}")
        self.file, self.key, self.allowed = file, key, allowed


def load_camera(path: Path) -> tuple[str, Camera]:
    """Name and camera of a file.

    Raises:
        CameraFileError: names file, key and what is allowed.
    """
    name, camera, _ = _read(path)
    return name, camera


def _read(path: Path) -> tuple[str, Camera, int | None]:
    """Name, camera and, if the file tells it, the screen's angle [°]."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise CameraFileError(str(path), "", error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise CameraFileError(str(path), "", "not a text file in UTF-8") from error
    return _parsed(str(path), text)


@lru_cache(MOST_KEPT)
def _parsed(file: str, text: str) -> tuple[str, Camera, int | None]:
    if _nested(text) > MOST_NESTED:
        raise CameraFileError(file, "", TOO_DEEP)
    try:
        table = yaml.safe_load(text)
    except YAML_FAULTS as error:
        raise CameraFileError(file, "", " ".join(str(error).split())) from error
    except RecursionError as error:
        raise CameraFileError(file, "", TOO_DEEP) from error
    if not isinstance(table, dict):
        raise CameraFileError(file, "", "a YAML mapping: camera_info or a Kalibr camchain")
    reader = _CameraFileReader(file, table)
    name, camera = reader.kalibr("cam0") if "cam0" in table else reader.camera_info()
    return name, camera, reader.screen_angle_deg()


def _nested(text: str) -> int:
    """How many brackets of a text are open at once, at most."""
    return max(accumulate((c in "[{") - (c in "]}") for c in text), default=0)


def find_camera(
    device: str, width: int, height: int, folders: Sequence[Path] = (CAMERAS,)
) -> Camera:
    """The calibrated camera of `device`; see `find_camera_file`."""
    return find_camera_file(device, width, height, folders)[1]


def find_camera_file(
    device: str,
    width: int,
    height: int,
    folders: Sequence[Path] = (CAMERAS,),
    screen_angle_deg: int | None = None,
) -> tuple[Path, Camera]:
    """The file and the calibrated camera of `device` for pictures of that size.

    A file belongs to a device when its camera_name, in lower case and with everything but letters
    and digits turned into dashes, is the device's. One that says how the screen was turned
    (screen_angle_deg) comes before one that doesn't say; last come those that say another angle,
    turned with the screen.

    Raises:
        CameraFileError: no calibration; says which there are.
    """
    known: list[str] = []
    fitting: list[tuple[int, Path, Camera]] = []
    for path in sorted(p for folder in folders for p in folder.glob("*.yaml")):
        name, camera, angle = _read(path)
        at = f" at {angle}°" if angle is not None else ""
        known.append(f"{name} {camera.width}x{camera.height}{at}")
        rank = 1
        if angle is not None and screen_angle_deg is not None:
            quarters = (angle - screen_angle_deg) // 90
            camera, rank = camera.turned(quarters), 2 if quarters % QUARTERS else 0
        if slug(name) == slug(device) and (camera.width, camera.height) == (width, height):
            fitting.append((rank, path, camera))
    if fitting:
        _, path, camera = min(fitting, key=lambda one: one[0])
        return path, camera
    raise CameraFileError(
        f"camera {device!r} at {width}x{height}",
        "",
        f"no calibration; there is one for: {', '.join(known) or 'no camera at all'}",
    )


def direction_of(axis: int, readout_s: float) -> str:
    """The word of `DIRECTIONS` for a readout along an axis, negative if its last line is first."""
    sign = -1.0 if readout_s < 0.0 else 1.0
    return next(word for word, of in DIRECTIONS.items() if of == (axis, sign))


def slug(name: str) -> str:
    """Letters and digits in lower case, dashes between."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


class _CameraFileReader:
    """Checks every key it reads."""

    def __init__(self, file: str, table: dict[str, Any]) -> None:
        self._file, self._table = file, table

    def camera_info(self) -> tuple[str, Camera]:
        table = self._table
        model = self._word(self._get(table, "distortion_model"), "distortion_model")
        K = self._numbers(table, "camera_matrix", 9).reshape(3, 3)
        distortion = self._numbers(table, "distortion_coefficients", None)
        camera = self._camera(
            self._size(self._get(table, "image_width"), "image_width"),
            self._size(self._get(table, "image_height"), "image_height"),
            K,
            model,
            distortion,
            self._readout_s(),
        )
        camera = replace(camera, extrinsics=self._mounting())
        return self._word(table.get("camera_name", Path(self._file).stem), "camera_name"), camera

    def kalibr(self, name: str) -> tuple[str, Camera]:
        table = self._table[name]
        if not isinstance(table, dict):
            self._refuse(name, "a mapping")
        if table.get("camera_model", "pinhole") != "pinhole":
            self._refuse(f"{name}.camera_model", "pinhole")
        key = f"{name}.distortion_model"
        model = KALIBR_MODELS.get(self._word(self._get(table, "distortion_model"), key))
        if model is None:
            self._refuse(key, ", ".join(KALIBR_MODELS))
        fu, fv, pu, pv = self._numbers(table, "intrinsics", 4)
        width, height = (self._size(n, "resolution") for n in self._numbers(table, "resolution", 2))
        K = np.array([[fu, 0.0, pu], [0.0, fv, pv], [0.0, 0.0, 1.0]])
        distortion = self._numbers(table, "distortion_coeffs", 4)
        return Path(self._file).stem, self._camera(
            width, height, K, model, distortion, self._line_readout_s(name, width, height)
        )

    def screen_angle_deg(self) -> int | None:
        angle = self._table.get("screen_angle_deg")
        if angle is not None and (isinstance(angle, bool) or angle not in SCREEN_ANGLES_DEG):
            self._refuse("screen_angle_deg", ", ".join(map(str, SCREEN_ANGLES_DEG)))
        return None if angle is None else int(angle)

    def _readout_s(self) -> float:
        key = "rolling_shutter_readout_s"
        return self._number(self._table.get(key, 0.0), key, *READOUTS_S)

    def _mounting(self) -> Extrinsics:
        """How the camera sits beside the motion sensors; the key may be missing."""
        table = self._table.get("camera_imu")
        if table is None:
            return IDENTITY
        if not isinstance(table, dict):
            self._refuse("camera_imu", "a mapping with rotation and time_offset_s")
        key = "camera_imu.rotation"
        R_ci = self._numbers({key: table.get("rotation")}, key, 9).reshape(3, 3)
        is_small = np.abs(R_ci).max() <= 1.0 + SKEW
        is_square = is_small and np.allclose(R_ci @ R_ci.T, np.eye(3), atol=SKEW)
        if not is_square or np.linalg.det(R_ci) < 0.0:
            self._refuse(key, "a rotation, row by row")
        key = "camera_imu.time_offset_s"
        offset_s = self._number(table.get("time_offset_s", 0.0), key, *TIME_OFFSETS_S)
        U, _, Vt = np.linalg.svd(R_ci)
        return Extrinsics(U @ Vt, offset_s)

    def _direction(self) -> tuple[int, float]:
        """Readout axis, and the sign of the readout time."""
        key = "rolling_shutter_direction"
        direction = DIRECTIONS.get(self._word(self._table.get(key, "top_to_bottom"), key))
        if direction is None:
            self._refuse(key, ", ".join(DIRECTIONS))
        return direction

    def _line_readout_s(self, name: str, width: int, height: int) -> float:
        """Readout time of a camchain: our own key, else Kalibr's time between two lines."""
        table = self._table[name]
        if "line_delay" not in table:
            return self._readout_s()
        if "rolling_shutter_readout_s" in self._table:
            self._refuse("rolling_shutter_readout_s", f"not beside {name}.line_delay")
        lines = height if self._direction()[0] == ROWS else width
        low, high = (readout / lines for readout in READOUTS_S)
        return lines * self._number(table["line_delay"], f"{name}.line_delay", low, high)

    def _camera(
        self, width: int, height: int, K: Array, model: str, distortion: Array, readout_s: float
    ) -> Camera:
        if model not in MODELS:
            self._refuse("distortion_model", ", ".join(MODELS))
        if len(distortion) not in MODELS[model]:
            counts = " or ".join(str(n) for n in MODELS[model])
            self._refuse("distortion_coefficients", f"{counts} numbers for {model}")
        if (
            K[0, 0] <= 0.0
            or K[1, 1] <= 0.0
            or K[0, 1] != 0.0
            or K[1, 0] != 0.0
            or not np.array_equal(K[2], (0, 0, 1))
        ):
            self._refuse("camera_matrix", "[fx, 0, cx, 0, fy, cy, 0, 0, 1] with fx, fy > 0")
        axis, sign = self._direction()
        return Camera(width, height, K, model, distortion, sign * readout_s, axis)

    def _get(self, table: dict[str, Any], key: str) -> object:
        if key not in table:
            self._refuse(key, "must be there")
        return table[key]

    def _word(self, value: object, key: str) -> str:
        if not isinstance(value, (str, int, float)):
            self._refuse(key, "a word")
        return str(value)

    def _size(self, value: object, key: str) -> int:
        size = self._number(value, key, *SIZES_PX)
        if not size.is_integer():
            self._refuse(key, "a whole number")
        return int(size)

    def _number(self, value: object, key: str, low: float, high: float) -> float:
        if isinstance(value, str):  # YAML's 2e-2 is a word: it wants 2.0e-2
            with suppress(ValueError):
                value = float(value)
        if (
            isinstance(value, bool)
            or not isinstance(value, (int, float))
            or not low <= value <= high
        ):
            self._refuse(key, f"a number from {low:g} to {high:g}")
        return float(value)

    def _numbers(self, table: dict[str, Any], key: str, count: int | None) -> Array:
        value = self._get(table, key)
        data = value.get("data") if isinstance(value, dict) else value
        try:
            numbers = np.array(data if _is_flat(data) else np.nan, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            numbers = np.array(np.nan)
        right = numbers.ndim == 1 and (count is None or len(numbers) == count)
        if not right or not bool(np.isfinite(numbers).all()):
            self._refuse(key, f"{count if count else 'a list of'} finite numbers")
        return numbers

    def _refuse(self, key: str, allowed: str) -> NoReturn:
        raise CameraFileError(self._file, key, allowed)


def _is_flat(data: object) -> bool:
    """Whether it is a short list without others in it: by YAML's aliases they may have no end."""
    if not isinstance(data, list) or len(data) > MOST_NUMBERS:
        return False
    return not any(isinstance(one, (list, dict)) for one in data)
