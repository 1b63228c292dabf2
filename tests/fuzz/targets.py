"""All targets: one small function for each parser of bytes or text from outside."""

from tests.fuzz import (  # noqa: F401
    file_targets,
    http_targets,
    link_targets,
    picture_targets,
    process_targets,
    records_targets,
    rtc_targets,
)
from tests.fuzz.target import TARGETS

__all__ = ["TARGETS"]
