import assert from 'node:assert/strict';
import { test } from 'node:test';

import { MinimumDelayClock, Rate, eventUs } from '../../src/wire/clock.js';

/** Repeatable noise in [0, 1). */
function noise(seed = 1) {
  let state = seed;
  return () => {
    state = (state * 48_271) % 2_147_483_647;
    return state / 2_147_483_647;
  };
}

test('stamps of any epoch map to arrival minus the least delay', () => {
  const random = noise();
  const clock = new MinimumDelayClock();
  for (let i = 0; i < 400; i++) {
    const stamp = 7e12 + i * 33_333;
    const arrival = 5e6 + i * 33_333 + 4000 + 40_000 * random() ** 2;
    const capture = clock.captureUs(stamp, arrival);
    assert.ok(capture <= arrival);
    if (i > 60) assert.ok(Math.abs(capture - (5e6 + i * 33_333 + 4000)) < 1500);
  }
});

test('the mapping follows a drifting clock', () => {
  const clock = new MinimumDelayClock();
  let error = 0;
  for (let i = 0; i < 3000; i++) {
    const truth = i * 33_333;
    error = clock.captureUs(truth * (1 - 1e-4), truth + 5000) - (truth + 5000);
  }
  assert.ok(Math.abs(error) < 1100, `${error} µs after 10 ms of drift`);
});

test('a wrong stamp now and then dates no other frame', () => {
  const random = noise();
  const clock = new MinimumDelayClock();
  for (let i = 0; i < 900; i++) {
    const truth = 5e6 + i * 33_333;
    const wrong = i % 200 === 99 ? 40_000 : 0; // stamped after it was taken
    const capture = clock.captureUs(truth + wrong, truth + 4000 + 20_000 * random() ** 2);
    if (i > 60 && !wrong) assert.ok(Math.abs(capture - truth - 4000) < 1500, `${i}: ${capture - truth}`);
  }
});

test('a new epoch (camera restarted) starts anew', () => {
  const clock = new MinimumDelayClock();
  clock.captureUs(9e9, 1e6);
  assert.equal(clock.captureUs(0, 2e6), 2e6);
  assert.equal(clock.captureUs(9e9, 3e6), 3e6);
});

test('event times that are no times of this clock become now', () => {
  assert.equal(eventUs(1000, 1_002_000), 1_000_000);
  for (const bad of [null, undefined, NaN, 1.7e12, 3]) assert.equal(eventUs(bad, 2e9), 2e9);
});

test('a rate counts the last second', () => {
  const rate = new Rate();
  for (let i = 0; i < 90; i++) rate.add(i * 20, 2);
  assert.equal(rate.perSecond(1790), 100);
  assert.equal(rate.perSecond(9999), 0);
});
