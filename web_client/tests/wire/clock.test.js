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

/**
 * Errors [µs] of frames that come 30 times a second.
 * @param {number} count
 * @param {(truthUs: number, i: number) => number} stampOf
 * @param {(i: number, chance: number) => number} delayOf
 */
function errors(count, stampOf, delayOf) {
  const random = noise();
  const clock = new MinimumDelayClock();
  return Array.from({ length: count }, (_, i) => {
    const truth = 5e6 + i * 33_333;
    return clock.captureUs(stampOf(truth, i), truth + delayOf(i, random())) - truth;
  });
}

const ordinaryDelay = (/** @type {number} */ x) => 4000 + 10_000 * x ** 2;
const worst = (/** @type {number[]} */ values) => Math.max(...values.map(Math.abs));

test('the mapping follows a clock that drifts for an hour', () => {
  for (const drift of [1e-4, -1e-4]) {
    const made = errors(108_000, (truth) => truth * (1 + drift) - 7e8, (_, x) => ordinaryDelay(x));
    assert.ok(made.slice(60).every((error) => error > 2000 && error < 6000));
  }
});

test('a frame that waited is dated by what was known, however long', () => {
  for (const waitedUs of [3e5, 9e5, 1.02e6, 1.5e6, 5e6, 6e7]) {
    const made = errors(800, (truth) => truth - 7e8, (i, x) => (
      ordinaryDelay(x) + (i === 400 || i === 401 ? waitedUs : 0)
    ));
    assert.ok(worst(made.slice(60)) < 5000, `${waitedUs}: ${worst(made.slice(60))}`);
  }
});

test('what a first frame waited for dates none that come in time', () => {
  for (const waitedUs of [3e5, 9e5, 1.5e6]) {
    const made = errors(60, (truth) => truth, (i, x) => ordinaryDelay(x) + (i === 0 ? waitedUs : 0));
    assert.ok(worst(made.slice(1)) < 14_000);
  }
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

test('a new epoch (camera restarted) is believed when three frames in a row tell it', () => {
  const step = (/** @type {number} */ us) => errors(
    800, (truth, i) => truth + (i >= 400 ? us : 0), (_, x) => ordinaryDelay(x),
  );
  for (const us of [-6e7, -2e6]) {
    const made = step(us);
    assert.ok(made.slice(400, 402).every((error) => error < -1.9e6), 'older than any that is wanted');
    assert.ok(worst(made.slice(402)) < 14_000);
  }
  for (const us of [3e5, 2e6, 6e7]) assert.ok(worst(step(us).slice(60)) < 14_000, 'never after they came');
});

test('one wild stamp makes no new epoch', () => {
  for (const us of [-6e8, -2e6, 2e6, 6e8]) {
    const made = errors(800, (truth, i) => truth + (i === 400 ? us : 0), (_, x) => ordinaryDelay(x));
    assert.ok(worst([...made.slice(60, 400), ...made.slice(401)]) < 5000);
  }
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
