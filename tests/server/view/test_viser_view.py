"""What the 3D view draws, and that drawing it is cheap."""

import time
from math import radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.robot_file import COMMANDS, load_robot
from pipeline.frames import R_co, R_from_rpy, R_from_wxyz, wxyz_from_R
from pipeline.signals import Mode
from server.control.ipc import ControlStatus
from server.view import scene
from server.view.viser_view import Dashboard

pytestmark = pytest.mark.slow  # a real viser

AMES, QUADROTOR, GROUND = (load_robot(name) for name in ("ames", "quadrotor", "ground"))
TWISTER = load_robot("twister", takes=COMMANDS)
angle = st.floats(-1.2, 1.2)
attitude = st.builds(lambda *eta: R_from_rpy(np.array(eta)), angle, angle, angle)
point = st.builds(lambda *p: np.array(p), *[st.floats(-5.0, 5.0)] * 3)


def status(**changes):
    """Seen from a level phone 2.5 m in front of the robot."""
    fields = dict.fromkeys(ControlStatus.__struct_fields__)
    level = (1.0, 0.0, 0.0, 0.0)
    fields |= {"t": 0.0, "epoch": 1, "mode": Mode.TRACK, "pose_age": 0.05, "thrusts": [1.0] * 8}
    fields |= {"p_bc_in_c": (2.5, 0.0, 0.0), "reference_p_in_v": (2.4, 0.0, 0.0)}
    fields |= dict.fromkeys(("R_cb_wxyz", "R_fc_wxyz", "R_fv_wxyz", "reference_R_wxyz"), level)
    return ControlStatus(**fields | changes)


@given(attitude, attitude, point)
def test_the_robot_is_drawn_where_the_phone_sees_it(R_fc, R_cb, p_bc_in_c):
    view = scene.view(
        status(R_fc_wxyz=wxyz_from_R(R_fc), R_cb_wxyz=wxyz_from_R(R_cb), p_bc_in_c=tuple(p_bc_in_c))
    )
    assert np.allclose(view.robot.position, R_fc @ p_bc_in_c)
    assert np.allclose(R_from_wxyz(view.robot.wxyz), R_fc @ R_cb)


@given(attitude, attitude)
def test_frusta_look_along_the_cameras_x(R_fc, R_fv):
    view = scene.view(status(R_fc_wxyz=wxyz_from_R(R_fc), R_fv_wxyz=wxyz_from_R(R_fv)))
    for pose, R in ((view.phone, R_fc), (view.virtual_camera, R_fv)):
        assert np.allclose(R_from_wxyz(pose.wxyz)[:, 2], R[:, 0])
        assert np.allclose(R_from_wxyz(pose.wxyz), R @ R_co)


@given(attitude, attitude, point)
def test_the_reference_hangs_on_the_virtual_camera(R_fv, R_vr, p):
    turned = {"R_fv_wxyz": wxyz_from_R(R_fv), "reference_R_wxyz": wxyz_from_R(R_vr)}
    view = scene.view(status(**turned, reference_p_in_v=tuple(p)))
    assert np.allclose(view.reference.position, R_fv @ p)
    assert np.allclose(R_from_wxyz(view.reference.wxyz), R_fv @ R_vr)


@pytest.mark.parametrize("mode", [mode for mode in Mode if mode is not Mode.TRACK])
def test_the_reference_is_shown_only_while_tracking(mode):
    assert scene.view(status(mode=mode)).reference is None


def test_what_is_not_known_is_not_drawn():
    nothing = scene.view(status(R_fc_wxyz=None))
    assert (nothing.phone, nothing.robot, nothing.virtual_camera, nothing.reference) == (None,) * 4
    assert scene.view(status(p_bc_in_c=None)).robot is None
    assert scene.view(status(p_bc_in_c=(1.0, float("nan"), 0.0))).robot is None
    assert scene.view(status(R_cb_wxyz=(float("nan"),) * 4)).robot is None
    assert scene.view(status(R_cb_wxyz=(0.0,) * 4)).robot is None
    assert scene.view(status(p_bc_in_c=None)).phone is not None


def test_an_old_pose_is_not_fresh():
    assert scene.view(status()).is_fresh
    assert not scene.view(status(pose_age=1.0)).is_fresh
    assert not scene.view(status(pose_age=float("inf"))).is_fresh


def test_f_is_turned_when_a_phone_appears_and_not_while_it_moves():
    def yaw_of(yaw, epoch=1):
        R_fc = R_from_rpy(np.array([0.0, 0.3, yaw]))
        return heading.new_yaw(epoch, scene.view(status(R_fc_wxyz=wxyz_from_R(R_fc))))

    heading = scene.Heading()
    assert yaw_of(1.0) == pytest.approx(1.0)
    assert yaw_of(2.0) is None
    assert heading.new_yaw(1, scene.view(status(R_fc_wxyz=None))) is None
    assert yaw_of(0.5) == pytest.approx(0.5)
    assert yaw_of(-0.5, epoch=2) == pytest.approx(-0.5)


@given(st.floats(0.3, 3.0))
def test_the_longer_side_of_a_picture_has_the_same_angle_either_way(aspect):
    half_y = np.tan(scene.fov_y(aspect) / 2.0)
    assert max(half_y, half_y * aspect) == pytest.approx(np.tan(scene.LONG_SIDE_FOV / 2.0))


def test_the_trail_keeps_eight_seconds_at_five_hertz():
    trail = scene.Trail()
    changes = sum(trail.add(k / 50.0, np.array([k / 50.0, 0.0, 0.0])) for k in range(1000))
    segments = trail.segments()
    assert changes == pytest.approx(100, abs=5)
    assert np.ptp(segments[..., 0]) == pytest.approx(8.0, abs=0.6)
    assert np.array_equal(segments[1:, 0], segments[:-1, 1])


@pytest.mark.parametrize("t", [5.0, -5.0])
def test_the_trail_does_not_bridge_a_gap(t):
    trail = scene.Trail()
    for k in range(5):
        trail.add(0.2 * k, np.ones(3))
    assert trail.add(t, np.full(3, 9.0))
    assert np.all(trail.segments() == 9.0)


def test_arrows_are_the_forces_on_the_body():
    thrusts = np.linspace(0.5, 3.0, 8)
    craft = scene.Craft.of(AMES.robot, AMES.plant)
    arrows = craft.arrows(thrusts)
    force = (arrows[:, 1] - arrows[:, 0]).sum(axis=0) * AMES.robot.f_max / scene.FULL_ARROW_M
    assert np.allclose(force, (AMES.robot.A @ thrusts)[:3], atol=1e-4)


@pytest.mark.parametrize("robot_file", [QUADROTOR, GROUND], ids=["quadrotor", "ground"])
def test_a_robot_that_stands_has_feet_on_the_floor_and_no_cable(robot_file):
    craft = scene.Craft.of(robot_file.robot, robot_file.plant)
    assert craft.cable is None
    lowest = craft.airframe()[0][:, 2].min()
    floor = scene.floor_z(robot_file.plant, robot_file.start) + robot_file.start.above
    assert lowest == pytest.approx(floor, abs=0.01)
    assert scene.floor_z(AMES.plant, AMES.start) == scene.FLOOR_Z


def test_the_cable_goes_up_from_the_hook():
    cable = scene.Craft.of(AMES.robot, AMES.plant).cable
    np.testing.assert_allclose(cable, [[[0.0, 0.0, 0.03], [0.0, 0.0, 1.33]]])


def test_meshes_are_closed():
    vertices, faces = scene.prism(np.zeros(3), np.array([0.3, -0.2, 0.1]), 0.05, 7)
    edges = np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    base = 7 / 2 * 0.05**2 * np.sin(2 * np.pi / 7)
    assert volume == pytest.approx(base * np.sqrt(0.14))


@pytest.fixture(scope="module")
def dashboard(tmp_path_factory):
    path = tmp_path_factory.mktemp("view") / "view.sock"
    dashboard = Dashboard(AMES.robot, AMES.plant, AMES.start, path)
    yield dashboard
    dashboard.stop()


def test_the_scene_follows_the_status(dashboard):
    dashboard.show(status(), None)
    assert dashboard._robot.visible
    assert np.allclose(dashboard._robot.position, (2.5, 0.0, 0.0))
    assert dashboard._reference.visible
    assert dashboard._command.visible
    dashboard.show(status(p_bc_in_c=None, mode=Mode.HOLD, pose_age=9.0), None)
    assert not dashboard._robot.visible
    assert not dashboard._trail_lines.visible
    assert not dashboard._reference.visible
    assert dashboard._phone.visible


def test_before_there_is_a_phone_a_grey_robot_is_shown_at_rest(dashboard):
    dashboard.show(status(R_fc_wxyz=None), None)
    assert dashboard._robot.visible
    assert np.allclose(dashboard._robot.position, (AMES.start.distance, 0.0, -AMES.start.above))
    assert not dashboard._command.visible
    assert not dashboard._phone.visible


def test_a_robot_without_a_cable_is_shown_with_its_thrusts(tmp_path):
    dashboard = Dashboard(QUADROTOR.robot, QUADROTOR.plant, QUADROTOR.start, tmp_path / "view.sock")
    dashboard.show(status(thrusts=[2.0, 3.0, 4.0, 5.0]), None)
    assert dashboard._robot.visible
    assert dashboard._command.points.shape == (4, 2, 3)
    assert np.ptp(dashboard._command.points[:, :, 2], axis=1).max() == pytest.approx(0.33 * 5 / 7)
    dashboard.stop()


def test_a_robot_that_takes_a_twist_is_shown_with_the_motion_it_is_told(tmp_path):
    dashboard = Dashboard(TWISTER.robot, TWISTER.plant, TWISTER.start, tmp_path / "view.sock")
    told = (0.0, 0.25, 0.0, 0.0, 0.0, radians(-90.0))
    dashboard.show(status(thrusts=[], twist_in_b=told), None)
    tips = scene.FULL_ARROW_M * np.array([[0.0, 0.5, 0.0], [0.0, 0.0, -1.0]])
    shown = np.stack([np.zeros((2, 3)), tips], axis=1)
    assert dashboard._command.points == pytest.approx(shown)
    for unknown in (None, (float("nan"),) * 6):
        dashboard.show(status(thrusts=[], twist_in_b=unknown), None)
        assert dashboard._command.points == pytest.approx(shown)
    dashboard.show(status(thrusts=[], twist_in_b=(0.0,) * 6), None)
    assert np.ptp(dashboard._command.points, axis=1).max() < 1e-3
    dashboard.stop()


def test_a_robot_without_news_is_grey(dashboard):
    body = dashboard._coloured[0][0]
    dashboard.show(status(), None)
    assert tuple(body.color) == scene.BODY
    dashboard.show(None, None)
    assert tuple(body.color) == scene.STALE
    assert not dashboard._command.visible
    dashboard.show(status(), None)
    assert tuple(body.color) == scene.BODY


def test_a_portrait_picture_makes_a_portrait_frustum(dashboard):
    dashboard.show(status(), np.zeros((320, 180, 3), np.uint8))
    assert dashboard._phone.aspect == dashboard._virtual.aspect == 180 / 320


def test_thrusts_of_another_robot_are_not_drawn(dashboard):
    dashboard.show(status(), None)
    before = dashboard._command.points
    dashboard.show(status(thrusts=[1.0, 2.0]), None)
    dashboard.show(status(thrusts=[float("nan")] * 8), None)
    assert np.array_equal(dashboard._command.points, before)


def test_an_update_is_cheap(dashboard):
    """4 ms of CPU at 30 Hz are 12 % of a core."""
    statuses = [status(t=k / 30.0, p_bc_in_c=(2.5, 0.001 * k, 0.0)) for k in range(60)]
    start = time.thread_time()
    for moving in statuses:
        dashboard.show(moving, None)
    assert (time.thread_time() - start) / len(statuses) < 0.004


def test_nobody_looking_costs_nothing_and_the_thread_ends(dashboard, tmp_path, capfd):
    idle = Dashboard(AMES.robot, AMES.plant, AMES.start, tmp_path / "view.sock")
    asked = []
    idle.start(lambda: (asked.append(1), None))
    idle.stop()
    assert not asked
    assert not idle._thread.is_alive()
    assert capfd.readouterr().out == ""


def test_no_public_tunnel_is_opened(dashboard):
    assert dashboard._viser.request_share_url() is None
    assert dashboard._viser._share_tunnel is None
