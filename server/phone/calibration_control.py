"""Who may calibrate when, and what the operator's page is told of it."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.signals import AT_REST
from server.control.ipc import ControlStatus
from server.phone.phone_session import PhoneSession
from server.protocol.calibration_messages import Calibrate, Calibration
from server.protocol.messages import encode_message
from server.protocol.wire import WireError


class CalibrationControl:
    """Calibrations of one server; phones come and go."""

    def __init__(self, push: Callable[[str], object]) -> None:
        """`push` sends to the operator's page."""
        self._push = push
        self._phone = ""
        self._sent = Calibration("off")

    def request(
        self, phone: PhoneSession, message: Calibrate, control: ControlStatus | None
    ) -> None:
        """The phone begins to calibrate its camera, or leaves it.

        Raises:
            WireError: not now.
        """
        if message.what == "start" and not _is_calm(control):
            raise WireError("order", "calibrate.what", "while the robot is disarmed")
        phone.calibrate(message)

    def send(self, phone: PhoneSession | None, control: ControlStatus | None) -> None:
        """Send what is news; nobody calibrates while a robot is led."""
        if phone is None:
            return
        if phone.wizard is not None and not _is_calm(control):
            phone.calibrate(Calibrate("stop"))
        if phone.id != self._phone:
            self._phone, self._sent = phone.id, Calibration("off")
        message = phone.calibration()
        if message != self._sent:
            self._sent = message
            self._push(encode_message(message))


def _is_calm(control: ControlStatus | None) -> bool:
    return control is not None and control.mode in AT_REST
