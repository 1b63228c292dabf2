import assert from 'node:assert/strict';
import { test } from 'node:test';

import { rejectedLately, worries } from '../../src/dashboard/estimate.js';
import { signed } from '../../src/dashboard/format.js';
import { EMPTY, reduce } from '../../src/dashboard/model.js';
import { estimateOf, statusOf } from '../fakes.js';

/** The history of a board that heard these counts of rejected lights. @param {(number | null)[]} counts */
function historyOf(counts) {
  return counts.reduce((board, count) => {
    const estimate = count === null ? null : estimateOf({ leds_rejected: count });
    return reduce(board, { type: 'status', status: statusOf({ estimate }), now: 0 });
  }, EMPTY).history;
}

/** @param {Parameters<typeof estimateOf>[0]} parts @param {number[]} counts */
const worry = (parts, counts = [0]) => [...worries(estimateOf(parts), historyOf(counts)).keys()];

test('an honest estimate is no worry, and neither is one that nobody can check', () => {
  for (const nis of [0.5, 1, 2, null]) assert.deepEqual(worry({ nis }), []);
});

test('one surer or less sure than it should be is', () => {
  assert.deepEqual(worry({ nis: 2.01 }), ['nis']);
  assert.deepEqual(worry({ nis: 0.49 }), ['nis']);
  const words = [0.1, 9].map((nis) => worries(estimateOf({ nis }), []).get('nis'));
  assert.notEqual(words[0], words[1]);
});

test('a complaint comes first, in its own words', () => {
  const found = worries(estimateOf({ nis: 9, complaint: 'Restart the camera.' }), historyOf([0, 40]));
  assert.deepEqual([...found.keys()], ['complaint', 'nis', 'rejected']);
  assert.equal(found.get('complaint'), 'Restart the camera.');
});

test('rejected lights worry while they grow in number, not for having been', () => {
  assert.deepEqual(worry({}, [0, 2, 4]), []);
  assert.deepEqual(worry({}, [7000, 7003, 7005]), ['rejected']);
  assert.deepEqual(worry({}, [0, ...Array(21).fill(500)]), []);
});

test('a control process started anew counts from zero, and one not heard yet counts nothing', () => {
  assert.equal(rejectedLately(historyOf([900, 2])), 0);
  assert.equal(rejectedLately(historyOf([null, 900, 903])), 3);
  assert.equal(rejectedLately(historyOf([900, null])), 0);
  assert.equal(rejectedLately([]), 0);
});

test('signs are as wide as each other', () => {
  assert.deepEqual([signed(1.26, 1), signed(-1.26, 1), signed(null)], ['+1.3', '−1.3', '–']);
});

test('a camera that is not the calibrated one comes first of all, its settings are advised on', () => {
  /** @type {any} */
  const camera = { complaint: 'The picture is 10 % larger.', advice: 'Expose shorter.', hint: 'blurred' };
  const found = worries(estimateOf({ complaint: 'Restart.' }), [], camera);
  assert.deepEqual([...found], [['camera', 'The picture is 10 % larger.'], ['complaint', 'Restart.']]);
  assert.equal(worries(estimateOf(), [], { ...camera, complaint: '' }).get('camera'), 'Expose shorter.');
  assert.equal(worries(estimateOf(), [], { ...camera, complaint: '', advice: '' }).size, 0);
});
