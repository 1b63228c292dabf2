"""`lightleash locate`: frames of a robot's LEDs → where it was in each, and how sure that is.

The very stages of the live pipeline, on a folder of pictures or a film. All that is read and
written is told in `server.tools.locate.options`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence


def main(argv: Sequence[str]) -> int:
    """Entry of `lightleash locate`."""
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(8192**2))  # read when cv2 is loaded
    from server.tools.locate.command import main as run

    return run(argv)
