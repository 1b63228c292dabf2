"""Whether the joints of an arm can be moved by what is installed here, asked before it starts."""

from hardware.arm.arm_model import ArmModel
from hardware.plant_parameters import ArmParameters


def movable(parameters: ArmParameters) -> ArmModel:
    """Give the model of an arm that can be moved.

    Raises:
        ArmError: its model can't be used, or mink is missing.
    """
    arm = ArmModel(parameters)
    import hardware.arm.mink_extra  # noqa: F401

    return arm
