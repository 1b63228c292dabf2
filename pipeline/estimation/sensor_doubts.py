"""What of motion sensors and LEDs is believed less than configured, in words.

The filter has allowed for it; who leads the robot should know, for its place is known less exactly.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.frames import Array

ROBOTS: Final = ("The robot's gyroscope", "The robot's accelerometer")
PHONES: Final = ("The phone's gyroscope", "The phone's accelerometer")
SENSORS: Final = (*ROBOTS, *PHONES)
"""In the order of the filter's biases."""
KINDS: Final = ("A gyroscope", "An accelerometer")
VIBRATES: Final = "{sensor} feels a vibration, as of a propeller or a motor."
EITHER, THE_PHONE = "the robot or the phone", "the phone"
"""Whose a sensor is: of a robot without motion sensors, the phone's alone."""
SWAYS: Final = (
    "{kind} of {whose} sways where pictures don't: does something vibrate at about its sample rate?"
)
STEPPED: Final = "{kind} of {whose} seems to have another bias{or_else}."
OR_ELSE: Final = ", or the robot moves otherwise than it says"
ALIASED: Final = (
    "{sensor} sways where pictures don't: something shakes it at about a multiple of its sample"
    " rate."
)
MEND_TONE: Final = (
    " Balance the propellers, or let it filter below half of the rate at which it is read, or read"
    " it at another one."
)
SAID_S: Final = 3.0
"""What happens at once is said for so long."""
LEARNS_S: Final = 5.0
"""In which biases that are as at the start move, too."""
NOISY: Final = 4.0
"""Times the configured noise of a sample. Of the robot's alone: at 60 Hz a hand is as rough."""
INEXACT: Final = 4.0
"""Times the variance that a picture tells of its LEDs: by chance it is 1.5 now and then."""
MISDATED_S: Final = 0.003
"""Standard deviation of one picture's date [s]: by chance it is 1 ms now and then."""


def sensor_doubts(
    t: float,
    t_start: float,
    t_clipped: Array,
    t_vibrating: Array,
    t_swaying: Array,
    t_aliased: Array,
    t_stepped: Array,
    noise: Array,
    spot_noise: float,
    date_noise_s: float,
    *,
    of_body: bool = True,
) -> tuple[str, ...]:
    """Sentences, one for each doubt at `t` [s].

    Args:
        t: Now.
        t_start: When the filter began to learn.
        t_clipped: When each sensor last said as much as it can (4,) [s].
        t_vibrating: When it last had a tone (4,) [s].
        t_swaying: When pictures were last off by one in turn and in place (2,) [s].
        t_aliased: When each of the robot's was last sure to sway by a vibration (2,) [s].
        t_stepped: When its bias last stepped (4,) [s].
        noise: Of the robot's samples, by the configured (2,).
        spot_noise: Factor of the variances of LEDs' rays.
        date_noise_s: Standard deviation of one picture's date [s].
        of_body: The robot has motion sensors on its body.
    """
    whose, or_else = (EITHER, "") if of_body else (THE_PHONE, OR_ELSE)

    def since(t_last: Array) -> list[int]:
        return np.flatnonzero(t - t_last < SAID_S).tolist()

    clipped = [f"{SENSORS[k]} is moved beyond the end of its range." for k in since(t_clipped)]
    # what is cut off has overtones, too
    shaken = [k for k in since(t_vibrating) if t_vibrating[k] - t_clipped[k] > SAID_S]
    vibrating = [VIBRATES.format(sensor=SENSORS[k]) for k in shaken]
    aliased = aliased_tones(t, t_aliased)
    swaying = [SWAYS.format(kind=KINDS[k], whose=whose) for k in since(t_swaying)]
    jumped = since(t_stepped) if t - t_start > LEARNS_S else ()
    kinds = sorted({k % 2 for k in jumped})  # which of the two can hardly be told
    stepped = [STEPPED.format(kind=KINDS[k], whose=whose, or_else=or_else) for k in kinds]
    noisy = [
        f"{sensor} is much noisier than usual."
        for sensor, ratio in zip(ROBOTS, noise, strict=True)
        if ratio > NOISY
    ]
    inexact = ["LEDs are seen much less exactly than usual."] if spot_noise > INEXACT else []
    misdated = ["Pictures are dated less exactly than usual."] if date_noise_s > MISDATED_S else []
    return (*clipped, *vibrating, *aliased, *swaying, *stepped, *noisy, *inexact, *misdated)


def aliased_tones(t: float, t_aliased: Array) -> tuple[str, ...]:
    """Sentences, one for each of the robot's sensors that swayed lately (2,) [s]."""
    swaying = zip(ROBOTS, (t - t_aliased).tolist(), strict=True)
    return tuple(ALIASED.format(sensor=sensor) for sensor, since in swaying if since < SAID_S)
