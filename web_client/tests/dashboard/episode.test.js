import assert from 'node:assert/strict';
import { test } from 'node:test';

import { EpisodePanel } from '../../src/dashboard/episode.js';
import { statusOf } from '../fakes.js';

function made() {
  /** @type {[string, object][]} */
  const posted = [];
  /** @type {Record<string, any>} */
  const elements = {};
  for (const id of ['episode', 'task', 'press', 'verdict']) {
    const element = { hidden: true, value: '', textContent: '', disabled: false, heard: () => {}, addEventListener: (/** @type {string} */ _, /** @type {() => void} */ heard) => { element.heard = heard; } };
    elements[id] = element;
  }
  const document = /** @type {any} */ ({ getElementById: (/** @type {string} */ id) => elements[id] });
  return { panel: new EpisodePanel(document, (path, body) => void posted.push([path, body])), elements, posted };
}

test('it is there while a recording runs, and judges a press once there was one', () => {
  const { panel, elements, posted } = made();
  panel.take(statusOf());
  assert.equal(elements.episode.hidden, true);
  panel.take(statusOf({ recording: 'one' }));
  assert.deepEqual([elements.episode.hidden, elements.verdict.disabled, elements.press.textContent], [false, true, 'no press yet']);
  elements.verdict.heard();
  panel.take(statusOf({ recording: 'one', episode: { press: 3, keep: true } }));
  assert.deepEqual([elements.verdict.disabled, elements.verdict.textContent], [false, 'Discard']);
  elements.verdict.heard();
  panel.take(statusOf({ recording: 'one', episode: { press: 3, keep: false } }));
  assert.deepEqual([elements.press.textContent, elements.verdict.textContent], ['discarded 3', 'Keep']);
  elements.verdict.heard();
  assert.deepEqual(posted, [['api/episode', { press: 3, keep: false }], ['api/episode', { press: 3, keep: true }]]);
});

test('a task is sent when it is written, and another supervisor’s is shown', () => {
  const { panel, elements, posted } = made();
  panel.take(statusOf({ recording: 'one' }));
  elements.task.value = ' fetch the red ball ';
  panel.take(statusOf({ recording: 'one' }));
  elements.task.heard();
  assert.deepEqual(posted, [['api/task', { text: 'fetch the red ball' }]]);
  panel.take(statusOf({ recording: 'one', task: 'fetch the red ball' }));
  assert.equal(elements.task.value, 'fetch the red ball');
  panel.take(statusOf({ recording: 'one', task: 'plug in' }));
  assert.equal(elements.task.value, 'plug in');
});
