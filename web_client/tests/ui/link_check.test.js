import assert from 'node:assert/strict';
import { test } from 'node:test';

import { INITIAL, reduce } from '../../src/ui/session.js';
import { LEAST_MS, LISTEN_MS, LinkCheck, wordsOf } from '../../src/ui/link_check.js';
import { FakeTime, statusOf } from '../fakes.js';

/** @import {LinkReport, Status} from '../../src/wire/protocol_types.js' */

/** @type {LinkReport} */
const REPORT = {
  grade: 'fair', title: 'Usable', lines: ['a', 'b'], advice: ['c'], seconds: 60, follows: 0.97, waits: 3, ends: 0,
  sides: {}, gaps: {}, longest_ms: 300, rtt_ms: 12, rtt_p95_ms: 40, lost: 0, motion_hz: 60, picture_hz: 30,
  picture_age_ms: 80, picture_gap_ms: 100,
};

/** The page with a server that answers when the test says so. */
function page() {
  /** @type {Map<string, any>} */
  const elements = new Map();
  const time = new FakeTime();
  /** @type {{ path: string, answer: (response: Response) => void }[]} */
  const asked = [];
  const document = {
    createElement: () => ({ textContent: '' }),
    /** @param {string} id */
    getElementById(id) {
      if (!elements.has(id)) {
        elements.set(id, {
          dataset: {}, hidden: false, classList: { toggle() {} }, items: [],
          /** @param {any[]} items */
          replaceChildren(...items) { this.items = items.map((item) => item.textContent); },
          /** @param {string} _ @param {() => void} heard */
          addEventListener(_, heard) { this.click = heard; },
        });
      }
      return elements.get(id);
    },
  };
  /** @type {import('../../src/wire/pairing.js').Fetch} */
  const fetch = (path) => new Promise((answer) => { asked.push({ path, answer }); });
  const check = new LinkCheck(/** @type {any} */ (document), time, fetch);
  /** @param {Status['mode']} mode */
  const show = (mode) => {
    /** @type {import('../../src/ui/session_types.js').Event[]} */
    const events = [{ type: 'started' }, { type: 'welcomed' }, { type: 'status', status: statusOf({ mode }), now: 0 }];
    check.render(events.reduce((state, event) => reduce(state, event).state, INITIAL));
  };
  const settle = () => new Promise((resolve) => { setImmediate(resolve); });
  return { check, time, asked, show, settle, find: (/** @type {string} */ id) => document.getElementById(id) };
}

test('a link is listened to for a minute, then the server tells', async () => {
  const { check, time, asked, show, settle, find } = page();
  show('DISARMED');
  assert.equal(find('link-check-start').hidden, false);
  find('link-check-start').click();
  time.advance(LISTEN_MS - 1);
  show('DISARMED');
  assert.equal(asked.length, 0);
  assert.match(find('link-check-title').textContent, /1 s left$/);
  time.advance(1);
  show('DISARMED');
  show('DISARMED');
  assert.deepEqual(asked.map(({ path }) => path), ['api/link?seconds=60'], 'asked once');
  asked[0]?.answer(Response.json(REPORT));
  await settle();
  assert.equal(check.check.phase, 'told');
  assert.deepEqual(
    [find('link-check-title').textContent, find('link-check-lines').items, find('link-check-advice').items],
    ['! Usable', ['a', 'b'], ['c']],
  );
  find('link-check-leave').click();
  assert.equal(find('link-check').hidden, true);
});

test('who has heard enough asks sooner, but not before there is something to say', () => {
  const { time, asked, show, find } = page();
  show('DISARMED');
  find('link-check-start').click();
  time.advance(LEAST_MS - 1);
  show('DISARMED');
  assert.equal(find('link-check-go').disabled, true);
  time.advance(2001);
  show('DISARMED');
  assert.equal(find('link-check-go').disabled, false);
  find('link-check-go').click();
  assert.deepEqual(asked.map(({ path }) => path), ['api/link?seconds=7']);
});

test('who arms flies: a check ends, and none begins', async () => {
  const { check, asked, show, settle, find } = page();
  show('DISARMED');
  find('link-check-start').click();
  show('ARMED');
  assert.deepEqual([check.check.phase, find('link-check-start').hidden], ['off', true]);
  check.begin();
  void check.ask(LISTEN_MS);
  show('TRACK');
  asked[0]?.answer(Response.json(REPORT));
  await settle();
  assert.equal(check.check.phase, 'off', 'an answer that comes later opens nothing');
});

test('a check that can not be made says why', async () => {
  const { check, asked, show, settle, find } = page();
  show('DISARMED');
  find('link-check-start').click();
  check.render({ ...INITIAL, phase: 'operating' });
  assert.deepEqual([check.check.phase, find('link-check-hint').textContent], ['failed', 'The link was lost.']);
  show('DISARMED');
  void check.ask(LISTEN_MS);
  asked[0]?.answer(Response.json({ field: 'phone', allowed: 'while a phone leads' }, { status: 409 }));
  await settle();
  assert.equal(find('link-check-hint').textContent, 'phone: while a phone leads');
});

test('a verdict is told by a sign and by words, not by its colour alone', () => {
  /** @param {LinkReport['grade']} grade */
  const title = (grade) => wordsOf({ phase: 'told', report: { ...REPORT, grade } }, 0).title;
  assert.deepEqual([title('good'), title('fair'), title('poor')], ['✓ Usable', '! Usable', '✕ Usable']);
});
