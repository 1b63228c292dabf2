"""Following again after a gap: from where the robot is, slowly back to where the phone has it."""

from __future__ import annotations

import numpy as np

from pipeline.config import ResumptionConfig
from pipeline.control import low_pass
from pipeline.control.pid import Reference
from pipeline.frames import Array, exp, log
from pipeline.signals import RelativeState


def is_near(config: ResumptionConfig, led_to: Reference, relative: RelativeState) -> bool:
    """Whether the robot is still about where it was led to, seen from the phone as it is now."""
    offset_in_c = led_to.p_rv_in_v - relative.p_bc_in_c
    turn = log(relative.R_cb.T @ led_to.R_vr)
    return bool(
        float(offset_in_c @ offset_in_c) <= config.max_offset_m**2
        and float(turn @ turn) <= config.max_offset_rad**2
    )


def is_settled(config: ResumptionConfig, sigma_p: float, picture_s: float, gap_s: float) -> bool:
    """Whether no picture is due that will mend the robot's place by more than a release moves it.

    Args:
        config: How far that is.
        sigma_p: Standard deviation of the place [m].
        picture_s: Since the newest believed picture was taken [s].
        gap_s: Since the gap was noticed [s].
    """
    return sigma_p <= config.settled_m or picture_s < gap_s


def toward(
    config: ResumptionConfig, reference: Reference, led_to: Reference, h: float
) -> Reference:
    """The reference after another `h` [s] on its way to `led_to`; no faster than is allowed."""
    offset_in_v = led_to.p_rv_in_v - reference.p_rv_in_v
    turn = log(reference.R_vr.T @ led_to.R_vr)
    way = way_gone(config, offset_in_v, h)
    share = low_pass.share(h / config.settle_s)
    part = min(share, h * config.max_rate_rad_s / max(float(np.linalg.norm(turn)), 1e-9))
    return Reference(reference.p_rv_in_v + way * offset_in_v, reference.R_vr @ exp(part * turn))


def way_gone(config: ResumptionConfig, offset: Array, h: float) -> float:
    """Share of an offset (3,) [m] that is gone after `h` [s]; no faster than is allowed."""
    share = low_pass.share(h / config.settle_s)
    return min(share, h * config.max_speed_m_s / max(float(np.linalg.norm(offset)), 1e-9))
