"""A canvas for a camera that shows the time it was painted at, for whoever decodes the picture."""

from __future__ import annotations

import numpy as np

from pipeline.signals import Image
from tests.e2e.page_scripts import PAINTED_CAMERA

BITS = 24
"""Of milliseconds; a checksum of 8 bits follows. The second row is the first one inverted."""
CHECK = 0x5A
_CANVAS = """
(() => {
  const [width, height] = [WIDTH, WIDTH * 9 / 16];
  const canvas = Object.assign(document.createElement('canvas'), {width, height});
  const size = width / 32;
  const paint = canvas.getContext('2d', {alpha: false});
  const block = (row, column, on) => {
    paint.fillStyle = on ? '#fff' : '#000';
    paint.fillRect(size * column, size * row, size, size);
  };
  const noise = Object.assign(document.createElement('canvas'), {width: 512, height: 512});
  const grain = noise.getContext('2d', {alpha: false});
  const pixels = grain.createImageData(512, 512);
  for (let i = 0; i < pixels.data.length; i += 4) {
    pixels.data.fill(90 + 60 * Math.random(), i, i + 3);
    pixels.data[i + 3] = 255;
  }
  grain.putImageData(pixels, 0, 0);
  let pictures = 0;
  const paintAt = (now) => {
    pictures += 1;
    paint.fillStyle = `hsl(${pictures % 360} 30% 25%)`;
    paint.fillRect(0, 2 * size, width, height);
    const [x, y] = [(pictures * 37) % 192, (pictures * 23) % 192];
    // something to encode
    paint.drawImage(noise, x, y, 320, 320, 12 * size, 6 * size, 8 * size, 8 * size);
    const ms = Math.round(now) & 0xffffff;
    const check = (ms ^ (ms >> 8) ^ (ms >> 16) ^ 0x5a) & 0xff;
    for (let i = 0; i < 32; i += 1) {
      const on = ((i < 24 ? ms >> i : check >> (i - 24)) & 1) === 1;
      block(0, i, on);
      block(1, i, !on);
    }
  };
  PAINTED_CAMERA
})();
"""


def clock_canvas(width: int) -> str:
    """The script; 16:9, 32 blocks wide."""
    return _CANVAS.replace("WIDTH", str(width)).replace("PAINTED_CAMERA", PAINTED_CAMERA)


def painted_ms(luma: Image) -> int | None:
    """The time of the page's clock that a picture shows [ms], to 24 bits; None if it is damaged."""
    block = luma.shape[1] // (BITS + 8)
    middles = block // 2 + block * np.arange(BITS + 8)
    upper, lower = (luma[y, middles].astype(int) for y in (block // 2, block * 3 // 2))
    if np.any(np.abs(upper - lower) < 60):
        return None
    word = int(np.sum((upper > lower).astype(np.int64) << np.arange(BITS + 8)))
    ms, check = word & 0xFFFFFF, word >> BITS
    return ms if check == (ms ^ ms >> 8 ^ ms >> 16 ^ CHECK) & 0xFF else None
