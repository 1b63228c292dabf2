"""Turns of a camera, and a virtual one whose robot is ideal: always exactly where it should be."""

from __future__ import annotations

from math import inf, radians, tan

import numpy as np
from hypothesis import strategies as st

from pipeline.config import VirtualCameraConfig
from pipeline.control.virtual_camera import VirtualCamera
from pipeline.frames import exp, log, rotation_about_z
from pipeline.signals import RelativeState

H = 0.005
DISTANCE_M = 2.5
FREE = VirtualCameraConfig(max_speed_m_s=0.0, guard=False, tau_parallel=0.0)
AHEAD = np.array([DISTANCE_M, 0.0, 0.0])
HALF_FIELD = (tan(radians(32.0)), tan(radians(32.0)))

angles = st.floats(-3.0, 3.0)
rotations = st.builds(lambda x, y, z: exp(np.array([x, y, z])), angles, angles, angles)
sights = st.builds(
    lambda side, up, far: far * exp(np.array([0.0, up, side]))[:, 0],
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(0.5, 8.0),
)
configs = st.builds(
    VirtualCameraConfig,
    tau_1=st.sampled_from([0.0, 0.05, 0.525, 3.18]),
    tau_2=st.sampled_from([0.0, 0.16]),
    mode=st.sampled_from(["full", "selective", "off"]),
    tau_parallel=st.sampled_from([0.0, 0.1]),
    adaptive_beta=st.sampled_from([0.0, 0.6, 10.0]),
    max_speed_m_s=st.sampled_from([0.0, inf, 0.3, 1.0]),
    guard=st.booleans(),
)


def minimum_jerk(s: float) -> float:
    """From 0 to 1 as s goes from 0 to 1, at rest at both ends."""
    s = min(max(s, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def relative(p: np.ndarray, R_cb: np.ndarray, u: np.ndarray | None = None) -> RelativeState:
    return RelativeState(
        t=0.0,
        p_bc_in_c=p,
        R_cb=R_cb,
        u_bf_in_c=np.array([0.1, -0.2, 0.05]) if u is None else u,
        omega_bf_in_b=np.zeros(3),
        omega_cf_in_c=np.zeros(3),
        R_ic=np.eye(3),
        sigma_p=0.0,
        sigma_theta=0.0,
        age=0.0,
        f_cf_in_c=np.array([0.0, 0.0, 9.8]),
        f_bf_in_b=np.array([0.0, 0.0, 9.8]),
    )


class Follower:
    """Keeps what happens while the camera turns."""

    def __init__(self, config: VirtualCameraConfig, p_ref, half_field=None) -> None:
        self.camera, self.p_ref, self.half_field = VirtualCamera(config), p_ref, half_field
        self.R_fv, self.omega, self.lag, self.p_bc, self.guarding = [], [], [], [], []

    def step(self, R_fc: np.ndarray) -> None:
        R_fv = self.R_fv[-1] if self.R_fv else R_fc
        p_bc_in_c = R_fc.T @ R_fv @ self.p_ref
        seen = relative(p_bc_in_c, np.eye(3))
        view = self.camera.view(seen, R_fc, H, self.p_ref, self.half_field)
        self.R_fv.append(view.R_fv)
        self.omega.append(view.omega_vf_in_v)
        self.lag.append(float(np.linalg.norm(log(view.R_fv.T @ R_fc))))
        self.p_bc.append(p_bc_in_c)
        self.guarding.append(self.camera.guarding)

    @property
    def velocity(self) -> np.ndarray:
        """(n, 3) of the reference in f [m/s]."""
        return np.array(
            [R @ np.cross(w, self.p_ref) for R, w in zip(self.R_fv, self.omega, strict=True)]
        )

    @property
    def speed(self) -> np.ndarray:
        return np.linalg.norm(self.velocity, axis=1)

    @property
    def acceleration(self) -> np.ndarray:
        return np.linalg.norm(np.diff(self.velocity, axis=0), axis=1) / H

    def out(self) -> np.ndarray:
        """How far out in the picture the robot was: 1 at the border."""
        p = np.array(self.p_bc)
        side, up = self.half_field
        return np.maximum(np.abs(p[:, 1]) / side, np.abs(p[:, 2]) / up) / p[:, 0]


def off_axis(degrees_to_the_left: float) -> np.ndarray:
    return rotation_about_z(radians(degrees_to_the_left)) @ AHEAD


def follow(config: VirtualCameraConfig, attitudes, p_ref=AHEAD, half_field=None) -> Follower:
    follower = Follower(config, p_ref, half_field)
    for R_fc in attitudes:
        follower.step(R_fc)
    return follower


def turn(angle: float, seconds: float, wait: float, about=rotation_about_z):
    """Attitudes of a turn from rest to rest."""
    for k in range(round((seconds + wait) / H)):
        yield about(angle * minimum_jerk(k * H / seconds))
