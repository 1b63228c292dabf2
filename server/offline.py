"""A recorded phone's stream through ingest, vision and control, in virtual time: the same bytes each time.

The robot does not follow: its recorded motion samples are used, and what is compared are the
estimates. The CSV has one row per picture:

| column | what |
|---|---|
| t_s | arrival of the picture, since the recording's first item |
| capture_s | its capture time, likewise |
| sequence | its number, as the phone counted |
| found, leds, reprojection_px | was the robot found, on how many LEDs, RMS residual |
| x_m, y_m, z_m, qw, qx, qy, qz, sigma_m | pose of the body in camera axes as measured in it |
| fused_x_m … fused_qz, fused_sigma_m | the filter's estimate at the next control period |
| mode | of the failsafe machine, with the recorded button and wishes |
"""

from __future__ import annotations

import csv
import itertools
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hardware.camera_file import find_camera
from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from pipeline.frames import Array, wxyz_from_R
from pipeline.signals import BodyImu, Operator, PhoneImu, RelativePose
from pipeline.teleop import Output
from server.control_link import Input, OperatorInput, PhoneImuInput, PoseInput, ReadyInput, RequestInput
from server.controller import Controller
from server.ingest import EncodedFrame, Ingest
from server.messages import Command, decode_message
from server.recording import PHONE_MESSAGES, PHONE_RECORDS, SERVER_RECORDS, STATUS, ROBOT_FILE
from server.recording_files import Entry, Recording
from server.sight import Sight
from server.wire import Ping, WireError, decode

PERIOD_S = 0.005
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "sigma_m")
COLUMNS = (
    "t_s", "capture_s", "sequence", "found", "leds", "reprojection_px",
    *POSE, *(f"fused_{name}" for name in POSE), "mode",
)  # fmt: skip
