"""Small encoded pictures for seeds."""

from functools import cache

import numpy as np

from hardware.codec import Encoder

WIDTH, HEIGHT = 64, 48


@cache
def encoded(codec: str, count: int, width: int = WIDTH, height: int = HEIGHT):
    """(bytes, whether a key) of pictures with a spot that moves."""
    encoder = Encoder(width, height, 30.0, 300_000, codec)
    pictures = []
    for k in range(count):
        luma = np.full((height, width), 20, np.uint8)
        luma[10:14, 10 + 3 * k : 14 + 3 * k] = 250
        pictures.append(encoder.encode(luma))
    return pictures
