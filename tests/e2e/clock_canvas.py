"""A canvas for a camera that shows the time it was painted at, for whoever decodes the picture."""

from __future__ import annotations

import numpy as np

from pipeline.signals import Image

BITS, BLOCK_PX = 24, 40
"""Of milliseconds; a checksum of 8 bits follows. The second row is the first one inverted."""
CHECK = 0x5A
CLOCK_CANVAS = """
(() => {
  const canvas = Object.assign(document.createElement('canvas'), {width: 1280, height: 720});
  const paint = canvas.getContext('2d', {alpha: false});
  const block = (row, column, on) => {
    paint.fillStyle = on ? '#fff' : '#000';
    paint.fillRect(40 * column, 40 * row, 40, 40);
  };
  window.painted = 0;
  const onFrame = () => {
    painted += 1;
    paint.fillStyle = `hsl(${painted % 360} 30% 25%)`;
    paint.fillRect(0, 80, 1280, 640);
    for (let k = 0; k < 40; k += 1) { // something to encode
      paint.fillStyle = `rgb(${(37 * k) % 255} ${(91 * k) % 255} 90)`;
      paint.fillRect((97 * k + 5 * painted) % 1280, 90 + (61 * k) % 600, 60, 24);
    }
    const ms = Math.round(performance.now()) & 0xffffff;
    const check = (ms ^ (ms >> 8) ^ (ms >> 16) ^ 0x5a) & 0xff;
    for (let i = 0; i < 32; i += 1) {
      const on = ((i < 24 ? ms >> i : check >> (i - 24)) & 1) === 1;
      block(0, i, on);
      block(1, i, !on);
    }
    requestAnimationFrame(onFrame);
  };
  onFrame();
  navigator.mediaDevices.getUserMedia = async () => {
    const stream = canvas.captureStream(30);
    const [track] = stream.getVideoTracks();
    Object.defineProperty(track, 'label', {value: 'canvas camera'});
    return stream;
  };
})();
"""


def painted_ms(luma: Image) -> int | None:
    """The time of the page's clock that a picture shows [ms], to 24 bits; None if it is damaged."""
    middles = BLOCK_PX // 2 + BLOCK_PX * np.arange(BITS + 8)
    upper, lower = (luma[y, middles].astype(int) for y in (BLOCK_PX // 2, BLOCK_PX * 3 // 2))
    if np.any(np.abs(upper - lower) < 60):
        return None
    word = int(np.sum((upper > lower).astype(np.int64) << np.arange(BITS + 8)))
    ms, check = word & 0xFFFFFF, word >> BITS
    return ms if check == (ms ^ ms >> 8 ^ ms >> 16 ^ CHECK) & 0xFF else None
