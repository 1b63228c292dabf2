"""A phone that leads as any other and, told so by SIGUSR1, sends what only who leads can.

    python -m tests.bench.hostile_phone --path websocket|webrtc    # and all of `lightleash phone`

Among its own pictures, bombs on the ways that those come; and answers that are none: to fresh
offers where it leads by websockets, else to the offer that it flies by. A line says when it has
tried each kind of both once; its last one is what it came to as JSON, with what it `did` and what
the server said to that.
"""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import os
import signal
import sys
from collections import Counter
from dataclasses import replace
from http import HTTPStatus
from itertools import count, cycle
from typing import Final
from urllib.parse import urlsplit

os.environ.setdefault("OMP_NUM_THREADS", "1")

import msgspec

from server.common.clock import now
from server.protocol.messages import Welcome
from server.protocol.signalling import Answer, Ask, Offer
from server.protocol.wire_records import Codec, Picture, Record
from server.virtual_phone.command import make_parser, play, summary
from server.virtual_phone.phone_client import PhoneClient
from server.virtual_phone.rtc_client import RtcPhoneClient
from tests.bench.bombs import bombs
from tests.bench.hostile_answers import answer_to, hostile

BOMB_S: Final = 0.75
"""Between two bombs: one that takes all the time it is given is decoded before the next comes."""
ANSWER_S: Final = 0.5
PATIENCE_S: Final = 10.0
AFTER_US: Final = 2_000
"""A bomb is taken so long after the picture that it follows, well before the next."""
NUMBERED_FROM: Final = 1 << 31
"""No picture of the phone's own has such a number."""


class Hostile(PhoneClient):
    """What makes a phone's client so; the rest of it stays as it is."""

    did: Counter[str]
    by_track = False
    """Bombs of H.264 come as a track, too."""

    async def open(self, device: str) -> Welcome:
        self.did, self._begun, self._due = Counter(), asyncio.Event(), 0.0
        self._thrown = 0
        self._kinds = {"bombs", "answers"}
        self._size = (0, 0)
        asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, self._begun.set)
        self._welcome = await super().open(device)
        return self._welcome

    async def run(self) -> None:
        await asyncio.gather(super().run(), self._answer_offers())

    async def send(self, record: Record) -> None:
        await super().send(record)
        body = record.body
        if self._begun.is_set() and isinstance(body, Picture) and now() >= self._due:
            self._due = now() + BOMB_S
            await self._throw(record, body)

    async def _throw(self, record: Record, picture: Picture) -> None:
        """The next bomb, as the picture after this one."""
        if self._size != (picture.width, picture.height):
            self._size = picture.width, picture.height
            made = list(bombs(*self._size).values())
            tracked = [(bomb, True) for bomb in made if self.by_track and bomb[0] is Codec.H264]
            self._next = cycle([*((bomb, False) for bomb in made), *tracked])
            self._bombs = len(made) + len(tracked)
        (codec, data), as_track = next(self._next)
        number, t_us = NUMBERED_FROM + self._thrown, record.t_us + AFTER_US
        bomb = Record(number, t_us, replace(picture, codec=codec, key=True, data=data))
        self._thrown += 1
        self.did[f"bombs by {'track' if as_track else 'socket'}"] += 1
        await (super().send(bomb) if as_track else PhoneClient._say(self, bomb))
        if self._thrown == self._bombs:
            self._has_tried("bombs")

    async def _answer_offers(self) -> None:
        await self._begun.wait()
        for n in count():
            offer, good = await self._offered()
            answers = list(hostile(good).values())
            status, field = await self._request(Answer(offer, answers[n % len(answers)]))
            self.did[f"answers: {status} {field}".strip()] += 1
            if n + 1 == len(answers):
                self._has_tried("answers")
            await asyncio.sleep(ANSWER_S)

    def _has_tried(self, what: str) -> None:
        self._kinds.discard(what)
        if not self._kinds:
            print("each kind once", flush=True)

    async def _offered(self) -> tuple[str, str]:
        """(id of an offer, a good answer to it), of one that nobody has answered."""
        while True:
            status, said = await self._request(Ask(self._welcome.session))
            if status == HTTPStatus.OK:
                offer = msgspec.json.decode(said, type=Offer)
                return offer.id, await answer_to(offer.sdp)
            await asyncio.sleep(ANSWER_S)

    async def _request(self, body: Ask | Answer) -> tuple[int, str]:
        """(status, what the server said: an offer, or the field of a refusal)."""
        return await asyncio.to_thread(self._requested, body)

    def _requested(self, body: Ask | Answer) -> tuple[int, str]:
        url = urlsplit(self._access.url)
        headers = {"Authorization": f"Bearer {self._access.token}"}
        path = "/api/rtc" if isinstance(body, Ask) else "/api/rtc/answer"
        server = http.client.HTTPConnection(url.hostname or "", url.port, timeout=PATIENCE_S)
        with contextlib.closing(server):
            server.request("POST", path, msgspec.json.encode(body), headers)
            answer = server.getresponse()
            said = answer.read().decode()
        return answer.status, said if answer.status == HTTPStatus.OK else str(
            json.loads(said).get("field", "")
        )


class HostileRtc(Hostile, RtcPhoneClient):
    """Leads by WebRTC, with a socket for bombs beside it."""

    by_track = True
    _flown_by = ("", "")

    async def _open_video(self, device: str, welcome: Welcome) -> None:
        await PhoneClient._open_video(self, device, welcome)
        await super()._open_video(device, welcome)

    async def _post(self, path: str, body: Ask | Answer) -> bytes:
        if isinstance(body, Answer):
            self._flown_by = body.id, body.sdp
        return await super()._post(path, body)

    async def _offered(self) -> tuple[str, str]:
        return self._flown_by


def main(argv: list[str] | None = None) -> int:
    arguments = make_parser().parse_args(argv)
    client = HostileRtc if arguments.path == "webrtc" else Hostile
    live = asyncio.run(play(arguments, client))
    assert isinstance(live.client, Hostile)
    print(f"\n{json.dumps(summary(live) | {'did': live.client.did})}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
