"""Settings for every test."""

import os

import matplotlib
from hypothesis import settings

matplotlib.use("agg")  # no test needs a display

# A busy machine is not a failed law: examples have no deadline. In CI they are the same each time.
settings.register_profile("default", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "default")
