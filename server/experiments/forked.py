"""What would follow: tried in a copy of this process, which itself goes on as if nothing was."""

from __future__ import annotations

import os
import pickle
import traceback
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")


class ForkError(RuntimeError):
    """A copy ended without an answer."""


def forked(work: Callable[[], Result]) -> Result:
    """What `work` gives when a copy of this process does it; nothing of it is left here.

    For processes with one thread, on systems that have fork.

    Raises:
        ForkError: the copy failed; its own words are on stderr.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(reader)
            with os.fdopen(writer, "wb") as pipe:
                pickle.dump(work(), pipe)
            code = 0
        except BaseException:  # noqa: BLE001 (it must not go on as if it were the other one)
            traceback.print_exc()
        finally:
            os._exit(code)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        pickled = pipe.read()
    _, status = os.waitpid(child, 0)
    if status != 0:
        raise ForkError(f"a copy of the flight ended with {status}")
    result: Result = pickle.loads(pickled)
    return result
