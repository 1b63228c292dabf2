"""Ways of controlling that are compared, each by its name in the paper's tables."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from hardware.robot_file import RobotFile
from pipeline.config import (
    AllocationConfig,
    EstimatorName,
    FeedForwardConfig,
    LeashConfig,
    SaturationPolicy,
    TeleopConfig,
    VirtualCameraConfig,
    VirtualCameraMode,
)
from pipeline.control.cutoff import time_constants
from pipeline.estimator_config import NoFilterConfig
from server.experiments.runner import RefusedError
from server.simulation.sensors import Leader

PAPER_TAUS: Final = (3.18, 0.16)
"""Of the paper's virtual camera [s]: 0.05 Hz. Sec. V-C."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One column of a table."""

    name: str
    estimator: EstimatorName
    gains: str
    """A set of the robot file."""
    vci: VirtualCameraMode = "off"
    vci_taus: tuple[float, float] = PAPER_TAUS
    """[s]."""
    feedforward: bool = False
    allocation: SaturationPolicy = "lift"


WITHOUT_EKF: Final = Variant("without EKF", "none", "paper_without_ekf")
WITH_EKF: Final = Variant("with EKF", "paper", "paper_with_ekf")
WITHOUT_VCI: Final = replace(WITHOUT_EKF, name="without VCI")
WITH_VCI: Final = replace(WITHOUT_EKF, name="with VCI", vci="full")
"""Without the EKF, with the gains of Table II (b). Sec. V-C."""


@dataclass(frozen=True, slots=True)
class VariantRequest:
    """What was asked for on the command line; None: the default."""

    estimator: EstimatorName | None = None
    gains: str | None = None
    vci: VirtualCameraMode | None = None
    cutoff_hz: float | None = None
    feedforward: bool | None = None

    def __bool__(self) -> bool:
        """Whether anything was."""
        return self != VariantRequest()


def ours(leader: Leader, request: VariantRequest, vci: VirtualCameraMode = "off") -> Variant:
    """This project's way: relative filter and feed-forward, unless requested otherwise.

    `vci` is that of the experiment, if none is requested.
    """
    hz = request.cutoff_hz
    return Variant(
        name="ours",
        estimator=request.estimator or "relative",
        gains=request.gains or leader.gains,
        vci=request.vci or vci,
        vci_taus=PAPER_TAUS if hz is None else time_constants(hz),
        feedforward=request.feedforward is not False,
        allocation="torque_first",
    )


def config_of(robot_file: RobotFile, variant: Variant, leader: Leader) -> TeleopConfig:
    """The pipeline's configuration of a variant with a leader.

    Raises:
        KeyError: the robot file has no such gain set.
    """
    feedforward = FeedForwardConfig(
        enabled=variant.feedforward,
        low_pass_hz=leader.feedforward_low_pass_hz,
    )
    tau_1, tau_2 = variant.vci_taus
    return replace(
        TeleopConfig(),
        gains=robot_file.gains[variant.gains],
        estimator=variant.estimator,
        no_filter=NoFilterConfig(tau=leader.derivative_tau_s),
        virtual_camera=VirtualCameraConfig(
            tau_1, tau_2, variant.vci, max_speed_m_s=0.0, guard=False
        ),
        feedforward=feedforward,
        allocation=AllocationConfig(policy=variant.allocation),
        # the paper has none, and its push takes up what a leash keeps for control
        leash=LeashConfig(enabled=False),
    )


def check_gains(robot_file: RobotFile, name: str, requested: str | None = None) -> None:
    """Whether the robot has what is to be flown.

    Raises:
        RefusedError: it lacks a set; says which there are.
    """
    needed = {WITHOUT_EKF.gains, WITH_EKF.gains, *([requested] if requested else [])}
    for gains in sorted(needed - set(robot_file.gains)):
        has = ", ".join(robot_file.gains)
        raise RefusedError(f"{name}: gains: {gains!r} is not one of its sets: {has}")
