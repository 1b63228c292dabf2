import assert from 'node:assert/strict';
import { test } from 'node:test';

import {
  CARD_MM, CELLS, FramePeriod, ServerClock, TILE_SHARE, lightCells, lightsAt, mmPerPixel, sizeKey,
  slowness,
} from '../../src/screen/glass.js';

/** @param {Partial<import('../../src/wire/protocol_types.js').ScreenLights>} [other] */
const lights = (other = {}) => ({
  type: /** @type {'lights'} */ ('lights'), phase: /** @type {'robot'} */ ('robot'), why: '', lag_ms: 40, t_ms: 1040,
  step_ms: 10, places_mm: [[0, 10, 50, null], [1, 10, 51, null], [4, 10, 52, null]], dot_mm: 3, sweep_mm: 50, ...other,
});

test('every corner has a marker with a quiet zone, and the middle of the glass stays black', () => {
  const [width, height] = [1600, 900];
  const cells = lightCells(width, height);
  const tile = TILE_SHARE * height;
  for (const [x, y] of [[0, 0], [width - tile, 0], [width - tile, height - tile], [0, height - tile]]) {
    const own = cells.filter(([u, v]) => u >= (x ?? 0) - 1e-6 && u < (x ?? 0) + tile && v >= (y ?? 0) - 1e-6 && v < (y ?? 0) + tile);
    assert.ok(own.length > 4 * (CELLS - 1) && own.length < 4 * (CELLS - 1) + 16);
  }
  /** @param {[number, number, number]} cell */
  const inside = ([x, y, side]) => x >= -1e-6 && y >= -1e-6 && x + side <= width + 1e-6 && y + side <= height + 1e-6;
  assert.ok(cells.every(inside));
  assert.ok(cells.every(([x, y]) => (x < tile || x >= width - tile) && (y < tile || y >= height - tile)));
});

test('a frame’s lights are where the robot is when they shine: its time and the lag', () => {
  assert.deepEqual(lightsAt(lights(), 1000, 300, 0), [[0, 10]]);
  assert.deepEqual(lightsAt(lights(), 1015, 300, 0), [[2.5, 10]]);
  assert.deepEqual(lightsAt(lights(), 900, 300, 0), [[0, 10]], 'nothing is guessed before the first');
  assert.deepEqual(lightsAt(lights(), 2000, 300, 0), [[4, 10]], 'nor after the last');
});

test('a light in the upper half shines earlier than the middle, by its share of the scan', () => {
  const [[right] = [NaN]] = lightsAt(lights({ places_mm: [[0, 150], [10, 150], [20, 150]] }), 1015, 300, 10);
  assert.equal(right, 10);
});

test('while the lag is measured one light sweeps by the frame’s own time, and before that none', () => {
  const [[right, up] = [NaN, NaN]] = lightsAt(lights({ phase: 'sweep', lag_ms: null }), 250, 300, 16);
  assert.ok(Math.abs(right - 50) < 1e-9);
  assert.equal(up, 0);
  assert.deepEqual(lightsAt(lights({ phase: 'search', lag_ms: null, places_mm: [] }), 250, 300, 16), []);
});

test('the server’s clock is that of the answer which came back fastest', () => {
  const clock = new ServerClock();
  assert.equal(clock.at(0), null);
  clock.heard(100, 5010, 140);
  clock.heard(200, 5101, 202);
  clock.heard(300, 5290, 400);
  assert.equal(clock.at(1000), 5900);
  for (let k = 0; k < 60; k += 1) clock.heard(1000 + k, 9001 + k, 1002 + k);
  assert.equal(clock.at(1000), 9000, 'an answer is forgotten some seconds later: clocks drift');
});

test('a frame that was late does not change how long a frame lasts', () => {
  const period = new FramePeriod();
  assert.ok(Math.abs(period.ms - 16.67) < 0.01);
  for (const at of [0, 8, 16, 24, 90, 98, 106]) period.tick(at);
  assert.equal(period.ms, 8);
});

test('a television at 24 Hz is told of, and none at 30 Hz or that is not known yet', () => {
  assert.equal(slowness(1000 / 24), 'This screen shows only 24 pictures a second: set it to 60 Hz.');
  for (const ms of [1000 / 30, 1000 / 60, NaN]) assert.equal(slowness(ms), '');
});

test('a screen’s size is remembered by its kind, and nonsense is not believed', () => {
  assert.equal(mmPerPixel('0.2', 1), 0.2);
  for (const nonsense of [null, '', 'x', '-1', '50']) assert.equal(mmPerPixel(nonsense, 1), 0.25);
  assert.ok(mmPerPixel(null, 2) < mmPerPixel(null, 1));
  assert.equal(sizeKey({ width: 1920, height: 1080 }, 2), 'lightleash-mm 1920x1080@2');
  assert.equal(CARD_MM, 85.6);
});
