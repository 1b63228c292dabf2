"""`lightleash warm`: what must be fast is compiled once, by one process, before anything starts.

Robot, control and server would each compile the same side by side, for a minute and unseen; and a
thread of the server that compiles keeps the interpreter for itself, for half a second at a time.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module

from pipeline.jit import are_kernels_kept, cache_folder, kernel_sources, note_kernels_kept
from server.common.child import raise_niceness
from server.common.options import Parser
from server.common.progress import progress_bar

NICENESS = 10
"""Behind whatever else this computer does."""
NOWHERE = (
    "Compiled code can't be kept, so each process compiles for itself at every start: "
    "name a folder that can be written by NUMBA_CACHE_DIR or XDG_CACHE_HOME."
)


def _in_flight() -> None:
    """Kernels of many signatures, by what calls them; importing it all compiles nothing by then."""
    from hardware.robot_file import COMMANDS, ROBOTS, load_robot
    from hardware.sim.reference_trajectory import ReferenceTrajectory
    from pipeline.config import TeleopConfig
    from pipeline.estimation import estimators
    from pipeline.vision import visual_front_end
    from server.control.controller import Controller

    visual_front_end.warm_up()
    estimators.warm_up()
    ReferenceTrajectory.warm_up()
    for path in ROBOTS.glob("*.toml"):  # six axes and fewer share out their thrust differently
        Controller(load_robot(path, takes=COMMANDS).robot, TeleopConfig())


def compile_kernels() -> None:
    """All that flies, with a bar on a terminal; what only tools need they compile themselves.

    Raises:
        OSError: it can't be kept.
    """
    parts: list[Callable[[], object]] = [partial(import_module, name) for name in kernel_sources()]
    with progress_bar(len(parts) + 1, "parts") as bar:
        for part in (*parts, _in_flight):
            part()
            bar.update()
    note_kernels_kept()


def main(argv: Sequence[str]) -> int:
    """Entry of `lightleash warm`; the exit code is 1 if nothing can be kept."""
    Parser(prog="lightleash warm", description="compile what must be fast, once").parse_args(argv)
    folder = cache_folder()
    if folder is None:
        print(NOWHERE, file=sys.stderr)
        return 1
    if not are_kernels_kept():
        print("Compiling what must be fast: about a minute, once.", file=sys.stderr, flush=True)
        raise_niceness(NICENESS)
        try:
            compile_kernels()
        except OSError as error:
            print(f"{NOWHERE} This one can't: {error}", file=sys.stderr)
            return 1
    print(f"Compiled code lies {f'in {folder}' if folder else 'beside its sources'}.")
    return 0
