"""The ground station's end of RPIt's link without a socket: who the robot is, what it is told.

Nothing here is keyed, so whoever is on the network can say that he is the robot. What is done
against accidents and against one who only sends:

* The robot file's `host` is the only address that is heard, unless it says 0.0.0.0.
* The first who sends a whole con of our layout is the robot, and gets the commands. He stays it
  while he says something new that `ControlEnd` believes, and for a second after; meanwhile nobody
  else is heard, and nobody moves him. Who does not echo a challenge within a second, as a
  recording can't, has to give way to the next who speaks.
* His clock in the header goes on: what is repeated or overtaken is dropped.
* The first con of a start counts only if it echoes a challenge of 53 random bits (`ControlEnd`).

Who reads along, or has the robot's address and guesses well, can do as he likes; see SECURITY.md.
"""

from __future__ import annotations

import secrets

from hardware.follower import BodySample, RobotCommand
from hardware.link.address import ANYBODY
from hardware.link.control_end import ControlEnd
from hardware.link.datagram import LinkError, SampleDatagram
from hardware.link.robot_end import Peer
from hardware.link.rpit.structs import WHOLE, decode_con, encode_mes

KEEPS_PEER_S = 1.0
"""As long as the block itself waits for a mes before it says something again."""


def random_whole() -> int:
    """Unpredictable whole number that a double holds, not 0."""
    return 1 + secrets.randbelow(WHOLE - 1)


class RobotsAddress:
    """Which of those who speak is the robot. Times are [s], monotonic."""

    def __init__(self, host: str) -> None:
        """`host`: the only address that is heard, or `ANYBODY`."""
        self.peer: Peer | None = None
        """Where commands go; None: nobody has spoken yet."""
        self._host = host
        self._sent_ns = -1
        self._keeps_until = -1.0

    def admits(self, sender: Peer, sent_ns: int, now: float) -> bool:
        """Whether a con of that sender, sent at that time of his, may be the robot's next."""
        if self._host not in (ANYBODY, sender[0]):
            return False
        same = sender == self.peer
        if not (same and sent_ns > self._sent_ns):
            if now <= self._keeps_until:
                return False
            if not same:
                self._keeps_until = now + KEEPS_PEER_S
        self.peer, self._sent_ns = sender, sent_ns
        return True

    def keep(self, now: float) -> None:
        """He has said something that only the robot can say."""
        self._keeps_until = now + KEEPS_PEER_S


class GroundEnd:
    """Turns thrusts into mes and con into samples. Times are [s], monotonic."""

    def __init__(self, end: ControlEnd, host: str) -> None:
        """Of a robot at `host`; nothing of `end`'s key is used."""
        self.thrusters = end.thrusters
        self._end, self._address = end, RobotsAddress(host)
        self._newest: SampleDatagram | None = None
        self._dropped = 0

    @property
    def peer(self) -> Peer | None:
        """Where commands go; None: nobody has spoken yet."""
        return self._address.peer

    @property
    def epoch(self) -> int:
        """Under which commands are sent; a new one after the robot has gone to zero by itself."""
        return self._end.epoch

    @property
    def dropped(self) -> int:
        """Packets that were not the robot's, damaged, repeated, overtaken or of before we spoke."""
        return self._dropped + self._end.dropped

    def zero(self) -> RobotCommand:
        """Nothing, disarmed."""
        return self._end.zero()

    def command(self, command: RobotCommand, now: float) -> bytes:
        """The mes for `command`.

        Raises:
            FollowerError: a command no robot may be told.
        """
        boot_id = self._newest.boot_id if self._newest else 0
        return encode_mes(self._end.next_command(command, now), boot_id, round(1e9 * now))

    def receive(self, data: bytes, sender: Peer, now: float) -> BodySample | None:
        """The sample in `data`; None if there is none, or nothing new, or not to be believed."""
        try:
            con = decode_con(data)
        except LinkError:
            self._dropped += 1
            return None
        is_robots = len(con.sample.thrusts) == self.thrusters
        if not (is_robots and self._address.admits(sender, con.sent_ns, now)):
            self._dropped += 1
            return None
        return self._believed(con.sample, now)

    def _believed(self, sample: SampleDatagram, now: float) -> BodySample | None:
        """The block says what its model last said, however often it is asked: that is no fault."""
        last = self._newest
        if last is not None and sample.boot_id == last.boot_id:
            if sample.counter == last.counter:
                return None
            if sample.t_us <= last.t_us:
                self._dropped += 1
                return None
        believed = self._end.believe(sample, now)
        if believed is not None:
            self._newest = sample
            self._address.keep(now)
        return believed
