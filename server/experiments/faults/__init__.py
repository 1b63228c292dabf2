"""`lightleash experiments faults`: every fault of the hazard table, in virtual time and live."""

from server.experiments.faults.command import add_arguments, run

__all__ = ["add_arguments", "run"]
