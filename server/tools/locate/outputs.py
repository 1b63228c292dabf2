"""Files that are there whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from server.common.errors import InputError
from server.common.runtime import replacement


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path to write to; what is there at the end is put in place of `path`.

    Raises:
        InputError: it can't be written.
    """
    try:
        with replacement(path) as part:
            yield part
    except OSError as error:
        raise InputError(path, "", f"can't be written: {error.strerror or error}") from error


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A folder to write to; its files are moved to `path` at the end, over those of that name.

    Raises:
        InputError: it can't be written.
    """
    part: Path | None = None
    try:
        part = Path(tempfile.mkdtemp(prefix=f"{path.name}.", suffix=".part", dir=path.parent))
        part.chmod(0o755)
        yield part
        path.mkdir(exist_ok=True)
        for file in part.iterdir():
            file.replace(path / file.name)
    except OSError as error:
        raise InputError(path, "", f"can't be written: {error.strerror or error}") from error
    finally:
        if part is not None:
            shutil.rmtree(part, ignore_errors=True)


def check_places(outputs: Sequence[tuple[str, Path]], inputs: Sequence[Path], frames: Path) -> None:
    """See that outputs (option, path) can be written, and overwrite nothing that is read.

    Raises:
        InputError: names the option.
    """
    taken = {path.resolve() for path in inputs}
    for option, path in outputs:
        place = path.resolve()
        if not place.parent.is_dir():
            raise InputError(option, "", f"there is no folder {path.parent}")
        if place in taken:
            raise InputError(option, "", f"{path} is already read or written")
        if frames.is_dir() and (place == frames.resolve() or place.parent == frames.resolve()):
            raise InputError(option, "", f"{path} would lie among the frames: name another place")
        if (option == "--overlay") == place.is_file() and place.exists():
            wanted = "a folder" if option == "--overlay" else "a file"
            raise InputError(option, "", f"{path} must be {wanted}")
        taken.add(place)
