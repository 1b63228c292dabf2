"""One film through several channels: what was found, and how exact, how sure, how fast."""

from __future__ import annotations

from collections import deque
from contextlib import closing
from dataclasses import dataclass, field, replace

from hardware.sim.scenes.scene import ImageOrientation, Scene, Size
from hardware.sim.scenes.video import RenderedFrame, RenderedVideo
from pipeline.signals import BodyImu, Frame, PhoneImu, RelativePose
from pipeline.vision.detection import Detection
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from server.common.clock import thread_cpu
from server.diagnostics.garbage import Garbage
from server.experiments.vision.channel import Channel, Wire
from server.experiments.vision.errors import Error, is_wrong, measured
from server.experiments.vision.plain import PlainTracker, pass_s

FRESH_EVERY = 10
"""Pictures followed for one that is also tried from nothing."""
FRESH_LOOKS = 3
"""Pictures that who starts from nothing may take."""
REMEMBERED_S = 1.0
"""Readings that who starts from nothing knows."""
GAP = 3
"""Unsolvable pictures in a row after which the robot counts as returned."""


@dataclass(slots=True)
class SceneRecord:
    """What came of all pictures of a scene at a size through a channel."""

    scene: str
    size: Size
    channel: str
    frames: int = 0
    solvable: int = 0
    found: int = 0
    """Of the solvable ones."""
    wrong: int = 0
    """Of all looks."""
    fresh_frames: int = 0
    """Pictures tried from nothing."""
    fresh: int = 0
    """Starts from nothing whose pictures were solvable."""
    fresh_found: int = 0
    undecoded: int = 0
    returns: list[int] = field(default_factory=list)
    """Solvable pictures until found again, the finding one included."""
    errors: list[Error] = field(default_factory=list)
    tracking_s: list[tuple[float, float, float]] = field(default_factory=list)
    """By stage, of pictures after one with a pose."""
    starting_s: list[tuple[float, float, float]] = field(default_factory=list)
    """The same of all others."""
    whole_s: list[float] = field(default_factory=list)
    """All that a picture took, what is learnt of the camera included."""
    blobs: list[int] = field(default_factory=list)
    """How many lights there were when starting."""
    pass_s: list[float] = field(default_factory=list)
    wrong_at: list[tuple[int, int]] = field(default_factory=list)
    """(seed, picture) of the wrong ones."""

    def add(self, other: SceneRecord) -> None:
        """Take in what came of another film."""
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, int | list):
                setattr(self, name, value + getattr(other, name))


class ChannelRun:
    """The live stages behind one channel."""

    def __init__(self, film: RenderedVideo, channel: Channel) -> None:
        """Begin with nothing seen."""
        self.channel, self._film = channel, film
        self._front_end = self._new()
        self._wire = Wire(channel.codec, (film.camera.width, film.camera.height))
        self.record = SceneRecord(film.scene.name, film.size, channel.name)
        self._phone: deque[PhoneImu] = deque()
        self._body: deque[BodyImu] = deque()
        self._had_pose = False
        self._fresh: VisualFrontEnd | None = None
        self._fresh_left, self._fresh_fair = 0, False
        self._unsolvable, self._waiting = 0, 0

    def _new(self) -> VisualFrontEnd:
        return VisualFrontEnd(self._film.camera, self._film.leds_in_b, GatesConfig(), thread_cpu)

    def see(self, k: int, shot: RenderedFrame) -> None:
        """The film's next shot, picture `k`."""
        if self.channel.imu:
            self._add_imu(shot)
        frame = self._wire.carry(shot.t, shot.luma)
        record = self.record
        record.frames += 1
        record.solvable += shot.solvable
        if frame is None:
            record.undecoded += 1
            self._count_return(shot, False)
            return
        detection = self._look(self._front_end, frame)
        pose = detection.pose
        self._clocked(detection, self._had_pose)
        self._had_pose = pose is not None
        self._count_return(shot, pose is not None)
        record.found += shot.solvable and pose is not None
        self._judge(k, shot, detection)
        self._see_afresh(k, shot, frame)

    def _add_imu(self, shot: RenderedFrame) -> None:
        for front_end in (self._front_end, self._fresh):
            if front_end is not None:
                front_end.add_imu(*shot.phone, *shot.body)
        self._phone.extend(shot.phone)
        self._body.extend(shot.body)
        for samples in (self._phone, self._body):
            while samples and samples[0].t < shot.t - REMEMBERED_S:
                samples.popleft()

    def _look(self, front_end: VisualFrontEnd, frame: Frame) -> Detection:
        begin = thread_cpu()
        detection = front_end.process(frame)
        self.record.whole_s.append(thread_cpu() - begin)
        return detection

    def _clocked(self, detection: Detection, was_tracking: bool) -> None:
        took = detection.took_s
        times = (took.get("detect", 0.0), took.get("identify", 0.0), took.get("pose", 0.0))
        (self.record.tracking_s if was_tracking else self.record.starting_s).append(times)
        if not was_tracking:
            self.record.blobs.append(len(detection.spots))

    def _judge(self, k: int, shot: RenderedFrame, detection: Detection) -> None:
        pose, film = detection.pose, self._film
        if pose is not None and not self._accuse(k, shot, pose) and shot.visible.sum() >= 3:
            self.record.errors.append(measured(pose, shot, film.camera, film.leds_in_b))

    def _accuse(self, k: int, shot: RenderedFrame, pose: RelativePose) -> bool:
        """Count a pose that is none of the robot."""
        wrong = self._film.scene.picture is not ImageOrientation.UPRIGHT or is_wrong(pose, shot)
        if wrong:
            self.record.wrong += 1
            self.record.wrong_at.append((self._film.seed, k))
        return wrong

    def _see_afresh(self, k: int, shot: RenderedFrame, frame: Frame) -> None:
        """Now and then somebody starts from nothing, and has a few pictures for it.

        Not where another robot shines and ours is dark: who never saw ours can't know better.
        """
        if self._film.scene.twin and not shot.visible.any():
            return
        if k % FRESH_EVERY == 0:
            self._fresh, self._fresh_left, self._fresh_fair = self._new(), FRESH_LOOKS, True
            self._fresh.add_imu(*self._phone, *self._body)
        if self._fresh is None:
            return
        self._fresh_left -= 1
        self._fresh_fair &= shot.solvable
        detection = self._look(self._fresh, frame)
        self._clocked(detection, False)
        self.record.fresh_frames += 1
        found = detection.pose is not None
        if detection.pose is not None:
            self._accuse(-1 - k, shot, detection.pose)
        if found or self._fresh_left == 0:
            self.record.fresh += self._fresh_fair
            self.record.fresh_found += self._fresh_fair and found
            self._fresh = None

    def _count_return(self, shot: RenderedFrame, is_found: bool) -> None:
        """How long after its return the robot is found."""
        if not shot.solvable:
            if self._waiting:
                self.record.returns.append(self._waiting)
            self._waiting, self._unsolvable = 0, self._unsolvable + 1
            return
        if self._unsolvable >= GAP or self._waiting:
            self._waiting += 1
        self._unsolvable = 0
        if is_found and self._waiting:
            self.record.returns.append(self._waiting)
            self._waiting = 0


def watch(
    scene: Scene, size: Size, seed: int, frames: int, channels: list[Channel], plain: bool
) -> list[SceneRecord]:
    """Every channel's record of one film; the last one is plain OpenCV's, if wanted.

    As in the server, what lives is not visited by a collection of garbage in the midst of a look:
    that took up to 0.3 s here, and was counted as the look's.
    """
    film = RenderedVideo(scene, seed, size, frames, bound=True)
    eyes = [ChannelRun(film, channel) for channel in channels if _is_fair(scene, channel)]
    script = PlainTracker(film.camera, film.leds_in_b)
    record = SceneRecord(scene.name, size, "plain OpenCV")
    with closing(Garbage(thread_cpu)) as garbage:
        garbage.settle()
        for k, shot in enumerate(film):
            record.pass_s.append(pass_s(shot.luma))
            for eye in eyes:
                eye.see(k, shot)
            if plain:
                _try_plain(script, record, film, shot)
            garbage.tick(idle=False)
    return [eye.record for eye in eyes] + [record]


def _is_fair(scene: Scene, channel: Channel) -> bool:
    """Without motion sensors a turned picture is one of a turned robot."""
    return channel.imu or scene.picture in (ImageOrientation.UPRIGHT, ImageOrientation.MIRRORED)


def _try_plain(
    script: PlainTracker, record: SceneRecord, film: RenderedVideo, shot: RenderedFrame
) -> None:
    pose = script.look(shot)
    record.frames += 1
    record.solvable += shot.solvable
    record.tracking_s.append((script.took_s, 0.0, 0.0))
    if pose is None:
        return
    record.found += shot.solvable
    if film.scene.picture is not ImageOrientation.UPRIGHT or is_wrong(pose, shot):
        record.wrong += 1
    elif shot.visible.sum() >= 3:
        error = measured(pose, shot, film.camera, film.leds_in_b)
        record.errors.append(replace(error, nees=float("nan")))  # it claims no covariance
