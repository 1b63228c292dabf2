"""What the measurements themselves tell of broken sensors, whatever a filter makes of them."""

from __future__ import annotations

from pipeline.estimation.accelerometer_check import AccelerometerCheck
from pipeline.estimation.frozen_imu import FrozenImu
from pipeline.estimation.repeated_picture import RepeatedPicture
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement


class SensorMonitor:
    """Of phone and robot, in words for people; feed it every measurement."""

    def __init__(self, *, of_body: bool = True) -> None:
        """Nothing measured; `of_body`: the robot has motion sensors on its body."""
        self._has_body = of_body
        self._frozen_imu = FrozenImu()
        self._of_phone, self._of_body = AccelerometerCheck(), AccelerometerCheck()
        self._repeated = RepeatedPicture()

    def forget_phone(self) -> None:
        """Another phone measures from now on."""
        self._of_phone, self._repeated = AccelerometerCheck(), RepeatedPicture()

    def add_phone_imu(self, sample: PhoneImu) -> None:
        """Take a sample of the phone."""
        self._repeated.add_imu(sample)
        self._of_phone.add(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)

    def add_body_imu(self, sample: BodyImu) -> None:
        """Take a sample of the robot."""
        self._repeated.add_imu(sample)
        if not self._has_body:
            return
        self._of_body.add(sample.t, sample.omega_m_bf_in_b, sample.a_m_bf_in_b)
        self._frozen_imu.add(sample)

    def comes_again(self, seen: VisionMeasurement) -> bool:
        """Whether a picture is the one before under a new time."""
        return self._repeated.comes_again(seen)

    @property
    def frozen(self) -> str:
        """Words if the robot's IMU is: no fault at rest, where a noiseless one repeats itself."""
        return "The robot's motion sensors stand still." if self._frozen_imu.is_frozen else ""

    @property
    def jumped(self) -> str:
        """Whose accelerometer lies, in words; empty if none."""
        if self._of_body.has_jumped:
            return "The robot's accelerometer jumps: it feels gravity elsewhere than before."
        if self._of_phone.has_jumped:
            return "The phone falls or is shaken, or its accelerometer jumps."
        return ""
