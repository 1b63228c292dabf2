import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ASK_MS, LEAST_MS, LONG_MS, MINUTE_MS, PhoneCheck, fileName, gradeWords, wordsOf } from '../../src/check/check.js';

/** @import {Answer} from '../../src/check/check.js' */

/** @param {number} heardS @param {string} [device] @returns {Answer} */
const answer = (heardS, device = 'Pixel 8 / camera 0') => ({
  report: { grade: 'fair', title: 'Usable.', lines: [{ what: 'Pictures', value: '30 a second', grade: 'good', advice: '' }], figures: { device } },
  page: '<!doctype html>',
  heard_s: heardS,
});

/** A check whose server says what `says` makes of the seconds that are asked for. @param {(seconds: number) => Answer | number | Error} says */
function rig(says) {
  const asked = /** @type {number[]} */ ([]);
  const clock = { ms: 1000 };
  const check = new PhoneCheck(async (path) => {
    const seconds = Number(/^api\/check\?seconds=([\d.]+)$/.exec(String(path))?.[1]);
    asked.push(seconds);
    const said = says(seconds);
    if (said instanceof Error) throw said;
    if (typeof said === 'number') return Response.json({ code: 'refused', field: 'phone', allowed: 'while a phone leads' }, { status: said });
    return Response.json(said);
  }, () => clock.ms);
  /** @param {number} ms */
  const wait = async (ms) => {
    for (const end = clock.ms + ms; clock.ms < end;) {
      clock.ms += 250;
      await check.turn();
    }
  };
  return { asked, check, clock, wait };
}

test('a minute is listened to, shown meanwhile, and told at its end', async () => {
  const { asked, check, wait } = rig((seconds) => answer(seconds));
  check.begin(MINUTE_MS);
  await wait(10_000);
  assert.deepEqual(asked, [2, 4, 6, 8, 10]);
  const words = wordsOf(check.check, check.heardMs());
  assert.equal(words.title, 'Listening: 50 s left');
  assert.equal(words.answer?.report.lines.length, 1);
  await wait(52_000);
  assert.equal(check.check.phase, 'told');
  assert.equal(asked.at(-1), 60);
  const told = wordsOf(check.check, 0);
  assert.deepEqual([told.title, told.hint, told.grade], ['! Usable.', 'Pixel 8 / camera 0, 60 s', 'fair']);
  await wait(60_000);
  assert.equal(asked.at(-1), 60);
});

test('five minutes ask for no more than five minutes', async () => {
  const { asked, check, wait } = rig((seconds) => answer(seconds));
  check.begin(LONG_MS);
  await wait(LONG_MS + 2 * ASK_MS);
  assert.equal(Math.max(...asked), 300);
  assert.equal(check.check.phase, 'told');
});

test('a phone that comes, or comes anew, is listened to for all of the time', async () => {
  let cameS = 30;
  const { check, clock, wait } = rig((seconds) => {
    const now = (clock.ms - 1000) / 1000;
    return now < cameS ? 409 : answer(Math.min(seconds, now - cameS));
  });
  check.begin(MINUTE_MS);
  await wait(20_000);
  assert.equal(wordsOf(check.check, check.heardMs()).title, 'Waiting for a phone');
  assert.match(wordsOf(check.check, 0).hint, /phone: while a phone leads/);
  await wait(60_000);
  assert.equal(check.check.phase, 'running');
  cameS = 80;
  await wait(50_000);
  assert.equal(check.check.phase, 'running');
  await wait(20_000);
  assert.equal(check.check.phase, 'told');
});

test('a server that is away is named, and the check goes on', async () => {
  let isAway = false;
  const { check, wait } = rig((seconds) => (isAway ? new TypeError('no network') : answer(seconds)));
  check.begin(MINUTE_MS);
  await wait(10_000);
  isAway = true;
  await wait(4000);
  const words = wordsOf(check.check, check.heardMs());
  assert.equal(words.hint, 'The server does not answer.');
  assert.equal(words.answer?.heard_s, 10);
  isAway = false;
  await wait(50_000);
  assert.equal(check.check.phase, 'told');
});

test('enough is enough once something was heard', async () => {
  const { check, wait } = rig((seconds) => answer(seconds));
  check.begin(MINUTE_MS);
  assert.equal(wordsOf(check.check, 0).mayEnd, false);
  await wait(LEAST_MS + ASK_MS);
  assert.equal(wordsOf(check.check, check.heardMs()).mayEnd, true);
  check.enough();
  assert.equal(check.check.phase, 'told');
  check.begin(MINUTE_MS);
  check.enough();
  assert.deepEqual(wordsOf(check.check, 0).title, '✕ Not checked');
});

test('an answer that comes after its check has ended is forgotten', async () => {
  const { check, clock } = rig((seconds) => answer(seconds));
  check.begin(MINUTE_MS);
  clock.ms += ASK_MS;
  const late = check.turn();
  check.enough();
  await late;
  assert.equal(check.check.phase, 'failed');
});

test('grades are told by a mark and a word', () => {
  assert.deepEqual((/** @type {const} */ (['good', 'fair', 'poor', 'unknown'])).map(gradeWords), ['✓ good', '! fair', '✕ poor', '? unknown']);
});

test('files are named as files may be', () => {
  assert.equal(fileName(answer(60), 'html'), 'phone-check-pixel-8-camera-0.html');
  assert.equal(fileName(answer(60, '../../é'), 'json'), 'phone-check-phone.json');
});
