import assert from 'node:assert/strict';
import { test } from 'node:test';

import { INITIAL, STATUS_LIFE_MS, goesOn, reduce, requestOf, shownMode, touchOf, untilRamp } from '../../src/ui/session.js';
import { gapWords } from '../../src/ui/mode_words.js';
import { Problem } from '../../src/wire/problems.js';
import { endWords } from '../../src/wire/stop.js';
import { FREE_MS, standbyWords } from '../../src/ui/standby.js';
import { cardOf, mayChoose, mayGive } from '../../src/ui/handover_card.js';
import { healthWords, modeWords, rampWords, robotWords } from '../../src/ui/mode_words.js';
import { holdWords } from '../../src/ui/view.js';
import { statusOf } from '../fakes.js';

/** @import {Effect, Event} from '../../src/ui/session_types.js' */

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
  const ends = [{ type: 'visibility', visible: false }, { type: 'disconnected' }, { type: 'stop', now: 0 }];
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
  const asked = after(...UP, { type: 'stop', now: 0 });
  assert.deepEqual(asked.kinds, ['command', 'post_stop', 'touch']);
  const still = after(...UP, { type: 'stop', now: 0 }, status({ mode: 'TRACK' }), { type: 'stop_tick', now: 50 });
  assert.deepEqual(still.kinds, ['command', 'post_stop']);
  const deaf = after(...UP, { type: 'stop', now: 0 }, { type: 'disconnected' }, { type: 'stop_tick', now: 50 });
  assert.deepEqual(deaf.kinds, ['command', 'post_stop']);
  const done = after(...UP, { type: 'stop', now: 0 }, status({ mode: 'STOPPED' }), { type: 'stop_tick', now: 50 });
  assert.deepEqual([done.state.stopping, done.kinds], [false, []]);
});

test('a STOP without a link is tried for three seconds, then given up, felt and said', () => {
  /** @param {number} now @returns {Event} */
  const tick = (now) => ({ type: 'stop_tick', now });
  /** @type {Event[]} */
  const pressed = [...UP, { type: 'disconnected' }, { type: 'stop', now: 1000 }];
  const late = after(...pressed, tick(4000));
  assert.deepEqual(late.effects, [{ type: 'command', what: 'stop', ageMs: 3000 }, { type: 'post_stop', ageMs: 3000 }]);
  const lost = after(...pressed, tick(4001));
  assert.deepEqual([lost.state.stopping, lost.state.stopEnd], [false, 'unlinked']);
  assert.deepEqual(lost.effects, [{ type: 'feel', mode: 'STOP_LOST' }]);
  const minutes = after(...pressed, tick(4001), tick(4051), { type: 'welcomed' }, status({ mode: 'TRACK' }), tick(300_000));
  assert.deepEqual(minutes.effects, [], 'never to somebody else’s flight');
  const again = after(...pressed, tick(4001), { type: 'stop', now: 9000 });
  assert.deepEqual([again.state.stopEnd, again.kinds], ['', ['command', 'post_stop', 'touch']]);
});

test('that STOP did not arrive is said until the server is heard again, and for at least eight seconds', () => {
  /** @param {...Event} more */
  const lost = (...more) => after(
    ...UP, { type: 'disconnected' }, { type: 'stop', now: 0 }, { type: 'stop_tick', now: 3001 }, ...more,
  ).state.stopEnd;
  assert.equal(lost({ type: 'stop_tick', now: 60_000 }), 'unlinked');
  /** @type {Event[]} */
  const back = [{ type: 'welcomed' }, status({ mode: 'TRACK' })];
  assert.equal(lost(...back, { type: 'stop_tick', now: 11_000 }), 'unlinked');
  assert.equal(lost(...back, { type: 'stop_tick', now: 11_002 }), '');
  assert.equal(lost({ type: 'welcomed' }, status({ mode: 'STOPPED' })), '');
});

test('a STOP that the robot does not confirm is given up too, in other words', () => {
  const { state } = after(...UP, { type: 'stop', now: 0 }, status({ mode: 'LOST' }), { type: 'stop_tick', now: 3001 });
  assert.deepEqual([state.stopping, state.stopEnd], [false, 'unconfirmed']);
});

test('a STOP that is taken beside the socket is believed when the robot shows it, and no sooner', () => {
  /** @param {string} mode @param {boolean} taken @returns {Event} */
  const answer = (mode, taken = true) => ({ type: 'stop_answer', answer: { taken, why: taken ? '' : 'pair anew', mode }, now: 90 });
  /** @type {Event[]} */
  const pressed = [...UP, { type: 'problem', problem: new Problem('shut_out') }, { type: 'stop', now: 0 }];
  const late = { type: /** @type {const} */ ('stop_tick'), now: 3001 };
  const confirmed = after(...pressed, answer('TRACK'), answer('STOPPED'));
  assert.deepEqual([confirmed.state.stopping, confirmed.state.stopEnd], [false, 'stopped']);
  assert.equal(after(...pressed, answer('TRACK')).state.stopping, true);
  assert.equal(after(...pressed, answer('TRACK'), late).state.stopEnd, 'unseen');
  assert.equal(after(...pressed, answer('TRACK'), answer('', false), late).state.stopEnd, 'unseen', 'taken once is taken');
  const refused = after(...pressed, answer('', false), late).state;
  assert.deepEqual([refused.stopEnd, refused.stopAnswer?.why], ['refused', 'pair anew']);
  assert.equal(after(...pressed, late).state.stopEnd, 'unlinked');
  assert.equal(after(...pressed, late, answer('STOPPED')).state.stopEnd, 'unlinked', 'an answer to what was given up');
  assert.equal(after(...UP, { type: 'stop', now: 0 }, answer('STOPPED')).state.stopping, true, 'who hears a Status believes that');
});

test('a fatal fault leaves STOP at work', () => {
  const fault = { type: /** @type {const} */ ('problem'), problem: new Problem('shut_out') };
  const { state, kinds } = after(...UP, fault, { type: 'stop', now: 0 }, { type: 'stop_tick', now: 50 });
  assert.deepEqual([state.phase, kinds], ['welcome', ['command', 'post_stop']]);
  assert.match(endWords('refused', { taken: false, why: 'pair anew', mode: '' }), /^STOP was refused \(pair anew\)\. .* coasts, then ramps down by itself/);
});

test('an arm that nobody hears is given up and said; one that is heard is not told of again', () => {
  const ready = status({ ready: true });
  const asked = after(...UP, ready, { type: 'ask', what: 'arm', now: 0 });
  assert.deepEqual(asked.effects, [{ type: 'command', what: 'arm', ageMs: 0 }]);
  const lost = after(...UP, ready, { type: 'ask', what: 'arm', now: 0 }, { type: 'disconnected' }, { type: 'stop_tick', now: 3001 });
  assert.match(lost.state.notice?.text ?? '', /^Arm did not reach the robot/);
  assert.deepEqual(lost.effects, []);
  const heard = after(...UP, ready, { type: 'ask', what: 'arm', now: 0 }, status({ mode: 'ARMED' }), { type: 'disconnected' },
    { type: 'stop_tick', now: 3001 });
  assert.equal(heard.state.notice, null);
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

test('a thruster that gives less is felt once, a change of mode before it', () => {
  /** @type {Parameters<typeof status>[0]} */
  const weak = { mode: 'TRACK', thrusters_weak: ['Thruster 2 gives no thrust.'] };
  const flying = [...UP, status({ mode: 'TRACK' })];
  assert.deepEqual(after(...flying, status(weak)).effects, [{ type: 'feel', mode: 'WEAK' }]);
  assert.deepEqual(after(...flying, status(weak), status(weak)).effects, []);
  const two = { ...weak, thrusters_weak: [...weak.thrusters_weak ?? [], 'Thruster 5 gives 60 % of its thrust.'] };
  assert.deepEqual(after(...flying, status(weak), status(two)).effects, [{ type: 'feel', mode: 'WEAK' }]);
  assert.deepEqual(after(...flying, status({ ...weak, mode: 'RAMP' })).effects, [{ type: 'feel', mode: 'RAMP' }]);
  assert.deepEqual(after(...flying, status(weak), status({ mode: 'TRACK' })).effects, []);
});

test('a battery that gets worse is felt once, an empty one by itself', () => {
  /** @param {import('../../src/wire/protocol_types.js').Status['battery'][]} levels */
  const felt = (...levels) => after(
    ...UP, ...levels.map((battery) => status({ mode: 'TRACK', battery })),
  ).effects;
  assert.deepEqual(felt('good', 'low'), [{ type: 'feel', mode: 'WEAK' }]);
  assert.deepEqual(felt('low', 'low'), []);
  assert.deepEqual(felt('low', 'empty'), [{ type: 'feel', mode: 'EMPTY' }]);
  assert.deepEqual(felt('good', 'unknown'), [{ type: 'feel', mode: 'WEAK' }]);
  assert.deepEqual(felt('empty', 'good'), []);
  assert.deepEqual(felt('untold', 'told'), []);
});

test('what the robot tells of itself is said once, though it also keeps it from being armed', () => {
  const empty = "The robot's battery is empty (9.8 V): charge it before arming.";
  assert.deepEqual(healthWords(statusOf({ health: [empty] })), [empty]);
  assert.deepEqual(healthWords(statusOf({ health: [empty], refusals: [empty] })), []);
  assert.deepEqual(healthWords(null), []);
});

test('the robot is named with what its battery has, and without one alone', () => {
  assert.equal(robotWords(null), '–');
  assert.equal(robotWords(statusOf({ robot: 'ames' })), 'ames');
  assert.equal(robotWords(statusOf({ robot: 'ames', battery: 'told', battery_v: 11.25 })), 'ames · battery 11.3 V');
  assert.equal(robotWords(statusOf({ robot: 'ames', battery: 'unknown' })), 'ames · battery not known');
});

test('arming is offered when the server is ready and nobody holds', () => {
  const ready = status({ ready: true });
  assert.deepEqual(requestOf(after(...UP).state), { what: 'arm', enabled: false });
  assert.deepEqual(requestOf(after(...UP, ready).state), { what: 'arm', enabled: true });
  assert.deepEqual(requestOf(after(...UP, ready, { type: 'press' }).state), { what: 'arm', enabled: false });
  assert.deepEqual(requestOf(after(...UP, ready, { type: 'tick', now: 9e9 }).state), { what: 'arm', enabled: false });
});

test('what is armed can be disarmed; what is stopped waits for a supervisor', () => {
  for (const mode of /** @type {const} */ (['ARMED', 'TRACK', 'HOLD'])) {
    assert.deepEqual(requestOf(after(...UP, status({ mode })).state), { what: 'disarm', enabled: true });
  }
  const stopped = status({ mode: 'STOPPED' });
  assert.deepEqual(requestOf(after(...UP, stopped).state), { what: 'arm', enabled: false });
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
  assert.deepEqual([taken.state.phase, taken.state.standby, taken.kinds], ['operating', true, ['stand_by']]);
  assert.equal(after(...UP, refused('role', true), { type: 'disconnected' }, { type: 'welcomed' }).state.problem, null);
});

test('no event is able to hold the button by itself', () => {
  /** @type {Event[]} */
  const others = [
    { type: 'start' }, { type: 'started' }, { type: 'welcomed' }, { type: 'disconnected' }, { type: 'release' },
    { type: 'tick', now: 1 }, { type: 'ping', nonce: 1n }, { type: 'visibility', visible: true }, { type: 'stop', now: 0 },
    { type: 'stop_tick', now: 50 }, { type: 'ask', what: 'arm', now: 0 }, status({ mode: 'TRACK' }), { type: 'step', text: '' },
    { type: 'motion_silent', silent: true }, { type: 'notice', text: '', now: 0 }, { type: 'health', health: INITIAL.health },
  ];
  for (const first of others) {
    for (const second of others) assert.equal(after(...UP, first, second).state.held, false);
  }
});

test('who holds is told truly whether to wait or to press again', () => {
  /** @param {...Event} more */
  const words = (...more) => {
    const { state } = after(...UP, status({ mode: 'TRACK' }), { type: 'press' }, ...more);
    const ramps = rampWords(untilRamp(state)?.seconds ?? null, state.status);
    return holdWords(state.held, shownMode(state), goesOn(state), ramps);
  };
  const coast = words(status({ mode: 'COAST', resumes: true, until_ramp_ms: 840 }));
  assert.deepEqual([coast.title, coast.hint], ['Keep holding', 'It goes on by itself']);
  const hold = status({ mode: 'HOLD', until_ramp_ms: 2500 });
  const over = words(hold);
  assert.deepEqual([over.look, over.title, over.hint], ['again', 'Let go and press again', 'Thrust fades in 3 s']);
  assert.equal(words(hold, { type: 'release' }).title, 'Hold to move');
  const pressed = words(hold, { type: 'release' }, { type: 'press' });
  assert.equal(pressed.title, 'Keep holding', 'the server does not know of that press yet');
  const latched = words(status({ mode: 'HOLD', resumes: true, until_ramp_ms: 900 }));
  assert.equal(latched.hint, 'It follows in a moment');
  assert.equal(words(status({ mode: 'RAMP' })).title, 'Let go');
});

test('of a robot without thrusters nothing is said of thrust', () => {
  const [thrusts, twist] = [statusOf(), statusOf({ takes: 'twist' })];
  assert.deepEqual(modeWords('STOPPED', thrusts), ['STOPPED', 'Thrust is off']);
  assert.deepEqual(modeWords('STOPPED', twist), ['STOPPED', 'Told to stand still']);
  /** @type {import('../../src/ui/session_types.js').ShownMode[]} */
  const modes = ['DISARMED', 'ARMED', 'TRACK', 'COAST', 'HOLD', 'RAMP', 'STOPPED', 'LOST', 'NO_LINK', 'NO_WORD'];
  for (const mode of modes) assert.doesNotMatch(modeWords(mode, twist).join(' '), /thrust/i);
  assert.deepEqual(modeWords('TRACK', twist), modeWords('TRACK', null));
  assert.deepEqual([rampWords(2, thrusts), rampWords(2, twist)], ['Thrust fades in 2 s', 'Disarms in 2 s']);
  assert.equal(rampWords(null, twist), '');
});

test('the ring empties from the most that was left, through COAST and HOLD, and is full again the next time', () => {
  const [coast, hold, track] = [
    status({ mode: 'COAST', until_ramp_ms: 850 }), status({ mode: 'HOLD', until_ramp_ms: 2000 }), status({ mode: 'TRACK' }),
  ];
  const half = status({ mode: 'HOLD', until_ramp_ms: 1000 });
  assert.deepEqual(untilRamp(after(...UP, coast, hold, half).state), { seconds: 1, share: 0.5 });
  assert.equal(untilRamp(after(...UP, coast, hold, track).state), null);
  assert.deepEqual(untilRamp(after(...UP, hold, track, half).state), { seconds: 1, share: 1 });
  assert.equal(untilRamp(after(...UP, hold, { type: 'tick', now: 501 }).state), null, 'old news count nothing down');
  assert.equal(untilRamp(after(...UP, hold, { type: 'disconnected' }).state), null);
});

test('a page that was too busy says so, for it was no link; one that was hidden was not busy', () => {
  /** @param {...Event} more */
  const notice = (...more) => after(...UP, status({ mode: 'TRACK' }), { type: 'tick', now: 100 }, ...more).state.notice?.text;
  assert.equal(notice({ type: 'tick', now: 350 }), undefined);
  assert.equal(notice({ type: 'tick', now: 500 }), 'This phone was too busy for 0.4 s: close other apps, end power saving, let it cool down.');
  assert.equal(notice({ type: 'visibility', visible: false }, { type: 'visibility', visible: true }, { type: 'tick', now: 9000 }),
    undefined);
  const seldom = [1000, 2000, 3000].flatMap((now) => [status({ mode: 'HOLD' }, now), /** @type {const} */ ({ type: 'tick', now })]);
  assert.equal(notice({ type: 'visibility', visible: false }, ...seldom), undefined, 'browsers tick seldom in hidden pages');
  const { state, effects } = after(...UP, status({ mode: 'TRACK' }), { type: 'tick', now: 100 }, { type: 'tick', now: 500 });
  assert.deepEqual(effects.find(({ type }) => type === 'tell'), { type: 'tell', text: state.notice?.text }, 'to the supervisor, too');
});

test('gaps are told by their number and the side of most of them', () => {
  const gap = (/** @type {number} */ count) => ({ count, longest_ms: 300 * Math.sign(count) });
  assert.equal(gapWords({}), '0');
  assert.equal(gapWords({ phone: gap(0), robot: gap(0), server: gap(0) }), '0');
  assert.equal(gapWords({ phone: gap(1), robot: gap(0), server: gap(4) }), '5 computer');
});

/** @param {string} id @param {object} parts */
const person = (id, parts = {}) => ({
  id, name: id, role: /** @type {const} */ ('operator'), state: /** @type {const} */ ('in'), code: '', address: '', since_s: 0,
  connected: true, leads: false, offered: false, ...parts,
});
/** @type {Event[]} */
const ASIDE = [{ type: 'start' }, { type: 'started' },
  { type: 'refused', refused: { type: 'refused', code: 'role', field: 'hello', allowed: '', fatal: true }, now: 0 }, { type: 'watching', you: 'me' }];

test('a phone that does not lead shows the robot’s true mode, may STOP, and neither arms nor holds', () => {
  const aside = after(...ASIDE, status({ mode: 'ARMED', ready: true, people: [person('Anna', { leads: true }), person('me')] }), { type: 'press' });
  assert.equal(shownMode(aside.state), 'ARMED');
  assert.deepEqual([requestOf(aside.state).enabled, aside.state.held, standbyWords(aside.state).slice(0, 11)], [false, false, 'Anna leads.']);
  assert.deepEqual(after(...ASIDE, { type: 'stop', now: 0 }).kinds, ['command', 'post_stop', 'touch']);
});

test('it asks for the lead when nobody has had it for a while, and never for one that is kept for somebody', () => {
  /** @param {object[]} people @param {number[]} ticks */
  const asks = (people, ...ticks) => after(...ASIDE, ...ticks.flatMap((now) => [
    status({ people: /** @type {any} */ (people) }, now), { type: /** @type {const} */ ('tick'), now },
  ])).kinds.includes('ask_lead');
  assert.equal(asks([person('me')], 0, FREE_MS), false);
  assert.equal(asks([person('me')], 0, FREE_MS + 1), true);
  assert.equal(asks([person('me', { leads: true })], 0, FREE_MS + 1), true, 'this browser’s own page, which may be gone');
  for (const other of [person('Anna', { leads: true }), person('Anna', { offered: true })]) {
    assert.equal(asks([person('me'), other], 0, FREE_MS + 1), false);
  }
  assert.equal(asks([person('me', { offered: true })], 0, FREE_MS + 1), false, 'that takes a tap');
  /** @type {Event[]} */
  const gave = [...UP, ...ASIDE.slice(2), status({ people: [person('me')] }), { type: 'tick', now: 0 }, { type: 'tick', now: 501 }];
  assert.ok(after(...gave.slice(0, -1), status({ people: [person('me')] }, 501), { type: 'tick', now: 501 }).kinds.includes('ask_lead'), 'who led last is first');
  assert.deepEqual(after(...ASIDE, { type: 'take_lead' }).kinds, ['ask_lead']);
  assert.deepEqual(after(...ASIDE, { type: 'disconnected' }).kinds, ['stand_by'], 'no asking by the link itself');
});

test('the lead is handed to another operator who is there, while the robot is disarmed', () => {
  const people = [person('me', { leads: true }), person('Ben'), person('Cleo', { connected: false }), person('Dan', { role: 'viewer' }),
    person('Eve', { state: 'waiting' })];
  /** @type {Event[]} */
  const mine = [{ type: 'start' }, { type: 'started' }, { type: 'welcomed', you: 'me' }];
  const led = after(...mine, status({ people })).state;
  assert.deepEqual(cardOf(led, true, '').names, [{ id: 'Ben', name: 'Ben' }], 'nothing in it that changes under a finger');
  assert.equal(cardOf(led, false, '').phase, 'off');
  assert.equal(mayGive(led), true);
  assert.equal(mayGive(after(...mine, status({ mode: 'TRACK', people })).state), false);
  assert.equal(mayGive(after(...mine, status({ people: people.slice(0, 1) })).state), false);
  /** @type {[Event, boolean][]} */
  const next = [[{ type: 'tick', now: 10_000 }, true], [status({ mode: 'LOST', people }), true], [status({ people: [] }), true],
    [status({ mode: 'ARMED', people }), false], [{ type: 'disconnected' }, false]];
  for (const [event, stays] of next) {
    const { state } = after(...mine, status({ people }), event);
    assert.deepEqual([mayGive(state), mayChoose(state)], [false, stays], 'a moment without word closes no choice');
  }
  /** @param {string} heir @param {boolean} led */
  const aside = (heir, led) => after(...ASIDE, status({ people: [person('me', { offered: heir === 'me' }), person('Ben', { offered: heir === 'Ben' }),
    person('Anna', { leads: led })] })).state;
  assert.deepEqual([cardOf(aside('me', false), false, '').phase, cardOf(aside('me', false), false, '').mayGo], ['offered', true]);
  assert.equal(cardOf(aside('me', true), false, '').mayGo, false, 'the robot comes down first');
  assert.equal(cardOf(aside('Ben', false), false, 'Ben').phase, 'given');
  assert.equal(cardOf(aside('Ben', false), false, '').phase, 'off');
});
