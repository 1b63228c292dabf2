import assert from 'node:assert/strict';
import { test } from 'node:test';

import { TRAILER_BYTES, crc16, withTrailer } from '../../src/video/metadata_trailer.js';

const picture = new Uint8Array([0, 0, 0, 1, 0x65, 7, 0]);

test('a picture keeps its bytes, and nothing behind them can be taken for a start code', () => {
  const whole = new Uint8Array(withTrailer(picture.buffer, {
    sequence: 0, captureUs: 0, screenAngle: 0, orientation: [0, 0, 0, 1], shrunk: 1,
  }));
  assert.equal(whole.length, picture.length + TRAILER_BYTES);
  assert.deepEqual(whole.subarray(0, picture.length), picture);
  assert.ok(whole.subarray(picture.length).every((byte) => byte >= 0x80));
});

test('the check sum is the usual one', () => {
  assert.equal(crc16(new TextEncoder().encode('123456789')), 0x31c3);
});

test('times before the page began and angles beyond one turn nothing over', () => {
  withTrailer(picture.buffer, { sequence: 2 ** 32 - 1, captureUs: -5, screenAngle: 270, orientation: [1.001, -1.001, 0, 0], shrunk: 2 });
});
