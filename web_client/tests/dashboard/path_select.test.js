import assert from 'node:assert/strict';
import { test } from 'node:test';

import { PATIENCE_MS } from '../../src/dashboard/runtime_parameters.js';
import { PathSelect } from '../../src/dashboard/path_select.js';

/** @import {PathChoice} from '../../src/wire/protocol_types.js' */

function made() {
  const time = { ms: 0 };
  /** @type {PathChoice[]} */
  const sent = [];
  const select = { value: 'auto', disabled: true, addEventListener: (/** @type {string} */ _, /** @type {() => void} */ heard) => { change = heard; } };
  let change = () => {};
  const document = /** @type {any} */ ({ getElementById: () => select });
  const path = new PathSelect(document, (choice) => void sent.push(choice), () => time.ms);
  /** @param {string} value */
  const choose = (value) => {
    select.value = value;
    change();
  };
  return { path, select, sent, time, choose };
}

/** @type {(wish: PathChoice['wish'], by?: PathChoice['by']) => PathChoice} */
const choice = (wish, by = '') => ({ type: 'path', wish, by });

test('without a phone that has several ways nothing can be chosen', () => {
  const { path, select } = made();
  path.take(choice('JPEG'));
  assert.deepEqual([select.disabled, select.value], [false, 'JPEG']);
  path.take(null);
  assert.deepEqual([select.disabled, select.value], [true, 'auto']);
});

test('a choice is sent at once, and shown until the phone obeys; then the operator’s next one is', () => {
  const { path, select, sent, choose } = made();
  path.take(choice('auto'));
  choose('WebSocket');
  assert.deepEqual(sent, [choice('WebSocket', 'supervisor')]);
  path.take(choice('auto'));
  assert.equal(select.value, 'WebSocket');
  path.take(choice('WebSocket', 'supervisor'));
  path.take(choice('WebRTC', 'operator'));
  assert.equal(select.value, 'WebRTC');
  assert.equal(sent.length, 1);
});

test('a choice that the phone does not obey is forgotten', () => {
  const { path, select, time, choose } = made();
  path.take(choice('auto'));
  choose('JPEG');
  time.ms = PATIENCE_MS + 1;
  path.take(choice('auto'));
  assert.equal(select.value, 'auto');
});
