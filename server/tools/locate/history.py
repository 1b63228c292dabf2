"""What a run found, frame by frame: for the summary, the plot and the covariances."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array, log
from server.tools.locate.gravity import GravityDoubt
from server.tools.locate.optical import POSE, SIGMAS, OpticalPose, optical
from server.tools.locate.work import Located


@dataclass(slots=True, eq=False)
class History:
    """Grows by one frame at a time."""

    names: list[str] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    poses: list[OpticalPose | None] = field(default_factory=list)
    leds: list[int] = field(default_factory=list)
    """Of the poses."""
    reprojections_px: list[float] = field(default_factory=list)
    """Of the poses."""
    reasons: list[str] = field(default_factory=list)
    """Of the frames without a pose."""
    took_s: dict[str, list[float]] = field(default_factory=dict)
    """CPU time by stage, of the frames where it ran."""
    without_motion: list[int] = field(default_factory=lambda: [0, 0])
    """Frames about whose time the camera's and the body's sensors said nothing."""
    gravity: GravityDoubt = field(default_factory=GravityDoubt)
    unreadable: int = 0

    def add(self, located: Located) -> None:
        """Take the next frame."""
        pose = located.pose
        self.names.append(located.shot.name)
        self.times.append(located.shot.t)
        self.poses.append(optical(pose) if pose is not None else None)
        if pose is not None:
            self.leds.append(pose.leds)
            self.reprojections_px.append(pose.reprojection_px)
        else:
            self.reasons.append(located.reason)
        self.unreadable += located.detection is None
        took = located.detection.took_s if located.detection is not None else {}
        for stage, s in {"read": located.read_s, **took}.items():
            self.took_s.setdefault(stage, []).append(s)
        for sensor, omega in enumerate((located.prior.omega_cf_in_c, located.prior.omega_bf_in_b)):
            self.without_motion[sensor] += omega is None
        self.gravity.add(located)

    def __len__(self) -> int:
        """Count of the frames."""
        return len(self.names)

    @property
    def found(self) -> npt.NDArray[np.bool_]:
        """(n,) whether there is a pose."""
        return np.array([pose is not None for pose in self.poses], dtype=np.bool_)

    @property
    def covariances(self) -> Array:
        """(n, 6, 6) in o, as of `OpticalPose`; NaN without a pose."""
        nothing = np.full((6, 6), np.nan)
        rows = [pose.covariance if pose is not None else nothing for pose in self.poses]
        return np.array(rows).reshape(-1, 6, 6)

    @property
    def positions(self) -> Array:
        """(n, 3) in o [m]; NaN without a pose."""
        nothing = np.full(3, np.nan)
        rows = [pose.p_bo_in_o if pose is not None else nothing for pose in self.poses]
        return np.array(rows).reshape(-1, 3)

    @property
    def turns(self) -> Array:
        """(n, 3) rotation vector in o [rad] since the first pose; NaN without a pose."""
        first = next((pose.R_ob for pose in self.poses if pose is not None), np.eye(3))
        nothing = np.full(3, np.nan)
        rows = [log(pose.R_ob @ first.T) if pose is not None else nothing for pose in self.poses]
        return np.array(rows).reshape(-1, 3)

    def save_covariances(self, path: Path) -> None:
        """An .npz: frame (n,), t_s (n,), found (n,), covariance (n, 6, 6), its order (6,)."""
        order = (*POSE[:3], *(name.removeprefix("sigma_") for name in SIGMAS[3:]))
        with path.open("wb") as file:
            np.savez(
                file,
                frame=np.array(self.names),
                t_s=np.array(self.times),
                found=self.found,
                covariance=self.covariances,
                order=np.array(order),
            )
