/** What is felt again while it lasts: how soon, how often, and of what. */

/** @import {Signal} from '../../src/ui/session_types.js' */

import assert from 'node:assert/strict';
import test from 'node:test';
import { Lasting, lastingSignal } from '../../src/ui/lasting.js';
import { INITIAL } from '../../src/ui/session.js';
import { statusOf } from '../fakes.js';

/** @param {[Signal | null, number][]} looks */
function felt(looks) {
  /** @type {[Signal, number][]} */
  const signals = [];
  let at = 0;
  const lasting = new Lasting((signal) => signals.push([signal, at]), { againMs: 1000, most: 3 });
  for (const [signal, now] of looks) {
    at = now;
    lasting.take(signal, now);
  }
  return signals;
}

test('what lasts is felt at once and again, and not for ever', () => {
  /** @type {[Signal | null, number][]} */
  const looks = Array.from({ length: 200 }, (_, i) => ['RAMP', 50 * i]);
  assert.deepEqual(felt(looks), [['RAMP', 0], ['RAMP', 1000], ['RAMP', 2000]]);
});

test('a limit that a trembling hand crosses again and again is not felt all the time', () => {
  /** @type {[Signal | null, number][]} */
  const looks = Array.from({ length: 41 }, (_, i) => [i % 2 ? null : 'LIMIT', 50 * i]);
  assert.deepEqual(felt(looks), [['LIMIT', 0], ['LIMIT', 1000], ['LIMIT', 2000]]);
});

test('another fault is felt at once', () => {
  assert.deepEqual(felt([['LIMIT', 0], ['COAST', 10], ['RAMP', 20]]).map(([signal]) => signal), ['LIMIT', 'COAST', 'RAMP']);
});

test('what a change of mode signalled is not signalled twice', () => {
  /** @type {Signal[]} */
  const signals = [];
  const lasting = new Lasting((signal) => signals.push(signal), { againMs: 1000, most: 3 });
  lasting.felt('RAMP', 0);
  lasting.take('RAMP', 20);
  assert.deepEqual(signals, []);
  lasting.take('RAMP', 1000);
  assert.deepEqual(signals, ['RAMP']);
});

test('an empty battery is felt while the robot flies, faults before it and the end of its reach after', () => {
  /** @param {Parameters<typeof statusOf>[0]} parts */
  const lasting = (parts) =>
    lastingSignal({ ...INITIAL, phase: 'operating', linked: true, heard: true, status: statusOf({ battery: 'empty', ...parts }) });
  assert.equal(lasting({ mode: 'TRACK' }), 'EMPTY');
  assert.equal(lasting({ mode: 'HOLD' }), 'EMPTY');
  assert.equal(lasting({ mode: 'TRACK', at_limit: true }), 'EMPTY');
  assert.equal(lasting({ mode: 'RAMP' }), 'RAMP');
  assert.equal(lasting({ mode: 'DISARMED' }), null);
  assert.equal(lasting({ mode: 'TRACK', battery: 'low' }), null);
});

test('a robot at the end of its reach is felt while it follows, and faults before it', () => {
  /** @param {Parameters<typeof statusOf>[0]} parts */
  const lasting = (parts, more = {}) =>
    lastingSignal({ ...INITIAL, phase: 'operating', linked: true, heard: true, status: statusOf(parts), ...more });
  assert.equal(lasting({ mode: 'TRACK' }), null);
  assert.equal(lasting({ mode: 'TRACK', at_limit: true }), 'LIMIT');
  assert.equal(lasting({ mode: 'HOLD', at_limit: true }), null);
  assert.equal(lasting({ mode: 'RAMP', at_limit: true }), 'RAMP');
  assert.equal(lasting({ mode: 'TRACK', at_limit: true }, { linked: false }), 'NO_LINK');
  assert.equal(lasting({ mode: 'LOST' }, { standby: true }), null);
  assert.equal(lasting({ mode: 'LOST' }, { phase: 'welcome' }), null);
});
