"""One server commands a real robot: a second one that would is refused before anything starts.

By the robot's name, which is also whose key and epochs they are: two control processes with one key
would take the robot from each other, the later each time. A server with another name for the same
robot has another key, which the robot does not take; behind a link without a key control listens at
the robot's port, which only one can.
"""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hardware.robot_file import COMMANDS, load_robot
from server.common.runtime import BusyError, private_directory, private_opener
from server.common.settings import Settings
from server.process.ports import words_for
from server.process.robot_key import ROBOTS


@contextmanager
def claimed(settings: Settings) -> Iterator[None]:
    """The robot is this server's while it lasts; a simulated one is nobody else's anyway.

    Raises:
        RobotFileError: no such robot.
        BusyError: another server of this state directory has it; says which.
    """
    if settings.simulate:
        yield
        return
    robot = load_robot(settings.robot, takes=COMMANDS).robot.name
    with claimed_robot(settings.state, robot, words_for(settings.name)):
        yield


@contextmanager
def claimed_robot(state: Path, robot: str, by: str) -> Iterator[None]:
    """The real robot of that name is ours while it lasts; `by` says who we are.

    Raises:
        BusyError: another one of this state directory has it; says which.
    """
    file = private_directory(state / ROBOTS) / f"{robot}.lock"
    with open(file, "a+", encoding="utf-8", opener=private_opener) as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            lock.seek(0)
            raise BusyError(
                f"robot {robot}: {lock.read() or 'another server'} commands it; stop that one, or "
                "give another robot a file with a name of its own"
            ) from error
        lock.truncate(0)
        lock.write(by)
        lock.flush()
        yield
