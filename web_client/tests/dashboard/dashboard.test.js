import assert from 'node:assert/strict';
import { test } from 'node:test';

import { age, alarm, gapLine, metres, number, scaleEnd, streamName, screenWords } from '../../src/dashboard/format.js';
import { EMPTY, REMEMBERED, beforeArming, reduce, requests, shownMode } from '../../src/dashboard/model.js';
import { INVITE_LIFE_MS, PhoneCard } from '../../src/dashboard/phone_card.js';
import { Problem } from '../../src/wire/problems.js';
import { niceEnd } from '../../src/dashboard/sparkline.js';
import { statusOf } from '../fakes.js';

/** @import {Event} from '../../src/dashboard/model.js' */

/** @param {...Event} events */
const after = (...events) => events.reduce(reduce, EMPTY);
/** @param {Parameters<typeof statusOf>[0]} parts @returns {Event} */
const status = (parts = {}, now = 0) => ({ type: 'status', status: statusOf(parts), now });

test('the mode shown is never older than half a second', () => {
  assert.equal(shownMode(after()), 'NO_LINK');
  assert.equal(shownMode(after({ type: 'welcomed' })), 'NO_WORD');
  assert.equal(shownMode(after({ type: 'welcomed' }, status({ mode: 'TRACK' }), { type: 'tick', now: 500 })), 'TRACK');
  assert.equal(shownMode(after({ type: 'welcomed' }, status(), { type: 'tick', now: 501 })), 'NO_WORD');
});

test('STOP is asked for until the robot has stopped', () => {
  assert.equal(after({ type: 'stop', now: 0 }, status({ mode: 'TRACK' })).stopping, true);
  assert.equal(after({ type: 'stop', now: 0 }, status({ mode: 'STOPPED' })).stopping, false);
});

test('a page that was shut out keeps STOP, and says what became of it', () => {
  /** @type {Event[]} */
  const out = [{ type: 'paired' }, { type: 'problem', problem: new Problem('shut_out') }, { type: 'stop', now: 0 }];
  /** @param {boolean} taken @param {string} mode @returns {Event} */
  const answer = (taken, mode) => ({ type: 'stop_answer', answer: { taken, why: 'pair anew', mode } });
  assert.equal(after(...out).known, true);
  assert.match(after(...out, answer(true, 'STOPPED')).notice?.text ?? '', /^STOPPED/);
  const refused = after(...out, answer(false, ''), { type: 'stop_tick', now: 3001 });
  assert.match(refused.notice?.text ?? '', /^STOP was refused \(pair anew\)/);
});

test('a STOP without a link is given up after three seconds, and said until the robot is seen at rest', () => {
  /** @type {Event[]} */
  const pressed = [{ type: 'disconnected' }, { type: 'stop', now: 0 }, { type: 'stop_tick', now: 3000 }];
  assert.equal(after(...pressed).stopping, true);
  const lost = after(...pressed, { type: 'stop_tick', now: 3001 }, { type: 'tick', now: 1e9 });
  assert.equal(lost.stopping, false);
  assert.match(lost.notice?.text ?? '', /^STOP did not reach the robot/);
  const flying = [{ type: 'welcomed' }, status({ mode: 'TRACK' })].reduce(/** @type {any} */ (reduce), lost);
  assert.match(flying.notice?.text ?? '', /^STOP did not reach the robot/);
  assert.equal(reduce(flying, status({ mode: 'STOPPED' })).notice, null);
  assert.equal(reduce(flying, { type: 'stop', now: 9000 }).notice, null);
});

test('the history keeps the last 200 samples', () => {
  let board = EMPTY;
  for (let i = 0; i < 500; i++) board = reduce(board, status({ error_mm: i }));
  assert.equal(board.history.length, REMEMBERED);
  assert.equal(board.history.at(-1)?.errorMm, 499);
});

test('wishes follow the mode', () => {
  assert.deepEqual(requests(after({ type: 'welcomed' }, status({ ready: true }))), { arm: true, disarm: false, reset: false });
  assert.deepEqual(requests(after({ type: 'welcomed' }, status({ mode: 'HOLD' }))), { arm: false, disarm: true, reset: false });
  assert.deepEqual(requests(after({ type: 'welcomed' }, status({ mode: 'STOPPED' }))), { arm: false, disarm: false, reset: true });
  assert.deepEqual(requests(after(status({ ready: true }))), { arm: false, disarm: false, reset: false });
});

test('what is in the way of arming is told while it is not armed', () => {
  const refusals = ['No phone is connected'];
  const told = beforeArming(statusOf({ refusals }));
  assert.deepEqual(told, { title: 'Before arming', badge: '1 to mend', tone: 'bad', lines: refusals, fine: false });
  assert.deepEqual(beforeArming(statusOf({ ready: true })).lines, ['Nothing is in the way']);
  assert.deepEqual(beforeArming(statusOf({ mode: 'STOPPED', refusals })).lines, refusals);
  for (const mode of /** @type {const} */ (['ARMED', 'TRACK', 'COAST', 'HOLD', 'RAMP'])) {
    const { title, badge, lines } = beforeArming(statusOf({ mode, refusals: ['Already armed.'] }));
    assert.deepEqual([title, badge, lines], ['While armed', mode.toLowerCase(), []]);
  }
});

test('a fatal refusal blocks the page, another passes by', () => {
  /** @param {string} code @param {boolean} fatal @returns {Event} */
  const refused = (code, fatal) => ({
    type: 'refused', refused: { type: 'refused', code, field: 'hello', allowed: 'supervisors', fatal }, now: 0,
  });
  assert.equal(after(refused('role', true)).problem?.code, 'wrong_role');
  assert.equal(after(refused('value', true)).problem?.code, 'refused');
  assert.equal(after(refused('rate', false)).notice?.text, 'Not taken: hello: supervisors');
  assert.equal(after(refused('rate', false), { type: 'tick', now: 5000 }).notice, null);
  assert.equal(after({ type: 'stop', now: 0 }, refused('age', false)).notice, null); // STOP is said again
  assert.match(after(refused('age', false)).notice?.text ?? '', /Not taken/);
});

test('numbers read well and have a dash for the unknown', () => {
  assert.deepEqual([number(1.26, 1), number(null), number(undefined), number(NaN)], ['1.3', '–', '–', '–']);
  assert.deepEqual([age(null), age(12.4), age(9999), age(12_345)], ['–', '12 ms', '9999 ms', '12 s']);
  assert.deepEqual([alarm(10), alarm(60), alarm(150), alarm(null)], ['', 'warn', 'bad', 'bad']);
  assert.deepEqual([metres([3000, 0, 4000]), metres(null)], [5, null]);
  assert.deepEqual([scaleEnd(0), scaleEnd(101), scaleEnd(1e5)], [100, 200, 1e5]);
  assert.deepEqual([streamName('phone_imu'), streamName('new')], ['Phone motion', 'new']);
  assert.deepEqual([0, 0.07, 1, 3, 5.1, 99].map(niceEnd), [1, 0.1, 1, 5, 10, 100]);
});

/** @param {{ url: string, qr_svg: string } | null} answer */
function cardOf(answer) {
  /** @type {Record<string, any>} */
  const elements = {};
  for (const id of ['picture', 'qr', 'url', 'invite', 'code']) {
    elements[id] = { hidden: true, src: '', textContent: '', href: '', setAttribute() {} };
  }
  const urls = { made: 0, revoked: 0 };
  const fetched = { count: 0 };
  const card = new PhoneCard(
    /** @type {any} */ ({ getElementById: (/** @type {string} */ id) => elements[id] }),
    { createObjectURL: () => `blob:${++urls.made}`, revokeObjectURL: () => { urls.revoked += 1; } },
    async () => {
      fetched.count += 1;
      return answer;
    },
  );
  return { card, elements, urls, fetched };
}

const turn = () => new Promise((resolve) => { setImmediate(resolve); });

test('without a picture the code is shown and renewed, with one the picture', async () => {
  const { card, elements, urls, fetched } = cardOf({ url: 'https://robot/#k=1', qr_svg: '<svg/>' });
  card.tick(0);
  await turn();
  card.tick(100);
  assert.deepEqual([elements.invite.hidden, elements.picture.hidden, fetched.count], [false, true, 1]);
  card.tick(INVITE_LIFE_MS + 1);
  assert.equal(fetched.count, 2);
  for (let i = 0; i < 50; i++) card.take(new Uint8Array(3), 100_000);
  card.tick(100_050);
  assert.deepEqual([elements.invite.hidden, elements.picture.hidden], [true, false]);
  await turn();
  assert.equal(urls.made - urls.revoked, 2, 'one code and one picture are alive');
  card.tick(103_001);
  assert.equal(elements.invite.hidden, false, 'the picture is too old');
});

test('a code that could not be had is asked for again soon, not at once', async () => {
  const { card, elements, fetched } = cardOf(null);
  card.tick(0);
  await turn();
  card.tick(4000);
  assert.deepEqual([fetched.count, elements.invite.hidden], [1, true]);
  card.tick(5001);
  assert.equal(fetched.count, 2);
});

test('gaps of the last minute are told by side, the longest of each', () => {
  assert.equal(gapLine({}), '');
  const gaps = { phone: { count: 2, longest_ms: 312 }, robot: { count: 0, longest_ms: 0 }, server: { count: 1, longest_ms: 90 } };
  assert.equal(gapLine(gaps), 'Gaps in the last minute: phone 2 (0.31 s) · robot 0 · computer 1 (0.09 s)');
});

test('a screen that must be larger than usual is told by its height', () => {
  assert.equal(screenWords(0.16), 'Robot on a screen');
  assert.equal(screenWords(0.641), 'Robot on a screen 65 cm high');
});

test('a place that is known to kilometres is not drawn, and what is drawn stays readable', () => {
  const { history } = [12, 2e6].reduce(
    (board, sigma_mm) => reduce(board, { type: 'status', status: statusOf({ sigma_mm }), now: 0 }), EMPTY,
  );
  assert.deepEqual(history.slice(-2).map(({ sigmaMm }) => sigmaMm), [12, null]);
});
