import assert from 'node:assert/strict';
import { test } from 'node:test';

import { INITIAL, STATUS_LIFE_MS, reduce, shownMode, touchOf, wish } from '../src/session.js';
import { statusOf } from './fakes.js';

/** @import {Effect, Event} from '../src/session_types.js' */

/** @param {...Event} events */
function after(...events) {
  let state = INITIAL;
  /** @type {Effect[]} */
  let effects = [];
  for (const event of events) ({ state, effects } = reduce(state, event));
  return { state, effects, kinds: effects.map((effect) => effect.type) };
}

/** @param {Parameters<typeof statusOf>[0]} parts @returns {Event} */
const status = (parts = {}, now = 0) => ({ type: 'status', status: statusOf(parts), now });

/** @type {Event[]} */
const UP = [{ type: 'start' }, { type: 'started' }, { type: 'welcomed' }, status()];

test('a press counts and is told at once, a release too', () => {
  const pressed = after(...UP, { type: 'press' });
  assert.deepEqual(pressed.kinds, ['touch']);
  assert.deepEqual(touchOf(pressed.state), { held: true, visible: true, press: 1, nonce: 0n });
  const again = after(...UP, { type: 'press' }, { type: 'release' }, { type: 'press' });
  assert.equal(again.state.press, 2);
  const released = after(...UP, { type: 'press' }, { type: 'release' });
  assert.deepEqual([released.state.held, released.kinds], [false, ['touch']]);
});

test('a second finger neither presses again nor releases twice', () => {
  assert.equal(after(...UP, { type: 'press' }, { type: 'press' }).state.press, 1);
  assert.deepEqual(after(...UP, { type: 'release' }).kinds, []);
});

test('a hidden page, a lost link and STOP release, and only a new press holds again', () => {
  /** @type {Event[]} */
  const ends = [{ type: 'visibility', visible: false }, { type: 'disconnected' }, { type: 'stop' }];
  for (const end of ends) assert.equal(after(...UP, { type: 'press' }, end).state.held, false, end.type);
  const back = after(...UP, { type: 'press' }, { type: 'disconnected' }, { type: 'welcomed' });
  assert.deepEqual([back.state.held, back.state.press], [false, 1]);
});

test('nobody holds while hidden or not linked', () => {
  assert.equal(after(...UP, { type: 'visibility', visible: false }, { type: 'press' }).state.held, false);
  assert.equal(after({ type: 'start' }, { type: 'started' }, { type: 'press' }).state.held, false);
});

test('hiding is told at once', () => {
  const { state, kinds } = after(...UP, { type: 'visibility', visible: false });
  assert.deepEqual([touchOf(state).visible, kinds], [false, ['touch']]);
});

test('each tick tells the touch with the newest nonce, while linked', () => {
  const { state, kinds } = after(...UP, { type: 'ping', nonce: 5n }, { type: 'ping', nonce: 9n }, { type: 'tick', now: 1 });
  assert.deepEqual([touchOf(state).nonce, kinds], [9n, ['touch']]);
  assert.deepEqual(after({ type: 'start' }, { type: 'started' }, { type: 'tick', now: 1 }).kinds, []);
});

test('a nonce does not outlive its connection', () => {
  assert.equal(after(...UP, { type: 'ping', nonce: 5n }, { type: 'disconnected' }).state.nonce, 0n);
});

test('STOP goes both ways, again and again, until the robot has stopped', () => {
  const asked = after(...UP, { type: 'stop' });
  assert.deepEqual(asked.kinds, ['command', 'post_stop', 'touch']);
  const still = after(...UP, { type: 'stop' }, status({ mode: 'TRACK' }), { type: 'stop_tick' });
  assert.deepEqual(still.kinds, ['command', 'post_stop']);
  const deaf = after(...UP, { type: 'stop' }, { type: 'disconnected' }, { type: 'stop_tick' });
  assert.deepEqual(deaf.kinds, ['command', 'post_stop']);
  const done = after(...UP, { type: 'stop' }, status({ mode: 'STOPPED' }), { type: 'stop_tick' });
  assert.deepEqual([done.state.stopping, done.kinds], [false, []]);
});

test('the mode shown is never older than half a second', () => {
  const fresh = after(...UP, { type: 'tick', now: STATUS_LIFE_MS });
  assert.equal(shownMode(fresh.state), 'DISARMED');
  const stale = after(...UP, { type: 'tick', now: STATUS_LIFE_MS + 1 });
  assert.equal(shownMode(stale.state), 'NO_WORD');
  const back = after(...UP, { type: 'tick', now: 900 }, status({ mode: 'HOLD' }, 950));
  assert.equal(shownMode(back.state), 'HOLD');
  assert.equal(shownMode(after(...UP, { type: 'disconnected' }).state), 'NO_LINK');
});

test('a Status from before a reconnection is not believed after it', () => {
  const { state } = after(...UP, { type: 'disconnected' }, { type: 'welcomed' });
  assert.equal(shownMode(state), 'NO_WORD');
});

test('a change of mode is felt once', () => {
  const change = after(...UP, status({ mode: 'ARMED' }));
  assert.deepEqual(change.effects, [{ type: 'feel', mode: 'ARMED' }]);
  assert.deepEqual(after(...UP, status({ mode: 'ARMED' }), status({ mode: 'ARMED' })).effects, []);
});

test('arming is offered when the server is ready and nobody holds', () => {
  const ready = status({ ready: true });
  assert.deepEqual(wish(after(...UP).state), { what: 'arm', enabled: false });
  assert.deepEqual(wish(after(...UP, ready).state), { what: 'arm', enabled: true });
  assert.deepEqual(wish(after(...UP, ready, { type: 'press' }).state), { what: 'arm', enabled: false });
  assert.deepEqual(wish(after(...UP, ready, { type: 'tick', now: 9e9 }).state), { what: 'arm', enabled: false });
});

test('what is armed can be disarmed; what is stopped waits for a supervisor', () => {
  for (const mode of /** @type {const} */ (['ARMED', 'TRACK', 'HOLD'])) {
    assert.deepEqual(wish(after(...UP, status({ mode })).state), { what: 'disarm', enabled: true });
  }
  const stopped = status({ mode: 'STOPPED' });
  assert.deepEqual(wish(after(...UP, stopped).state), { what: 'arm', enabled: false });
});

test('a refusal is a passing remark, a fatal one ends or explains', () => {
  /** @param {string} code @param {boolean} fatal @returns {Event} */
  const refused = (code, fatal) => ({
    type: 'refused', refused: { type: 'refused', code, field: 'motion.time', allowed: 'later', fatal }, now: 0,
  });
  const remark = after(...UP, refused('value', false));
  assert.equal(remark.state.notice?.text, 'Not taken: motion.time: later');
  assert.equal(after(...UP, refused('value', false), { type: 'tick', now: 5001 }).state.notice, null);
  const old = after(...UP, refused('version', true));
  assert.deepEqual([old.state.phase, old.state.problem?.code, old.kinds], ['welcome', 'old_page', ['close_link']]);
  const taken = after(...UP, refused('role', true));
  assert.deepEqual([taken.state.phase, taken.state.problem?.code], ['operating', 'taken']);
  assert.equal(after(...UP, refused('role', true), { type: 'disconnected' }, { type: 'welcomed' }).state.problem, null);
});

test('no event is able to hold the button by itself', () => {
  /** @type {Event[]} */
  const others = [
    { type: 'start' }, { type: 'started' }, { type: 'welcomed' }, { type: 'disconnected' }, { type: 'release' },
    { type: 'tick', now: 1 }, { type: 'ping', nonce: 1n }, { type: 'visibility', visible: true }, { type: 'stop' },
    { type: 'stop_tick' }, { type: 'ask', what: 'arm' }, status({ mode: 'TRACK' }), { type: 'step', text: '' },
    { type: 'motion_silent', silent: true }, { type: 'notice', text: '', now: 0 }, { type: 'health', health: INITIAL.health },
  ];
  for (const first of others) {
    for (const second of others) assert.equal(after(...UP, first, second).state.held, false);
  }
});
