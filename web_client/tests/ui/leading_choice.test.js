import assert from 'node:assert/strict';
import { test } from 'node:test';

import { CHOICE_MS, LeadingChoice, leadWords } from '../../src/ui/leading_choice.js';

/** @import {Lead, LeadingStatus} from '../../src/wire/protocol_types.js' */

/** A select as a browser has it: an unknown value shows nothing. @param {string} id @param {string[]} values */
function select(id, values) {
  const document = { createElement: () => ({ value: '', textContent: '' }) };
  const options = values.map((value) => ({ value, text: `its ${value}`, disabled: false }));
  let value = values[0] ?? '';
  /** @type {() => void} */
  let heard = () => {};
  return {
    id, options, disabled: false, ownerDocument: document,
    get value() { return value; },
    set value(wanted) { value = options.some((one) => one.value === wanted) ? wanted : ''; },
    get selectedOptions() { return options.filter((one) => one.value === value); },
    append: (/** @type {any} */ option) => void options.push({ text: option.textContent, disabled: false, value: option.value }),
    addEventListener: (/** @type {string} */ _, /** @type {() => void} */ listener) => { heard = listener; },
    /** @param {string} wanted */
    choose(wanted) {
      value = wanted;
      heard();
    },
  };
}

/** @type {LeadingStatus} */
const AS_EVER = { scale: 1, axes: 'all', held_scale: 1, held_axes: 'all', any: true };

function made(signs = true) {
  const scale = select('lead-scale', ['0.25', '0.5', '1']);
  const axes = select('lead-axes', ['all', 'shift', 'turn', 'level']);
  /** @type {Record<string, any>} */
  const elements = { lead: { hidden: true, dataset: {} }, 'lead-scale': scale, 'lead-axes': axes };
  if (signs) for (const id of ['lead-scale-sign', 'lead-axes-sign']) elements[id] = { textContent: '' };
  const time = { ms: 0 };
  /** @type {Lead[]} */
  const sent = [];
  const document = /** @type {any} */ ({ getElementById: (/** @type {string} */ id) => elements[id] ?? null });
  const choice = new LeadingChoice(document, (lead) => void sent.push(lead), () => time.ms);
  return { choice, scale, axes, elements, sent, time };
}

test('nothing can be chosen before control has told how it leads', () => {
  const { choice, elements } = made();
  choice.take(null, false);
  assert.equal(elements['lead'].hidden, true);
  choice.take(AS_EVER, false);
  assert.equal(elements['lead'].hidden, false);
});

test('what stands is shown, and what is not as ever is marked', () => {
  const { choice, scale, axes, elements } = made();
  choice.take(AS_EVER, false);
  assert.deepEqual([scale.value, axes.value, elements['lead'].dataset.odd], ['1', 'all', 'false']);
  choice.take({ ...AS_EVER, scale: 0.5, axes: 'level' }, false);
  assert.deepEqual([scale.value, axes.value, elements['lead'].dataset.odd], ['0.5', 'level', 'true']);
  assert.deepEqual([elements['lead-scale-sign'].textContent, elements['lead-axes-sign'].textContent], ['its 0.5', 'level']);
});

test('a choice is sent whole, and shown until the server confirms it or never will', () => {
  const { choice, scale, axes, sent, time } = made();
  choice.take(AS_EVER, false);
  axes.choose('shift');
  scale.choose('0.25');
  assert.deepEqual(sent.at(-1), { type: 'lead', scale: 0.25, axes: 'shift' });
  choice.take(AS_EVER, false);
  assert.deepEqual([scale.value, axes.value], ['0.25', 'shift']);
  choice.take({ ...AS_EVER, scale: 0.25, axes: 'shift' }, false);
  choice.take({ ...AS_EVER, scale: 0.5 }, false);
  assert.deepEqual([scale.value, axes.value], ['0.5', 'all']);
  scale.choose('0.25');
  time.ms = CHOICE_MS + 1;
  choice.take(AS_EVER, false);
  assert.equal(scale.value, '1');
});

test('while the button is held nothing can be chosen', () => {
  const { choice, scale, axes } = made();
  choice.take(AS_EVER, true);
  assert.deepEqual([scale.disabled, axes.disabled], [true, true]);
  choice.take(AS_EVER, false);
  assert.deepEqual([scale.disabled, axes.disabled], [false, false]);
});

test('a robot that hangs from nothing can be led without turns, and in no other way', () => {
  const { choice, scale, axes } = made();
  choice.take({ ...AS_EVER, any: false }, false);
  assert.equal(scale.disabled, true);
  assert.deepEqual(axes.options.map(({ value, disabled }) => [value, disabled]),
    [['all', false], ['shift', false], ['turn', true], ['level', true]]);
});

test('a scale that only others offer is shown as it is', () => {
  const { choice, scale } = made(false);
  choice.take({ ...AS_EVER, scale: 0.75 }, false);
  assert.equal(scale.value, '0.75');
  choice.take(AS_EVER, false);
  assert.equal(scale.value, '1');
});

test('as ever needs no words; all else is said', () => {
  assert.equal(leadWords(1, 'all'), '');
  assert.equal(leadWords(0.5, 'shift'), '0.5 × your way, turns don’t count');
  assert.equal(leadWords(0.25, 'all'), '0.25 × your way');
  assert.equal(leadWords(1, 'level'), 'height kept');
  assert.equal(leadWords(0.5, 'turn'), 'turns only');
});
