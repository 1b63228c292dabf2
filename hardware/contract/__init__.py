"""What every link to a robot must do, as tests that anybody can run on theirs. Needs pytest.

Inherit `FollowerContract`, `TwistFollowerContract` if the robot takes a twist, or
`AttitudeFollowerContract` if it takes attitude and thrust, and give a `Rig`.
"""

import pytest

# pytest explains what failed only in modules of tests, unless it is told before they are imported.
pytest.register_assert_rewrite(
    *(f"hardware.contract.{name}" for name in ("of_all", "of_attitudes", "of_twists"))
)

from hardware.contract.of_all import FollowerContract, Rig, exchange  # noqa: E402
from hardware.contract.of_attitudes import AttitudeFollowerContract  # noqa: E402
from hardware.contract.of_twists import TwistFollowerContract  # noqa: E402

__all__ = [
    "AttitudeFollowerContract",
    "FollowerContract",
    "Rig",
    "TwistFollowerContract",
    "exchange",
]
