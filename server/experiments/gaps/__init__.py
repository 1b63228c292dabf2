"""`lightleash experiments gaps`: the closed loop against gaps in its links, in virtual time."""

from server.experiments.gaps.command import add_arguments, run

__all__ = ["add_arguments", "run"]
