"""A film as the file that Chromium plays for a camera; each picture says its number in its colour.

Luma is the film's own, in video range; nobody looks at chroma, so the number costs no LED a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hardware.codec import BLACK, WHITE
from pipeline.signals import Image

BITS, BLOCK_PX = 9, 32
GREY, DARK, BRIGHT = 128, 96, 160
VIDEO = np.round(BLACK + np.arange(256) * (WHITE - BLACK) / 255.0).astype(np.uint8)


def write_y4m(path: Path, pictures: Sequence[Image], rate_hz: int) -> None:
    """Pictures (height, width) of full range to and fro, so that going round has no cut."""
    count = len(pictures)
    if not 2 <= count <= 1 << BITS:
        raise ValueError(f"{count} pictures; allowed: 2 to {1 << BITS}")
    height, width = pictures[0].shape
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{width} H{height} F{rate_hz}:1 Ip A1:1 C420\n".encode())
        for k in [*range(count), *range(count - 2, 0, -1)]:
            code = numbered(k, height // 2, width // 2)
            file.write(b"FRAME\n")
            for plane in (VIDEO[pictures[k]], code, 255 - code):
                file.write(plane.tobytes())


def numbered(k: int, height: int, width: int) -> Image:
    """Chroma that says `k`, as a Gray code: one block changes from a picture to the next."""
    plane = np.full((height, width), GREY, dtype=np.uint8)
    gray = k ^ (k >> 1)
    for bit in range(BITS):
        value = BRIGHT if gray >> bit & 1 else DARK
        plane[:BLOCK_PX, bit * BLOCK_PX : (bit + 1) * BLOCK_PX] = value
    return plane


def number_of(chroma: Image) -> int | None:
    """What chroma says; None: it is nothing of ours."""
    blocks = chroma[4 : BLOCK_PX - 4, : BITS * BLOCK_PX].reshape(BLOCK_PX - 8, BITS, BLOCK_PX)
    levels = blocks[:, :, 4:-4].mean(axis=(0, 2)) - GREY
    if np.abs(levels).min() < 0.5 * (BRIGHT - GREY):
        return None
    bits = levels > 0.0
    # each bit of the number is the sum of the Gray code's from there on
    return sum(int(bits[k:].sum()) % 2 << k for k in range(BITS))
