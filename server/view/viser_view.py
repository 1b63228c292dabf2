"""The 3D view: control's status → viser. Nothing but this file knows viser.

It only shows. It has no button, opens no tunnel, and listens at a unix socket: a port of the
loopback interface would be open to every page in a browser of this machine, for viser asks for no
Origin. Browsers reach it through `server.view.viser_proxy` alone.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import rich
import viser

from hardware.plant_parameters import PlantParameters, StartParameters
from pipeline.frames import Array
from pipeline.robot import Robot
from server.control.ipc import ControlStatus
from server.view import scene
from server.view.private_listening import listening_at
from server.view.scene import BODY, CABLE, COMMAND, LED, PHONE, STALE, STEADY, TRAIL, TURN, Colour

Thumbnail = npt.NDArray[np.uint8]
Latest = Callable[[], tuple[ControlStatus | None, Thumbnail | None]]

PERIOD_S = 1.0 / 30.0
STOP_S = 2.0
_log = logging.getLogger(__name__)


class _Viser(viser.ViserServer):
    """viser without its public tunnel, which any client may ask for."""

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002 (viser's name)
        """Never."""
        return None


def start_viser(path: Path) -> _Viser:
    """A viser that listens at the unix socket `path` alone.

    Raises:
        RuntimeError: it listens elsewhere; this viser is not the one that was locked.
    """
    path.unlink(missing_ok=True)
    with listening_at(path):
        started = _Viser(host="127.0.0.1", port=0, label="Lightleash", verbose=False)
    if not path.is_socket():
        started.stop()
        raise RuntimeError(f"viser {viser.__version__} does not listen at {path}")
    path.chmod(0o600)
    return started


class Dashboard:
    """A scene that follows the status of control, for any number of browsers."""

    def __init__(
        self, robot: Robot, plant: PlantParameters, start: StartParameters, path: Path
    ) -> None:
        """Serve an empty scene at the unix socket `path`.

        `plant` gives the robot its looks: thrusters, cable, feet. How far below the phone the
        floor is nobody knows: a robot that stands is taken to do so where it would `start`.
        """
        rich.get_console().quiet = True  # only viser speaks through it
        craft = scene.Craft.of(robot, plant)
        self._path, self._viser = path, start_viser(path)
        self._trail = scene.Trail()
        self._heading = scene.Heading()
        self._craft, self._is_fresh = craft, False
        self._at_rest = scene.at_rest(start)
        self._thumbnail: Thumbnail | None = None
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._dress(scene.floor_z(plant, start))
        self._add_phone()
        self._add_robot(craft)
        self._add_lines(craft.cable)
        self._add_reference(craft)

    def start(self, latest: Latest) -> None:
        """Show what `latest()` says at 30 Hz, from a thread, while somebody looks."""
        self._thread = threading.Thread(
            target=self._run, args=(latest,), name="dashboard", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop thread and server."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(STOP_S)
        self._viser.stop()
        self._path.unlink(missing_ok=True)  # asyncio does so since Python 3.13 only

    def _run(self, latest: Latest) -> None:
        shown: ControlStatus | None = None
        try:
            while not self._stopping.wait(PERIOD_S):
                if not self._viser.get_clients():
                    continue
                status, thumbnail = latest()
                if status is None or status is not shown:
                    self.show(status, thumbnail)
                shown = status
        except Exception:  # noqa: BLE001 (a view that fails is a flight without one)
            _log.exception("the 3D view has stopped; control and recording go on")

    def show(self, status: ControlStatus | None, thumbnail: Thumbnail | None) -> None:
        """Move everything to where `status` says; grey when it is None.

        Without a pose there is no robot; before there is a phone, a grey one at rest.
        `thumbnail` is (h, w, 3) RGB; the same array again costs nothing.
        """
        with self._viser.atomic():
            if status is None:
                self._colour(is_fresh=False)
                return
            view = scene.view(status)
            self._turn(status, view)
            _place(self._phone, view.phone)
            _place(self._virtual, view.virtual_camera)
            robot = self._at_rest if view.phone is None else view.robot
            _place(self._robot, robot)
            _place(self._reference, view.reference)
            self._colour(view.is_fresh)
            self._show_picture(thumbnail)
            self._show_lines(status, robot)

    def _turn(self, status: ControlStatus, view: scene.ViewState) -> None:
        yaw = self._heading.new_yaw(status.epoch, view)
        if yaw is not None:
            self._f.wxyz = scene.yaw_wxyz(-yaw)
            self._trail = scene.Trail()

    def _show_picture(self, thumbnail: Thumbnail | None) -> None:
        if thumbnail is None or thumbnail is self._thumbnail:
            return
        self._thumbnail = thumbnail
        aspect = thumbnail.shape[1] / thumbnail.shape[0]
        if aspect != self._phone.aspect:
            for frustum in (self._phone, self._virtual):
                frustum.aspect, frustum.fov = aspect, scene.fov_y(aspect)
        self._phone.image = thumbnail

    def _show_lines(self, status: ControlStatus, robot: scene.Pose | None) -> None:
        """Cable, trail and command."""
        lines = [node for node in (self._cable, self._trail_lines) if node is not None]
        for node in lines:
            if node.visible != (robot is not None):
                node.visible = robot is not None
        if robot is None:
            return
        if self._cable is not None:
            self._cable.position = robot.position
        if self._trail.add(status.t, robot.position):
            self._trail_lines.points = self._trail.segments()
        commanded = status.thrusts if self._craft.drive is None else status.twist_in_b or ()
        command = np.asarray(commanded, dtype=np.float64)
        if command.shape == self._craft.idle().shape and np.all(np.isfinite(command)):
            self._command.points = self._craft.arrows(command)

    def _colour(self, is_fresh: bool) -> None:
        """Grey a robot whose pose is old."""
        if is_fresh == self._is_fresh:
            return
        self._is_fresh = is_fresh
        for handle, colour in self._coloured:
            handle.color = colour if is_fresh else STALE
        self._command.visible = is_fresh

    def _dress(self, floor_z: float) -> None:
        """Dark, with a floor, and nothing but the scene."""
        self._viser.gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, control_width="small"
        )
        self._viser.gui.main_panel.minimize()
        self._viser.scene.configure_default_lights(cast_shadow=False)
        camera = self._viser.initial_camera
        camera.position, camera.look_at, camera.fov = (-1.1, -2.3, 0.85), (1.25, 0.0, 0.12), 0.78
        self._viser.scene.add_grid(
            "/floor",
            width=12.0,
            height=12.0,
            position=(1.25, 0.0, floor_z),
            cell_color=(54, 58, 66),
            section_color=(80, 86, 98),
            section_size=2.0,
            fade_distance=14.0,
        )
        self._f = self._viser.scene.add_frame("/f", show_axes=False)

    def _add_phone(self) -> None:
        """Where the phone looks (blue, with its picture) and what is followed (green)."""
        aspect = 16.0 / 9.0
        self._phone, self._virtual = (
            self._viser.scene.add_camera_frustum(
                f"/f/{name}",
                fov=scene.fov_y(aspect),
                aspect=aspect,
                scale=size,
                thickness=2.0,
                thickness_units="screen",
                color=colour,
                visible=False,
            )
            for name, size, colour in (("phone", 0.2, PHONE), ("virtual", 0.26, STEADY))
        )

    def _add_robot(self, craft: scene.Craft) -> None:
        viewer = self._viser.scene
        self._robot = viewer.add_frame("/f/robot", show_axes=False, visible=False)
        body = self._mesh("/f/robot/body", craft.airframe(), STALE)
        self._coloured: list[tuple[viser.MeshHandle | viser.IcosphereHandle, Colour]]
        self._coloured = [(body, BODY)]
        if discs := craft.rotors():
            rotors = self._mesh("/f/robot/rotors", scene.merged(discs), STALE)
            rotors.opacity = 0.35
            self._coloured.append((rotors, PHONE))
        for i, led in enumerate(craft.leds):
            ball = viewer.add_icosphere(f"/f/robot/led{i}", radius=0.026, color=STALE, position=led)
            self._coloured.append((ball, LED))
        self._command = viewer.add_arrows(
            "/f/robot/command",
            craft.arrows(craft.idle()),
            COMMAND if craft.drive is None else np.array([COMMAND, TURN], dtype=np.uint8),
            shaft_radius=0.009,
            head_radius=0.024,
            head_length=0.055,
            visible=False,
        )

    def _add_lines(self, cable: Array | None) -> None:
        self._cable: viser.LineSegmentsHandle | None = None
        if cable is not None:
            self._cable = self._viser.scene.add_line_segments(
                "/f/cable", cable, CABLE, thickness=2.0, thickness_units="screen", visible=False
            )
        self._trail_lines = self._viser.scene.add_line_segments(
            "/f/trail",
            np.zeros((scene.Trail.SEGMENTS, 2, 3)),
            scene.fade(TRAIL, scene.BACKGROUND, scene.Trail.SEGMENTS),
            thickness=3.0,
            thickness_units="screen",
            visible=False,
        )

    def _add_reference(self, craft: scene.Craft) -> None:
        """Where the body should be: its ghost."""
        viewer = self._viser.scene
        self._reference = viewer.add_frame("/f/reference", show_axes=False, visible=False)
        whole = scene.merged([craft.airframe(), *craft.rotors()])
        self._mesh("/f/reference/body", whole, STEADY).opacity = 0.25

    def _mesh(self, name: str, mesh: scene.Mesh, colour: Colour) -> viser.MeshHandle:
        return self._viser.scene.add_mesh_simple(
            name, *mesh, color=colour, flat_shading=True, side="double"
        )


def _place(node: viser.SceneNodeHandle, pose: scene.Pose | None) -> None:
    """Move a node, or hide it."""
    if node.visible != (pose is not None):
        node.visible = pose is not None
    if pose is not None:
        node.position = pose.position
        node.wxyz = np.asarray(pose.wxyz)
