"""The gravity test at the server: a faulty phone's own bytes, pictures included, are refused."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hardware.camera_file import CAMERAS, find_camera
from hardware.codec import Encoder
from hardware.sim.hand import MovingHand, make_hand
from hardware.sim.hand_parts import Waves
from hardware.sim.phone import EventKind, PhoneOptions, VirtualPhone
from hardware.sim.phone_faults import SensorFault
from hardware.sim.render import RenderOptions
from pipeline.estimation import sensor_validation
from pipeline.estimation.attitude import Attitude
from pipeline.frames import R_cd, R_from_wxyz, exp, log, wxyz_from_R
from pipeline.signals import PhoneImu
from server.control.ipc_inputs import encode as wire_of
from server.phone.phone_session import PhoneSession
from server.protocol.messages import Hello
from server.protocol.wire import VERSION, decode, encode
from server.protocol.wire_records import Motion, Ping
from server.recording.reader import read
from server.replay.dates import timed
from server.virtual_phone.phone_script import DEVICE, PhoneScript, VirtualOperator
from tests.server.house import ROBOT, control_status

FLIGHT = Path(__file__).parents[2] / "data" / "virtual_phone.mcap"
SIZE = (1280, 720)
DEADLINE_S = 5.0
MOTION, PICTURE = EventKind.MOTION, EventKind.PICTURE


def tilted(pitch_deg):
    """A hand that looks down so far, from above, and keeps still."""
    pitch = np.deg2rad(pitch_deg)
    p_start_in_f = np.array([-2.5, 0.0, 2.5 * np.tan(pitch)])
    return MovingHand((), p_start_in_f, np.array([0.0, pitch, 0.0]), 0.0)


def waving():
    """Turns as someone does who looks around."""
    degrees = np.array([[0.0, 0.0, 0.0, 10.0, 6.0, 6.0]])
    waves = Waves(np.deg2rad(degrees), np.array([[1.0, 1.0, 1.0, 3.0, 4.0, 5.0]]), np.zeros((1, 6)))
    return MovingHand((waves,), np.array([-2.5, 0.0, 0.0]), np.zeros(3), 0.0)


class Rig:
    """A virtual phone whose bytes reach an `PhoneSession` in virtual time."""

    def __init__(self, fault=SensorFault.NONE, hand=None):
        self.t, self.heard = 0.0, []
        options = PhoneOptions(fault=fault, frame_rate_hz=10.0)
        camera = find_camera(DEVICE, *SIZE)
        hand = hand or make_hand("steady")
        rng = np.random.default_rng(1)
        phone = VirtualPhone(camera, hand, ROBOT.leds_in_b, RenderOptions(), rng, options)
        encoder = Encoder(*SIZE, 10.0, 1_000_000, "jpeg")
        self.script = PhoneScript(phone, encoder, VirtualOperator())
        self.phone = PhoneSession(
            Hello(VERSION, "operator", DEVICE),
            ROBOT,
            [CAMERAS],
            self.heard.append,
            lambda: self.t,
            lambda sequence: None,
            lambda: None,
        )

    def run(self, seconds, pictures=True):
        """All that arrives within, each picture looked at before the next thing."""
        for tick in range(round(seconds * 50)):
            before, self.t = self.t, self.t + 0.02
            self.phone.add_status(self.robot_says())
            if tick % 3 == 0:
                self.pong()
            for event in self.script.phone.events(before, self.t):
                if event.kind is MOTION:
                    self.take(self.script.motion(event.t_capture))
                elif pictures and event.t_capture > 0.0:
                    self.look(event.t_capture)
        return self.phone.refusals(self.t)

    def robot_says(self):
        samples = [(self.t - 0.005 * k, *[0.0] * 5, 9.81) for k in range(4)][::-1]
        return control_status(t=self.t, body_samples=samples)

    def pong(self):
        ping = self.phone.ingest.ping(self.t)
        assert isinstance(ping.body, Ping)
        self.take(self.script.pong(ping.body.nonce, ping.t_us, self.t))

    def look(self, t):
        before = self.phone.detection
        self.take(self.script.picture(t, lambda _: (np.eye(3), np.zeros(3))))
        end = time.monotonic() + DEADLINE_S
        while self.phone.vision is not None and self.phone.detection is before:
            assert time.monotonic() < end, "the picture was never looked at"
            time.sleep(0.001)

    def take(self, record):
        self.phone.take(decode(encode(record)), self.t)


@pytest.fixture
def rig():
    made = []

    def make(*arguments):
        made.append(Rig(*arguments))
        return made[-1]

    yield make
    for one in made:
        one.phone.close()


def test_a_good_phone_may_arm_as_soon_as_the_robot_was_seen(rig):
    assert rig().run(2.2) == []


def test_the_sign_of_ios_is_refused_and_named(rig):
    assert rig(SensorFault.IOS_SIGN, tilted(12.0)).run(2.6) == [sensor_validation.SIGN]


def test_a_level_phone_with_that_sign_is_refused_too(rig):
    assert rig(SensorFault.IOS_SIGN, make_hand("still")).run(2.6) == [
        sensor_validation.SIGN_OR_TURN
    ]


def test_a_wrong_screen_angle_is_refused_and_named(rig):
    (why,) = rig(SensorFault.SCREEN_ANGLE).run(2.6)
    assert "told as 0°, it is 90°" in why


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (SensorFault.NO_GRAVITY, sensor_validation.NO_GRAVITY),
        (SensorFault.G_UNITS, sensor_validation.G_UNITS),
    ],
)
def test_an_acceleration_that_is_none_is_refused_and_named(rig, fault, words):
    assert words in rig(fault).run(2.0, pictures=False)


def test_mixed_up_rates_are_refused_and_named_once_the_hand_has_turned(rig):
    (why,) = rig(SensorFault.RATE_ORDER, waving()).run(4.5)
    assert why == sensor_validation.RATES.format(words="+y, +z, +x")


def test_a_good_phone_that_turns_alike_may_arm(rig):
    assert rig(SensorFault.NONE, waving()).run(4.5) == []


def test_a_jump_of_the_magnetometer_moves_nothing():
    """The browser's attitude jumps by 90° halfway through the recording: not one bit changes."""

    def told(jump):
        rig = Rig()
        for _ in range(6):
            rig.pong()
            rig.t += 0.02
        attitude, heard = Attitude(), []
        motions = [r.record for r in timed(read(FLIGHT)) if isinstance(r.record.body, Motion)]
        for k, record in enumerate(motions[:200]):
            rig.t = 1.0 + k / 60.0
            body: Any = record.body
            if k >= 100:
                turned = exp(np.array([0.0, 0.0, jump])) @ R_from_wxyz(body.orientation_wxyz)
                body = replace(body, orientation_wxyz=wxyz_from_R(turned) if jump else None)
            t_us = round(1e6 * rig.script.phone.clock.at(rig.t))
            rig.phone.take(decode(encode(replace(record, t_us=t_us, body=body))), rig.t)
            attitude.add(rig.heard[-1])
            heard.append(attitude.R_fc)
        assert all(isinstance(one, PhoneImu) for one in rig.heard)
        return np.array(heard), [replace(one, phone=0) for one in rig.heard]

    smooth, samples = told(0.0)
    jumped, same_samples = told(0.5 * np.pi)
    for one, same in zip(samples, same_samples, strict=True):
        assert wire_of(one) == wire_of(same)
    np.testing.assert_array_equal(jumped, smooth)
    steps = [np.linalg.norm(log(a.T @ b)) for a, b in pairwise(smooth)]
    assert max(steps) < np.deg2rad(1.0)
    assert smooth[-1][2] @ R_cd(90)[:, 0] > 0.9
