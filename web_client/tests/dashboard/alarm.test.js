/** The supervisor's alarm: what it says in the title, and how long it sounds. */

/** @import {ShownMode, Signal} from '../../src/ui/session_types.js' */

import assert from 'node:assert/strict';
import test from 'node:test';
import { Alarm } from '../../src/dashboard/alarm.js';

/**
 * @param {[ShownMode, number][]} modes
 * @param {boolean} flies
 */
function heard(modes, flies = false) {
  const page = { title: '' };
  /** @type {Signal[]} */
  const signals = [];
  const alarm = new Alarm(page, (mode) => signals.push(mode));
  for (const [mode, now] of modes) alarm.take(mode, mode, flies, now);
  return { signals, title: page.title };
}

test('RAMP and LOST sound at once and again while they last, other modes do not', () => {
  const { signals, title } = heard([
    ['TRACK', 0], ['COAST', 100], ['RAMP', 200], ['RAMP', 300], ['RAMP', 3200], ['LOST', 3300], ['LOST', 6299],
  ]);
  assert.deepEqual(signals, ['RAMP', 'RAMP', 'LOST']);
  assert.equal(title, '⚠ LOST · Lightleash');
});

test('a page of a server that has a name is told by it among others', () => {
  const page = { title: '' };
  const alarm = new Alarm(page, () => {});
  alarm.server = 'left';
  alarm.take('TRACK', 'TRACK', true, 0);
  assert.equal(page.title, 'TRACK · left');
});

test('a fault that is over is silent, and sounds at once when it comes back', () => {
  const { signals, title } = heard([['RAMP', 0], ['DISARMED', 10], ['DISARMED', 9000], ['RAMP', 9010], ['TRACK', 9020]]);
  assert.deepEqual(signals, ['RAMP', 'RAMP']);
  assert.equal(title, 'TRACK · Lightleash');
});

test('one that comes back within the time between two sounds is heard at once, too', () => {
  assert.deepEqual(heard([['RAMP', 0], ['TRACK', 100], ['RAMP', 400]]).signals, ['RAMP', 'RAMP']);
});

test('a server that falls silent is an alarm while a robot is in the air, and none of a page left open', () => {
  assert.deepEqual(heard([['NO_WORD', 0], ['NO_LINK', 100]]).signals, []);
  assert.deepEqual(heard([['NO_WORD', 0], ['NO_LINK', 100]], true).signals, ['NO_WORD', 'NO_LINK']);
});

test('a robot that runs on an empty battery is an alarm in any mode, after those of the mode', () => {
  const page = { title: '' };
  /** @type {Signal[]} */
  const signals = [];
  const alarm = new Alarm(page, (signal) => signals.push(signal));
  for (const [k, mode] of /** @type {ShownMode[]} */ (['TRACK', 'HOLD', 'RAMP']).entries()) {
    alarm.take(mode, mode, true, 1000 * k, true);
    assert.equal(page.title, `⚠ ${mode} · Lightleash`);
  }
  assert.deepEqual(signals, ['EMPTY', 'RAMP']);
  alarm.take('DISARMED', 'DISARMED', false, 9000, false);
  assert.equal(page.title, 'DISARMED · Lightleash');
});

test('a page that is left alone with a fault falls silent after a minute', () => {
  /** @type {[ShownMode, number][]} */
  const hour = Array.from({ length: 36_000 }, (_, i) => ['LOST', 100 * i]);
  assert.equal(heard(hour).signals.length, 20);
});
