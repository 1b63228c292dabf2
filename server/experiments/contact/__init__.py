"""`lightleash experiments contact`: pushing a wall, plugging in; compliant beside stiff."""

from server.experiments.contact.command import add_arguments, run

__all__ = ["add_arguments", "run"]
