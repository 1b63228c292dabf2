"""Recordings to export: the virtual phone's on a known day, and small ones of other codecs."""

import json
from itertools import count
from pathlib import Path

import cv2
import numpy as np

from hardware.codec import Encoder
from hardware.robot_file import ROBOTS
from server.protocol.wire import encode
from server.protocol.wire_records import Codec, Motion, Picture, Record, Touch
from server.recording.folder import RecordingFolder
from server.recording.reader import read
from server.recording.writer import (
    EPISODES,
    ROBOT_KEY,
    STATUS,
    UNIX_ZERO_KEY,
    Recorder,
    finish_file,
    start_file,
)

DATA = Path(__file__).parents[2] / "data"
FLIGHT, CHROMIUM = DATA / "virtual_phone.mcap", DATA / "chromium.mcap"
ZERO_NS = 1_790_000_000_123_456_789
"""2026-09-21."""
SIZE = 320, 240
TWIST_IN_B = (0.03, 0.0, -0.04, 0.0, 0.0, 0.5)


def on_a_known_day(folder, source=FLIGHT, change=lambda entry: entry.data, notes=(), **metadata):
    """The same items, or changed ones, in a file that knows the calendar.

    `notes` are further ones, of episodes: (t [s], bytes) each.
    """
    recording = read(source)
    path = folder / source.name
    with path.open("wb") as file:
        known = recording.metadata | {UNIX_ZERO_KEY: str(ZERO_NS)} | metadata
        writer, channels = start_file(file, known)
        for entry in recording.entries():
            ns = round(1e9 * entry.t)
            writer.add_message(channels[entry.topic], ns, change(entry), ns)
        for t, data in notes:
            writer.add_message(channels[EPISODES], round(1e9 * t), data, round(1e9 * t))
        finish_file(writer, file)
    return path


def told_a_twist(folder, openings=None):
    """The same flight, as if its robot took a twist: it is told this one, and measures it.

    With an iterator of `openings` it has a tool that is told one at each status.
    """

    def change(entry):
        if entry.topic != STATUS:
            return entry.data
        status = json.loads(entry.data)
        measured = [[t, *TWIST_IN_B] for t, *_ in status["body_samples"]]
        status |= {"thrusts": [], "twist_in_b": TWIST_IN_B, "body_twists": measured}
        if openings is not None:
            status["tool_opening"] = next(openings)
        return json.dumps(status).encode()

    twister = (ROBOTS / "twister.toml").read_text()
    twister += "" if openings is None else '\n[tool]\nname = "Gripper"\n'
    return on_a_known_day(folder, change=change, **{ROBOT_KEY: twister})


def with_a_battery(folder):
    """The same flight, as if its robot told of its battery in the second half of it."""
    counts = count()

    def change(entry):
        if entry.topic != STATUS:
            return entry.data
        status = json.loads(entry.data)
        if next(counts) >= 137:
            status["health"] = ["low", 10.25, "The robot's battery is low.", "released", ""]
        return json.dumps(status).encode()

    return on_a_known_day(folder, change=change)


def spot(k):
    """(height, width) grey with a bright disc that goes from left to right."""
    luma = np.full(SIZE[::-1], 40, dtype=np.uint8)
    cv2.circle(luma, (40 + 10 * k, 120), 12, 230, -1)
    return luma


def spot_at(luma):
    """Where the disc is from the left [px]."""
    return float(np.argwhere(luma > 150)[:, 1].mean())


def film(folder, codec, pictures=6, touches=()):
    """A phone without pings: its quickest record took no time."""
    encoder = Encoder(*SIZE, 30.0, 1_000_000, codec)
    recorder = Recorder(RecordingFolder(folder), codec, {"device": "a stranger's phone"})
    at_rest = Motion((0.1, 0.2, 0.3), (0.0, 9.8, 0.0), None, 0)
    for k in range(pictures):
        t = 100.0 + k / 30.0
        data, key = encoder.encode(spot(k))
        picture = Picture(Codec[codec.upper()], key, *SIZE, 0, data)
        recorder.record("phone", encode(Record(k, round(1e6 * (t + 500.0)), at_rest)), t)
        recorder.record("phone", encode(Record(k, round(1e6 * (t + 499.99)), picture)), t)
    for k, (t, held, press) in enumerate(touches):
        touch = Touch(held, True, press, 0)
        recorder.record("phone", encode(Record(k, round(1e6 * (t + 500.0)), touch)), t)
    recorder.close()
    return recorder.path
