import assert from 'node:assert/strict';
import { test } from 'node:test';

import { CALM, Pace, hasExactSizes, quartersOf, shrunkSize, stepWords } from '../../src/video/rate_adaptation.js';
import { EncoderLoad } from '../../src/video/encoder_load.js';
import { PaceKeeper } from '../../src/video/rate_control.js';
import { RtcLoad, countsOf, roundTripOf } from '../../src/video/rtc_load.js';
import { Throttle } from '../../src/video/throttle.js';

/** @import {Level, Load} from '../../src/video/rate_adaptation.js' */

const FINE = { inHz: 30, outHz: 30, encodeMs: 8, waiting: 0, starved: false };
const STRAINED = { inHz: 30, outHz: 19, encodeMs: 52, waiting: 0, starved: false };

/**
 * An encoder that needs so long for a picture of the full size, and works on one at a time.
 * @param {Level} level
 * @param {number} fullMs
 * @returns {Load}
 */
function encoderAt({ hz, shrunk }, fullMs) {
  const encodeMs = fullMs * ((4 - shrunk) / 4) ** 2;
  return { inHz: hz, outHz: Math.min(hz, 1000 / encodeMs), encodeMs, waiting: 0, starved: false };
}

/**
 * @param {Pace} pace
 * @param {number} looks
 * @param {(level: Level) => Load | null} load
 */
function play(pace, looks, load) {
  const steps = [];
  for (let k = 0; k < looks; k += 1) {
    const step = pace.look(load(pace.level));
    if (step !== null) steps.push({ k, ...step });
  }
  return steps;
}

test('an encoder that keeps up is left alone, and so is one of which nothing is known', () => {
  assert.deepEqual(play(new Pace(30, true), 200, () => FINE), []);
  assert.deepEqual(play(new Pace(30, true), 200, () => null), []);
});

test('first pictures a second are given up, then size, down to the least', () => {
  const pace = new Pace(30, true);
  const steps = play(pace, 60, () => STRAINED);
  assert.deepEqual(steps.map(({ level }) => level), [
    { hz: 20, shrunk: 0 }, { hz: 15, shrunk: 0 }, { hz: 15, shrunk: 1 }, { hz: 15, shrunk: 2 },
  ]);
  assert.ok(steps.every(({ isEasier }) => isEasier));
});

test('no further down than it takes', () => {
  for (const [fullMs, hz, shrunk] of /** @type {[number, number, number][]} */ ([
    [25, 30, 0], [45, 20, 0], [60, 15, 0], [100, 15, 1], [200, 15, 2],
  ])) {
    const pace = new Pace(30, true);
    play(pace, 24, (level) => encoderAt(level, fullMs));
    assert.deepEqual(pace.level, { hz, shrunk }, `${fullMs} ms`);
  }
});

test('a moment of strain is none', () => {
  const pace = new Pace(30, true);
  let k = 0;
  assert.deepEqual(play(pace, 300, () => ((k += 1) % 3 === 0 ? STRAINED : FINE)), []);
});

test('an encoder that works on several pictures at once is not strained, however long each takes', () => {
  assert.deepEqual(play(new Pace(30, true), 100, () => ({ ...FINE, encodeMs: 60 })), []);
});

test('pictures that are missing for another reason, as a slow line, are not the encoder’s fault', () => {
  assert.deepEqual(play(new Pace(30, true), 100, () => ({ ...FINE, outHz: 9 })), []);
});

test('a queue before the encoder, or a browser that says it is too slow, is strain', () => {
  assert.equal(play(new Pace(30, true), 8, () => ({ ...FINE, waiting: 2 })).length, 1);
  const starved = { ...FINE, encodeMs: null, outHz: 20, starved: true };
  assert.equal(play(new Pace(30, true), 8, () => starved).length, 1);
  assert.deepEqual(play(new Pace(30, true), 50, () => ({ ...starved, outHz: 29 })), []);
});

test('up again after a while of calm, step by step, all the way', () => {
  const pace = new Pace(30, true);
  play(pace, 60, () => STRAINED);
  const steps = play(pace, 5 * (CALM + 5), (level) => encoderAt(level, 5));
  assert.deepEqual(steps.map(({ level }) => level.hz), [15, 15, 20, 30]);
  assert.ok(steps.every(({ isEasier }) => !isEasier));
  assert.ok(steps.every(({ k }, i) => k - (steps[i - 1]?.k ?? 0) >= CALM - 1));
});

test('who steps up too early waits twice as long the next time: few steps in an hour', () => {
  const pace = new Pace(30, true);
  const steps = play(pace, 7200, (level) => encoderAt(level, 45)); // 20 a second, never 30
  const ups = steps.filter(({ isEasier }) => !isEasier);
  assert.ok(ups.length < 30, `${ups.length} tries`);
  const waits = ups.slice(1).map(({ k }, i) => k - /** @type {any} */ (ups[i]).k);
  assert.ok(waits.slice(0, 3).every((wait, i) => wait < /** @type {number} */ (waits[i + 1])));
});

test('where sizes would not be exact only the number of pictures is stepped', () => {
  const pace = new Pace(30, false);
  play(pace, 100, () => STRAINED);
  assert.deepEqual(pace.level, { hz: 15, shrunk: 0 });
  assert.equal(hasExactSizes(1280, 720), true);
  assert.equal(hasExactSizes(854, 480), false);
  assert.equal(hasExactSizes(undefined, 480), false);
});

test('sizes are told from each other, however the phone is held', () => {
  for (const shrunk of [0, 1, 2]) {
    const size = shrunkSize(1280, 720, shrunk);
    assert.equal(quartersOf(size, { width: 1280, height: 720 }), shrunk);
    assert.equal(quartersOf(size, { width: 720, height: 1280 }), shrunk);
  }
  assert.deepEqual(shrunkSize(1280, 720, 1), { width: 960, height: 540 });
});

test('a step is told in words with its size', () => {
  const step = { level: { hz: 15, shrunk: 1 }, isEasier: true };
  assert.equal(stepWords(step, { width: 1280, height: 720 }), 'The phone can’t keep up: 15 pictures a second of 960×540');
  assert.equal(
    stepWords({ level: { hz: 30, shrunk: 0 }, isEasier: false }, {}), 'The phone keeps up again: 30 pictures a second',
  );
});

test('WebRTC’s counts become a load between two looks', () => {
  const report = (/** @type {number} */ framesEncoded, /** @type {number} */ totalEncodeTime) => [
    { type: 'codec' }, { type: 'outbound-rtp', framesEncoded, totalEncodeTime, qualityLimitationReason: 'cpu' },
  ];
  const loads = new RtcLoad();
  assert.equal(loads.since(countsOf([]), 30, 0), null);
  assert.equal(loads.since(countsOf(report(100, 2)), 30, 1000), null);
  assert.deepEqual(loads.since(countsOf(report(110, 2.5)), 30, 1500), {
    inHz: 30, outHz: 20, encodeMs: 50, waiting: 0, starved: true,
  });
  assert.equal(loads.since(countsOf(report(5, 0.1)), 30, 2000), null); // another connection
  const [, told] = report(25, 0);
  const silent = { ...told, totalEncodeTime: undefined };
  assert.equal(loads.since(countsOf([silent]), 30, 3000)?.encodeMs, null);
});

test('the round trip is what RTCP last said', () => {
  assert.equal(roundTripOf([{ type: 'outbound-rtp' }, { type: 'remote-inbound-rtp' }]), null);
  assert.equal(roundTripOf([{ type: 'remote-inbound-rtp', roundTripTime: 0.012 }]), 12);
});

test('an encoder of ours is measured: what was meant for it, what came out, how long it took', () => {
  const load = new EncoderLoad();
  assert.equal(load.since(0), null);
  for (const [k, queue] of [3, 2, 4].entries()) {
    load.meant(queue);
    load.entered(100 * k);
  }
  load.left(50);
  load.lost();
  assert.deepEqual(load.since(500), { inHz: 6, outHz: 2, encodeMs: 50, waiting: 2, starved: false });
  load.meant(0);
  assert.equal(load.since(1000)?.starved, true); // one is inside and does not come out
  load.reset();
  load.meant(0);
  assert.equal(load.since(1500)?.starved, false); // the line has no credit
});

/** @param {number} hz @param {number} everyMs @param {number} jitterMs */
function passing(hz, everyMs, jitterMs = 0) {
  const throttle = new Throttle();
  throttle.limit(hz);
  let passed = 0;
  for (let k = 0; k * everyMs < 10_000; k += 1) {
    passed += Number(throttle.passes(1000 * (k * everyMs + (k % 2 ? jitterMs : -jitterMs))));
  }
  return passed / 10;
}

test('a throttle lets its number of pictures pass, and all of a camera that is no quicker', () => {
  assert.equal(new Throttle().passes(0), true);
  assert.ok(Math.abs(passing(20, 1000 / 30) - 20) <= 0.5);
  assert.ok(Math.abs(passing(15, 1000 / 30) - 15) <= 0.5);
  assert.ok(passing(30, 1000 / 30, 4) >= 29.5);
  assert.ok(passing(30, 1000 / 24) >= 23.9);
  assert.ok(Math.abs(passing(30, 1000 / 60) - 30) <= 0.5);
});

/** @param {Load | null} load */
function keeperOf(load) {
  /** @type {any[]} */
  const log = [];
  const keeper = new PaceKeeper({
    paths: { load: async () => load, ease: (level) => log.push(level) },
    camera: () => ({ width: 1280, height: 720 }),
    tell: (words) => log.push(words),
  });
  return { keeper, log };
}

test('a step goes to the encoder, to the person and to the supervisor', async () => {
  const { keeper, log } = keeperOf(STRAINED);
  await keeper.look(); // before anything has begun
  keeper.begin(30);
  assert.equal(keeper.sign, '');
  for (let k = 0; k < 4; k += 1) await keeper.look();
  assert.deepEqual(log, [
    { hz: 30, shrunk: 0 }, { hz: 20, shrunk: 0 },
    'The phone can’t keep up: 20 pictures a second of 1280×720',
  ]);
  assert.equal(keeper.sign, '↓');
  for (let k = 0; k < 40; k += 1) await keeper.look();
  assert.equal(keeper.sign, '½');
});

test('while only whole pictures are of use none is made smaller', async () => {
  const { keeper, log } = keeperOf(STRAINED);
  keeper.begin(30);
  for (let k = 0; k < 40; k += 1) await keeper.look();
  keeper.wantWhole(true);
  assert.deepEqual(log.at(-1), { hz: 15, shrunk: 0 });
  keeper.wantWhole(true);
  keeper.wantWhole(false);
  assert.deepEqual(log.at(-1), { hz: 15, shrunk: 2 });
});
