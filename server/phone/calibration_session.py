"""The calibration that a phone's page asks for: film with guidance, solve beside, keep the profile.

Films in a thread, solves in a process; the event loop only asks how it stands.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hardware.camera_file import CameraFileError
from hardware.codec import Decoder
from pipeline.signals import PhoneImu
from server.calibration.board import Board, Detector
from server.calibration.camera_yaml import profile_path, store
from server.calibration.guide import Guide
from server.calibration.job import CalibrationJob, CalibrationOutcome, Solving
from server.calibration.verdict import Verdict
from server.calibration.views import look
from server.common.clock import today
from server.media.decoding import MakeDecoder
from server.phone.decoder import FrameDecoder
from server.phone.frame_worker import FrameThread
from server.phone.ingest import EncodedFrame
from server.protocol.calibration_messages import Calibration

MOST_SAMPLES = 20_000
"""Of motion: more than a minute at 200 Hz."""
SHOWN_PER_CELL = 3  # views, by the page's shades of grey
FAILED = Verdict("refused", ["The calibration failed: look at the server's log."])


def unreadable(error: CameraFileError) -> Verdict:
    """The verdict on a calibration whose own file could not be read again."""
    reason = f"What was found is no camera: {error.key}: {error.allowed}."
    return Verdict("refused", [reason], ["Film again, with larger and quicker turns."])


def unkept(error: OSError) -> Verdict:
    """The verdict on a calibration that the disk did not take."""
    reason = f"What was found can't be kept: {error.strerror}."
    return Verdict("refused", [reason], ["Make room on the server's disk, then film again."])


class CalibrationSession(FrameThread):
    """One calibration of one phone at one picture size and orientation."""

    def __init__(
        self,
        device: str,
        shape: tuple[int, int, int],
        folder: Path,
        on_taken: Callable[[int], None],
        on_key_wanted: Callable[[], None],
        make: MakeDecoder = Decoder,
    ) -> None:
        """Begins to film pictures of `shape`: width, height [px], angle of the screen [°].

        The profile goes to `folder`. Callbacks run in the thread. `make` is `FrameDecoder`'s.
        """
        super().__init__("calibration", on_taken)
        size, self.screen_angle_deg = shape[:2], shape[2]
        self.size = size
        self._device, self._folder, self._on_key_wanted = device, folder, on_key_wanted
        self._board = Board()
        self._detector = Detector(self._board)
        self._decoder = FrameDecoder(*size, make)
        self._guide = Guide(self._board, size)
        self._shown = self._filming("filming")
        self._motion: deque[tuple[float, float, float, float]] = deque(maxlen=MOST_SAMPLES)
        self._solving: Solving | None = None
        self.stored: Path | None = None
        """Where the profile is, once it is."""
        self.start()

    @property
    def undecodable(self) -> int:
        """Pictures that were garbage or needed a lost one."""
        return self._decoder.undecodable

    def add_imu(self, sample: PhoneImu) -> None:
        """The phone's motion."""
        x, y, z = map(float, sample.omega_m_cf_in_c)
        self._motion.append((sample.t, x, y, z))

    def state(self) -> Calibration:
        """How it stands, for the page; stores the profile when it is there."""
        solving = self._solving
        if self.failed and self._shown.phase == "filming":
            self._shown = self._finished(CalibrationOutcome(FAILED, "", []))
        if solving is not None and self._shown.phase == "solving" and solving.done:
            self._shown = self._finished(solving.outcome() or CalibrationOutcome(FAILED, "", []))
        return self._shown

    def _look(self, frames: list[EncodedFrame], has_gap: bool) -> None:
        if self._solving is not None:
            return
        if has_gap:
            self._decoder.needs_key = True
        luma = None
        for frame in frames:  # each: neighbours in time tell how fast the camera turned
            luma = self._decoder.decoded(frame)
            if luma is not None:
                self._guide.add(frame.t, look(luma, frame.t, self._board, self._detector))
        if luma is None:
            self._call_if_running(self._on_key_wanted)
            return
        if self._guide.enough:
            self._shown = self._filming("solving")
            self._solve(Solving(self._job()))
        else:
            self._shown = self._filming("filming")

    def _solve(self, solving: Solving) -> None:
        """Solve, in the thread; who was stopped meanwhile solves nothing."""
        self._call_if_running(lambda: setattr(self, "_solving", solving))
        if self._solving is not solving:
            solving.stop()

    def _job(self) -> CalibrationJob:
        guide = self._guide
        views = sorted({view.t: view for view in guide.views}.values(), key=lambda view: view.t)
        motion = np.array(self._motion).reshape(-1, 4)
        return CalibrationJob(
            self._board,
            self.size,
            views,
            guide.pictures,
            motion,
            self._device,
            self.screen_angle_deg,
            today(),
        )

    def _filming(self, phase: str) -> Calibration:
        guide, now = self._guide, self._guide.progress
        is_filming = phase == "filming"
        return Calibration(
            phase="filming" if is_filming else "solving",
            hint=guide.hint
            if is_filming
            else "Enough filmed. Put the phone down: computing takes half a minute.",
            progress=round(now.share, 3),
            tasks={
                "Whole picture": round(now.covered, 3),
                "Tilted": round(now.tilted, 3),
                "Near and far": round(now.near_and_far, 3),
                "Turned": round(now.turned, 3),
            },
            width=self.size[0],
            height=self.size[1],
            columns=guide.cells.shape[1],
            cells=np.minimum(guide.cells, SHOWN_PER_CELL).ravel().tolist(),
            outline=guide.outline() if is_filming else [],
            blurred=is_filming and guide.blurred,
        )

    def stop(self) -> None:
        """End it, whatever is under way."""
        super().stop()
        if self._solving is not None:
            self._solving.stop()

    def _finished(self, outcome: CalibrationOutcome) -> Calibration:
        verdict, done = outcome.verdict, outcome.text != ""
        if done:
            angle = self.screen_angle_deg
            path = profile_path(self._folder, self._device, self.size, angle)
            try:
                store(path, outcome.text)
                self.stored = path
            except CameraFileError as error:
                verdict, done = unreadable(error), False
            except OSError as error:
                verdict, done = unkept(error), False
        return Calibration(
            phase="done" if done else "refused",
            hint="Calibrated." if done else "Not good enough yet.",
            progress=1.0,
            verdict=verdict.level,
            figures=outcome.figures,
            reasons=verdict.reasons,
            advice=verdict.advice,
        )
