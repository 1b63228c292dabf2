"""Start and stop recordings of what the session manager receives."""

from __future__ import annotations

from math import inf
from pathlib import Path

from pipeline.signals import TouchState
from server.common import clock
from server.control.ipc import ControlStatus
from server.protocol.messages import EpisodeStatus
from server.protocol.wire import HEADER, KEY_FLAG, Kind
from server.recording.episodes import LARGEST_PRESS, TaskNote, VerdictNote
from server.recording.folder import DiskLimits, RecordingFolder
from server.recording.writer import CAMERA_KEY, DEVICE_KEY, Direction, Recorder

KEY_S = 0.5
"""Between two requests for a key: one may be lost on the way."""


class Recordings:
    """At most one recording at a time."""

    def __init__(
        self, directory: Path, metadata: dict[str, str], limits: DiskLimits | None = None
    ) -> None:
        """Files go to `directory`, within `limits`; `metadata` goes into each."""
        self.folder, self._metadata = RecordingFolder(directory, limits), metadata
        self._recorder: Recorder | None = None
        self._has_key, self._t_asked = True, -inf
        self._knows_camera = True
        self.failure = ""
        """Why the last recording ended by itself, or ""."""
        self.task = ""
        """What the next presses are for, also in later recordings; "" is nothing in particular."""
        self._discarded: set[int] = set()
        self._t_started = inf

    @property
    def name(self) -> str:
        """Name of the running recording, or ""."""
        return self._recorder.name if self._recorder is not None else ""

    def start(self, device: str = "", camera_text: str = "") -> str:
        """Begin, unless one is running; gives its name.

        Raises:
            RecordingError: the file can't be made.
        """
        if self._recorder is None:
            name = clock.file_stamp()
            own = {DEVICE_KEY: device, CAMERA_KEY: camera_text}
            self._recorder = Recorder(self.folder, name, {**self._metadata, **own})
            self.failure = ""
            self._has_key, self._t_asked = False, -inf
            self._knows_camera = bool(camera_text)
            self._discarded.clear()
            self._t_started = clock.now()
            if self.task:
                self.say_task(self.task, self._t_started)
        return self.name

    def say_task(self, text: str, t: float) -> None:
        """What presses after `t` [s] are for."""
        self.task = text
        if self._recorder is not None:
            self._recorder.note(TaskNote(text), t)

    def judge(self, pressed: TouchState, keep: bool, t: float) -> None:
        """Whether somebody should learn from the episode of a finger that held, in this recording.

        A `TouchState` tells presses of one phone from another's, a recording by their order.
        """
        if self._recorder is not None:
            (self._discarded.discard if keep else self._discarded.add)(pressed.press)
            self._recorder.note(VerdictNote(pressed.press & LARGEST_PRESS, keep), t)

    def episode(self, pressed: TouchState | None) -> EpisodeStatus | None:
        """The episode of the newest finger that held; None if that was before the recording."""
        if self._recorder is None or pressed is None or pressed.t < self._t_started:
            return None
        keep = pressed.press not in self._discarded
        return EpisodeStatus(pressed.press & LARGEST_PRESS, keep)

    def learn(self, device: str, camera_text: str) -> None:
        """The phone and its camera, if the recording began before there was one.

        Of several, the first: a replay knows the others by their files, as it does without any.
        """
        if self._recorder is not None and camera_text and not self._knows_camera:
            self._knows_camera = True
            self._recorder.learn({DEVICE_KEY: device, CAMERA_KEY: camera_text})

    def detach(self) -> Recorder | None:
        """The running recording, which is ours no more and is to be closed; None without one."""
        recorder, self._recorder = self._recorder, None
        self._has_key = True
        return recorder

    def stop(self) -> str:
        """End, and wait for the disk; gives the path of the file, or ""."""
        recorder = self.detach()
        if recorder is None:
            return ""
        recorder.close()
        return str(recorder.path)

    def end_if_failed(self) -> bool:
        """Whether a recording had ended by itself, see `failure`; it is put away."""
        if self._recorder is None or not self._recorder.has_failed:
            return False
        self.failure = self._recorder.error
        self.stop()
        return True

    def why_not(self) -> str:
        """Why nothing could be recorded now, or ""."""
        stuck = self._recorder.stuck if self._recorder is not None else ""
        return self.failure or stuck or self.folder.full()

    def key_is_due(self, now: float) -> bool:
        """Whether to ask the page for a key: without one no recorded picture can be decoded."""
        if self._has_key or now - self._t_asked < KEY_S:
            return False
        self._t_asked = now
        return True

    def record(self, direction: Direction, data: bytes, t: float) -> None:
        """A record that came or went."""
        if self._recorder is not None:
            self._recorder.record(direction, data, t)
            self._has_key = self._has_key or _is_key(data)

    def message(self, direction: Direction, text: str, t: float) -> None:
        """A message that came or went."""
        if self._recorder is not None:
            self._recorder.message(direction, text, t)

    def status(self, status: ControlStatus, t: float) -> None:
        """A status of the control process."""
        if self._recorder is not None:
            self._recorder.status(status, t)


def _is_key(data: bytes) -> bool:
    """Whether a record is a picture that can be decoded alone."""
    return len(data) > HEADER.size and data[2] == Kind.FRAME and bool(data[3] & KEY_FLAG)
