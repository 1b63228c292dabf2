"""`python -m server`, and the `lightleash` console script."""

from __future__ import annotations

import sys

from server.cli import main as run


def main() -> None:
    """Entry of the console script."""
    sys.exit(run())


if __name__ == "__main__":
    main()
