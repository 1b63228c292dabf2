"""What it costs to decode in a process of its own: python -m tests.bench.bench_decoder

720p pictures of noise and lights, decoded in turn here and there; so a busy machine disturbs both.
"""

from __future__ import annotations

import contextlib
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from hardware.codec import CODECS, Decoder, Encoder
from server.media.decoding import Decoding

WIDTH, HEIGHT, PICTURES, KINDS = 1280, 720, 300, 8
MOST_MS = 1.0


def main() -> int:
    """Measure, tell, judge."""
    rng = np.random.default_rng(0)
    noise = rng.normal(30.0, 3.0, (KINDS, HEIGHT, WIDTH)).clip(0, 255).astype(np.uint8)
    missed = 0
    with contextlib.closing(Decoding()) as decoding:
        for codec in CODECS:
            encoder = Encoder(WIDTH, HEIGHT, 30.0, 3_000_000, codec)
            here, there = Decoder(codec, WIDTH, HEIGHT), decoding.open(codec, WIDTH, HEIGHT)
            took: list[tuple[float, float]] = []
            for n in range(PICTURES):
                data, _ = encoder.encode(noise[n % KINDS])
                times = [time.perf_counter()]
                for decoder in (here, there):
                    decoder.decode(data)
                    times.append(time.perf_counter())
                took.append((times[1] - times[0], times[2] - times[1]))
            rows = 1e3 * np.percentile(took[20:], (10, 50, 99), axis=0)
            more = rows[1, 1] - rows[1, 0]
            missed += more >= MOST_MS
            here_ms, there_ms = (" ".join(f"{ms:6.2f}" for ms in column) for column in rows.T)
            words = f"p10 p50 p99 [ms] here {here_ms}, there {there_ms}"
            print(f"{codec:5} {words}: p50 {more:+.2f}, below {MOST_MS:g} wanted")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
