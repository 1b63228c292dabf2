import assert from 'node:assert/strict';
import { test } from 'node:test';

import { CaptureMatcher } from '../../src/video/rtc_matcher.js';

/** Repeatable noise from 0 to 1. @param {number} seed */
function noise(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

/**
 * Frames through an encoder: the share that is matched with its own capture, from the first one that is dated on.
 * @param {{ encodingMs: number, jitterMs: number, spread?: number, lost?: number, periodMs?: number, count?: number,
 *   starvedMs?: number, lateMs?: number, skipped?: number, seed?: number,
 *   busyMs?: number, withinMs?: number }} way
 */
function matchedShare({
  encodingMs, jitterMs, spread = 6, lost = 0, periodMs = 1000 / 30, count = 300, starvedMs = 0, lateMs = 0, skipped = 0,
  seed = 7, busyMs = 0, withinMs = 4,
}) {
  const random = noise(seed);
  const matcher = new CaptureMatcher();
  /** @type {{ at: number, act: () => void }[]} */
  const events = [];
  let right = 0;
  let all = 0;
  let busyUntil = 0;
  let toldUs = 0;
  for (let k = 0; k < count; k += 1) {
    const captureUs = 5e6 + 1000 * (k * periodMs + spread * random());
    toldUs = Math.max(toldUs, captureUs + 1500 + 1000 * (lateMs + starvedMs * random()));
    const saidUs = captureUs + 1000 * (lateMs + busyMs * Math.max(0, 1 - k / 15));
    const lateUs = 2000 + 1000 * lateMs;
    const capture = { captureUs: saidUs, stampUs: captureUs - 5e6, lateUs, screenAngle: /** @type {const} */ (90) };
    if (skipped === 0 || random() >= skipped) events.push({ at: toldUs, act: () => matcher.captured(capture) });
    if (random() < lost) continue;
    const stamp = (4294900000 + Math.round(0.09 * (captureUs + 1000 * jitterMs * (random() - 0.5)))) >>> 0;
    const slow = k === 0 ? 60 : 0;
    busyUntil = Math.max(busyUntil, captureUs + 1000 * (encodingMs + slow + 8 * random() ** 3));
    const at = busyUntil;
    events.push({
      at,
      act: () => {
        const found = matcher.match(stamp, at);
        if (found === null) return assert.ok(k < 30, `frame ${k} has no date`);
        all += 1;
        right += Math.abs(found.captureUs - captureUs) < 1000 * withinMs ? 1 : 0;
      },
    });
  }
  events.sort((a, b) => a.at - b.at).forEach(({ act }) => act());
  return right / all;
}

for (const [words, way] of Object.entries({
  'a quick encoder': { encodingMs: 3, jitterMs: 2 },
  'the encoder of a phone': { encodingMs: 22, jitterMs: 4 },
  'a camera that skips and an encoder that drops': { encodingMs: 8, jitterMs: 4, spread: 15, lost: 0.2 },
  'a page that is starved and tells late of its captures': { encodingMs: 8, jitterMs: 1, starvedMs: 150 },
  'an encoder slower than a picture, and a camera not too regular': { encodingMs: 50, jitterMs: 1, spread: 12, lost: 0.6 },
  'a quick encoder, and captures told of on their way to the screen': { encodingMs: 2, jitterMs: 2, spread: 2, lateMs: 9 },
  'sixty pictures a second': { encodingMs: 5, jitterMs: 2, spread: 3, periodMs: 1000 / 60, count: 600 },
})) {
  test(`each encoded frame finds its own picture: ${words}`, () => {
    assert.equal(matchedShare(way), 1);
  });
}

test('frames find their own pictures from the first date on, though the page skips some captures', () => {
  const shares = Array.from({ length: 100 }, (_, seed) => matchedShare({
    encodingMs: 11, jitterMs: 1, spread: 10, skipped: 0.2, count: 60, seed,
  }));
  assert.deepEqual(shares.filter((share) => share < 1), []);
});

test('frames find their own pictures though a busy page takes the first captures for later than they were', () => {
  const shares = Array.from({ length: 100 }, (_, seed) => matchedShare({
    encodingMs: 1, jitterMs: 2, spread: 10, busyMs: 70, count: 60, seed,
  }));
  assert.deepEqual(shares.filter((share) => share < 1), []);
});

test('a frame whose capture was skipped is dated between its neighbours, and no capture is used twice', () => {
  const matcher = new CaptureMatcher();
  /** @type {number[]} */
  const times = [];
  for (let k = 0; k < 200; k += 1) {
    const captureUs = 1e6 + k * 33_333;
    if (k % 9 !== 5) matcher.captured({ captureUs, stampUs: captureUs + 77, lateUs: 2000, screenAngle: 0 });
    const found = matcher.match(Math.round(0.09 * captureUs) >>> 0, captureUs + 6000 + (k % 5) * 1000);
    if (k >= 40) {
      assert.ok(found !== null);
      times.push(found.captureUs);
      assert.ok(Math.abs(found.captureUs - captureUs) < 8000, `${found.captureUs - captureUs}`);
    }
  }
  assert.ok(times.every((t, i) => i === 0 || t > Number(times[i - 1])));
});

test('a frame has no date before the captures of enough others were told for certain', () => {
  const matcher = new CaptureMatcher();
  /** @type {(k: number) => number} */
  const captureUs = (k) => 1e6 + k * 33_333;
  /** @type {(k: number) => ReturnType<CaptureMatcher['match']>} */
  const match = (k) => matcher.match(Math.round(0.09 * captureUs(k)), captureUs(k) + 9000);
  matcher.captured({ captureUs: captureUs(0), stampUs: captureUs(0), lateUs: 2000, screenAngle: 270 });
  const early = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(match);
  assert.ok(early.every((found) => found === null)); // its page tells of the rest only now
  for (let k = 1; k < 17; k += 1) {
    matcher.captured({ captureUs: captureUs(k), stampUs: captureUs(k), lateUs: 2000, screenAngle: 270 });
  }
  assert.ok(Math.abs(Number(match(17)?.captureUs) - captureUs(17)) < 2000);
  assert.equal(match(18)?.screenAngle, 270);
});

test('without captures no frame ever has a date', () => {
  const matcher = new CaptureMatcher();
  for (let k = 0; k < 60; k += 1) assert.equal(matcher.match(3000 * k, 33_333 * k), null);
});
