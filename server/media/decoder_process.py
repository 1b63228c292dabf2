"""Decodes hostile pictures: `python -m server.media.decoder_process SOCKET MEMORY BYTES CPU_S`.

One process imports the codecs and then only forks: its child decodes, under limits of processor
time and memory, and when a picture kills it the next child is there in some milliseconds. Both end
when the server has closed its end of the socket, so when it has died.

Requests and answers are small and of fixed length; a picture lies at the beginning of the shared
memory, coded when it is asked for and decoded when it is answered. So no request may be given up
that is still to be read: the next child would write its picture over a newer one. A child notes
which it works on, and only that one dies with it.
"""

from __future__ import annotations

import contextlib
import gc
import mmap
import os
import resource
import signal
import socket
import struct
import sys
import traceback
from collections import OrderedDict
from pathlib import Path
from typing import NoReturn

import cv2
import numpy as np

from hardware.codec import CODECS, DecodeError, Decoder
from server.common.child import PROMPT_NICENESS, die_with, set_niceness, set_oom_score

REQUEST = struct.Struct("<IIBHHI")
"""Number, stream, codec, width, height [px], bytes of the coded picture."""
ANSWER = struct.Struct("<IB")
"""Number of the request (0: none was being worked on), what became of it."""
WORKS_ON = struct.Struct("<I")
"""The same number, in memory that parent and child share."""
DECODED, REFUSED, DIED = range(3)
MEMORY_BYTES = 256 << 20
"""Beyond what the process has before its first picture."""
STREAMS = 4
"""Decoders that are kept."""
FIRST_TO_GO = 500
"""For Linux, when memory is short: it is started anew, and nobody else is hurt."""


def main() -> None:
    """Fork decoders one after the other, until the server has gone."""
    descriptor, memory_descriptor, size = map(int, sys.argv[1:4])
    cpu_s = float(sys.argv[4])
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_oom_score(FIRST_TO_GO)
    set_niceness(PROMPT_NICENESS)
    channel = socket.socket(fileno=descriptor)
    memory = mmap.mmap(memory_descriptor, size)
    cv2.setNumThreads(1)  # a forked process has none but the thread that forked it
    works_on = mmap.mmap(-1, WORKS_ON.size)
    gc.collect()
    gc.freeze()
    while True:
        WORKS_ON.pack_into(works_on, 0, 0)
        parent, child = os.getpid(), os.fork()
        if child == 0:
            _decode_for_ever(parent, channel, memory, works_on, cpu_s)
        _, status = os.waitpid(child, 0)
        if status == 0:
            return
        with contextlib.suppress(OSError):
            channel.sendall(ANSWER.pack(*WORKS_ON.unpack_from(works_on), DIED))


def _decode_for_ever(
    parent: int, channel: socket.socket, memory: mmap.mmap, works_on: mmap.mmap, cpu_s: float
) -> NoReturn:
    """Decode in the child: ends with 0 when the server has gone, or as a picture would have it."""
    code = 1
    try:
        die_with(parent)
        _limit()
        decoders: OrderedDict[int, Decoder] = OrderedDict()
        while len(request := channel.recv(REQUEST.size, socket.MSG_WAITALL)) == REQUEST.size:
            number, *asked = REQUEST.unpack(request)
            WORKS_ON.pack_into(works_on, 0, number)
            signal.setitimer(signal.ITIMER_PROF, cpu_s)  # its SIGPROF ends the process
            became = _answer(decoders, memory, *asked)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            channel.sendall(ANSWER.pack(number, became))
            WORKS_ON.pack_into(works_on, 0, 0)
        code = 0
    except ConnectionError:  # the server has gone meanwhile
        code = 0
    except Exception:  # noqa: BLE001 (the parent starts another one)
        traceback.print_exc()
    finally:
        os._exit(code)  # nothing of the parent's is to be tidied up here


def _limit() -> None:
    """Limit time and memory to what a picture needs."""
    limits = {resource.RLIMIT_CORE: 0, resource.RLIMIT_FSIZE: 0}
    with contextlib.suppress(OSError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limits[resource.RLIMIT_AS] = pages * resource.getpagesize() + MEMORY_BYTES
    for which, limit in limits.items():
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(which, (limit, limit))


def _answer(
    decoders: OrderedDict[int, Decoder],
    memory: mmap.mmap,
    stream: int,
    codec: int,
    width: int,
    height: int,
    length: int,
) -> int:
    if stream not in decoders:
        decoders[stream] = Decoder(CODECS[codec], width, height)
        while len(decoders) > STREAMS:
            decoders.popitem(last=False)
    try:
        luma = decoders[stream].decode(memory[:length])
    except DecodeError:
        del decoders[stream]
        return REFUSED
    np.frombuffer(memory, np.uint8, luma.size).reshape(luma.shape)[:] = luma
    return DECODED


if __name__ == "__main__":
    main()
