import numpy as np
import pytest

from pipeline.frames import R_co, R_from_rpy, R_from_wxyz, exp, log
from pipeline.signals import RelativePose
from server.tools.locate.optical import COLUMNS, optical, row


def pose(rng, covariance=None):
    p = np.array([2.5, 0.3, -0.2])
    A = rng.normal(0.0, 1.0, (6, 6)) * [0.01, 0.002, 0.001, 0.02, 0.01, 0.005]
    C = A @ A.T if covariance is None else covariance
    return RelativePose(1.5, p, R_from_rpy(rng.uniform(-1.0, 1.0, 3)), C, 0.1234, 5)


def test_the_columns_are_those_that_were_promised():
    assert ",".join(COLUMNS) == (
        "frame,t_s,found,x_m,y_m,z_m,qw,qx,qy,qz,sigma_x_m,sigma_y_m,sigma_z_m,"
        "sigma_rx_rad,sigma_ry_rad,sigma_rz_rad,leds,reprojection_px,"
        "detect_us,identify_us,pose_us"
    )


def test_left_and_up_of_the_camera_are_minus_right_and_minus_down():
    seen = optical(pose(np.random.default_rng(1)))
    np.testing.assert_allclose(seen.p_bo_in_o, [-0.3, 0.2, 2.5])
    np.testing.assert_allclose(R_co @ seen.p_bo_in_o, [2.5, 0.3, -0.2])


def test_an_uncertainty_of_the_body_axes_is_that_of_the_optical_axes():
    """Poses drawn as the pipeline means its covariance are distributed as the file says."""
    rng = np.random.default_rng(2)
    believed = pose(rng)
    seen = optical(believed)
    errors = []
    for error in rng.multivariate_normal(np.zeros(6), believed.covariance, 4000):
        p, R = believed.p_bc_in_c + error[:3], believed.R_cb @ exp(error[3:])
        true_R_ob, true_p = R_co.T @ R, R_co.T @ p
        errors.append([*(true_p - seen.p_bo_in_o), *log(true_R_ob @ seen.R_ob.T)])
    drawn = np.array(errors)
    whitened = drawn @ np.linalg.inv(np.linalg.cholesky(seen.covariance)).T
    np.testing.assert_allclose(np.cov(whitened.T), np.eye(6), atol=0.12)
    np.testing.assert_allclose(drawn.std(axis=0), seen.sigmas, rtol=0.06)


def test_depth_is_the_least_sure_of_the_optical_axes():
    C = np.diag([0.01, 0.001, 0.002, 0.1, 0.1, 0.1]) ** 2
    sigmas = optical(pose(np.random.default_rng(3), C)).sigmas
    np.testing.assert_allclose(sigmas[:3], [0.001, 0.002, 0.01])


@pytest.mark.parametrize("seed", range(5))
def test_a_row_gives_the_pose_back(seed):
    believed = pose(np.random.default_rng(seed))
    cells = row("a.png", 1.5, believed, 5, {"detect": 1e-4, "identify": 2e-4, "pose": 5e-5})
    assert list(cells) == list(COLUMNS)
    assert (cells["frame"], float(cells["t_s"]), cells["found"]) == ("a.png", 1.5, "1")
    q = [float(cells[name]) for name in ("qw", "qx", "qy", "qz")]
    assert q[0] >= 0.0
    np.testing.assert_allclose(R_co @ R_from_wxyz(q), believed.R_cb, atol=1e-7)
    stages = [cells[f"{name}_us"] for name in ("detect", "identify", "pose")]
    assert stages == ["100.0", "200.0", "50.0"]
    assert (cells["leds"], cells["reprojection_px"]) == ("5", "0.1234")


def test_of_a_frame_without_a_pose_only_what_is_known_is_told():
    known = {"frame", "t_s", "found", "leds", "detect_us", "identify_us", "pose_us"}
    cells = row("a.png", 1.5, None, 2, {"detect": 1e-4})
    assert {name for name, cell in cells.items() if cell} == known
    assert (cells["found"], cells["leds"], cells["pose_us"]) == ("0", "2", "0.0")
    unread = row("a.png", 1.5, None, None, {})
    assert {name for name, cell in unread.items() if cell} == {"frame", "t_s", "found"}
