"""mink, which solves inverse kinematics: an extra (`arm`), which this alone loads."""

from hardware.arm.arm_model import ArmError

try:
    import mink
except ModuleNotFoundError as error:
    missing = "mink is missing: `make arm`, or pip install 'lightleash[arm]'; docs/arm.md"
    raise ArmError("", missing) from error

__all__ = ["mink"]
