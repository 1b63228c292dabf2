import assert from 'node:assert/strict';
import { test } from 'node:test';

import { AGAIN_MS, ToolSlider } from '../../src/ui/tool_slider.js';

/** @import {UseTool} from '../../src/wire/protocol_types.js' */

/** An element as a browser has it, as far as it is used. */
function element() {
  /** @type {() => void} */
  let heard = () => {};
  return {
    hidden: false, disabled: false, value: '', textContent: '', className: '',
    append: () => {}, before: () => {},
    addEventListener: (/** @type {string} */ _, /** @type {() => void} */ listener) => { heard = listener; },
    /** @param {number} percent */
    slide(percent) {
      this.value = String(percent);
      heard();
    },
  };
}

function made() {
  const time = { ms: 0 };
  /** @type {UseTool[]} */
  const sent = [];
  const document = /** @type {any} */ ({ createElement: element, head: element(), querySelector: element });
  const tool = new ToolSlider(document, (use) => void sent.push(use), () => time.ms);
  return { tool, slider: /** @type {any} */ (tool.slider), panel: /** @type {any} */ (tool.panel), sent, time };
}

const GRIPPER = { name: 'Gripper', opening: null };

test('a robot without a tool has no slider', () => {
  const { tool, panel } = made();
  tool.take(null, 1);
  assert.equal(panel.hidden, true);
  tool.take(GRIPPER, 1);
  assert.equal(panel.hidden, false);
  assert.equal(tool.name.textContent, 'Gripper');
});

test('it moves while the button is held alone', () => {
  const { tool, slider } = made();
  tool.take(GRIPPER, null);
  assert.equal(slider.disabled, true);
  tool.take(GRIPPER, 1);
  assert.equal(slider.disabled, false);
});

test('nothing is asked before the finger moves it, then again and again while the press lasts', () => {
  const { tool, slider, sent, time } = made();
  for (; time.ms < 500; time.ms += 33) tool.take(GRIPPER, 7);
  assert.deepEqual(sent, []);
  slider.slide(40);
  for (const end = time.ms + 1000; time.ms < end; time.ms += 10) tool.take({ ...GRIPPER, opening: 0.1 }, 7);
  assert.equal(sent.length, 1000 / AGAIN_MS);
  assert.deepEqual(sent[0], { type: 'tool', opening: 0.4, press: 7 });
  assert.equal(slider.value, '40', 'the finger is believed, not what comes late');
});

test('another press begins anew, with what the robot was told', () => {
  const { tool, slider, sent, time } = made();
  tool.take(GRIPPER, 7);
  slider.slide(40);
  tool.take(GRIPPER, 7);
  tool.take({ ...GRIPPER, opening: 0.4 }, null);
  time.ms += 1000;
  slider.value = '90';
  tool.take({ ...GRIPPER, opening: 0.4 }, 8);
  assert.equal(sent.length, 1);
  assert.equal(slider.value, '40');
});
