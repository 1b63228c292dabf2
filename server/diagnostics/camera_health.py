"""From what `VisualFrontEnd` learnt of a camera to what pages show of it."""

from __future__ import annotations

from pipeline.camera.exposure import ADVICE
from pipeline.vision.visual_front_end import VisualFrontEnd
from server.protocol.camera_messages import CameraHealth


def health(front_end: VisualFrontEnd) -> CameraHealth:
    """Any thread may ask: each value is replaced whole."""
    facts, exposure, hint = (
        front_end.monitor.facts,
        front_end.exposure.exposure_s,
        front_end.exposure.hint,
    )
    report = CameraHealth(
        complaint=front_end.complaint or front_end.repeats.remark,
        hint=hint.value,
        advice=ADVICE[hint],
        exposure_ms=None if exposure is None else round(1e3 * exposure, 1),
        readout_ms=round(1e3 * front_end.readout.in_use_s, 2),
        readout_learnt=front_end.readout.is_learnt,
    )
    if facts is None:
        return report
    return CameraHealth(
        complaint=report.complaint,
        hint=report.hint,
        advice=report.advice,
        exposure_ms=report.exposure_ms,
        readout_ms=report.readout_ms,
        readout_learnt=report.readout_learnt,
        readout_sigma_ms=round(1e3 * facts.readout_sigma_s, 2),
        time_offset_ms=round(1e3 * facts.offset_s, 2),
        time_offset_sigma_ms=round(1e3 * facts.offset_sigma_s, 2),
        larger_percent=round(100.0 * facts.focal, 2),
        larger_sigma_percent=round(100.0 * facts.focal_sigma, 2),
        held_percent=round(100.0 * facts.held, 1),
        held_sigma_percent=round(100.0 * facts.held_sigma, 1),
    )
