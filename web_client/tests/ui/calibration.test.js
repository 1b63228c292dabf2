import assert from 'node:assert/strict';
import { test } from 'node:test';

import { squareMm } from '../../src/app/board_size.js';
import { CalibrationView } from '../../src/ui/calibration_view.js';
import { INITIAL, reduce } from '../../src/ui/session.js';

/** @import {Calibration} from '../../src/wire/protocol_types.js' */

/** @param {Partial<Calibration>} parts @returns {Calibration} */
const calibrationOf = (parts) => ({
  type: 'calibration', phase: 'filming', hint: '', progress: 0, tasks: {}, width: 0, height: 0, columns: 0,
  cells: [], outline: [], blurred: false, verdict: '', figures: [], reasons: [], advice: [], ...parts,
});

test('what the server tells of a calibration stays until it is off, or the link is lost', () => {
  const { state } = reduce(INITIAL, { type: 'calibration', calibration: calibrationOf({}) });
  assert.equal(state.calibration?.phase, 'filming');
  const off = reduce(state, { type: 'calibration', calibration: calibrationOf({ phase: 'off' }) });
  assert.equal(off.state.calibration, null);
  assert.equal(reduce(state, { type: 'disconnected' }).state.calibration, null);
});

test('a wish to calibrate goes to the server', () => {
  const { effects } = reduce(INITIAL, { type: 'calibrate', what: 'start' });
  assert.deepEqual(effects, [{ type: 'calibrate', what: 'start' }]);
});

test('pictures refused for want of a calibration are no notice each', () => {
  const refused = { type: /** @type {const} */ ('refused'), code: 'calibration', field: 'frame', allowed: 'none', fatal: false };
  assert.equal(reduce(INITIAL, { type: 'refused', refused, now: 0 }).state.notice, null);
});

test('a bar measured on the screen gives the size of a square', () => {
  assert.equal(squareMm('50', 200, 1000), 25);
  assert.equal(squareMm(' 50,0 ', 200, 1000), 25);
  for (const wrong of ['', 'abc', '-3', '0', '99999']) assert.equal(squareMm(wrong, 200, 1000), null);
});

/** What a view touches of a page. */
function fakePage() {
  /** @type {Map<string, any>} */
  const elements = new Map();
  /** @param {string} id */
  const find = (id) => {
    if (!elements.has(id)) {
      elements.set(id, {
        dataset: {},
        classList: { toggle() {} },
        toggleAttribute() {},
        replaceChildren() {},
        /** @param {string} _ @param {() => void} heard */
        addEventListener(_, heard) { this.click = heard; },
      });
    }
    return elements.get(id);
  };
  /** @type {string[]} */
  const wishes = [];
  const view = new CalibrationView(/** @type {any} */ ({}), find, '', (what) => wishes.push(what));
  return { find, view, wishes };
}

test('the button to calibrate is there without a calibration, and when the camera is another', () => {
  const { find, view } = fakePage();
  view.render(null, true, false);
  assert.equal(find('calibrate').hidden, true);
  view.render(null, true, true);
  assert.equal(find('calibrate').hidden, false);
  view.render(null, false, true);
  assert.equal(find('calibrate').hidden, true);
  view.render(calibrationOf({ phase: 'needed' }), true, false);
  assert.equal(find('calibrate').hidden, false);
});

test('who is not content with a usable calibration can film again', () => {
  const { find, view, wishes } = fakePage();
  view.render(calibrationOf({ phase: 'done', verdict: 'good' }), true, false);
  assert.equal(find('calibration-leave').hidden, true);
  view.render(calibrationOf({ phase: 'done', verdict: 'usable' }), true, false);
  assert.equal(find('calibration-leave').hidden, false);
  assert.equal(find('calibration-leave').textContent, 'Film again');
  find('calibration-leave').click();
  find('calibration-go').click();
  assert.deepEqual(wishes, ['start', 'stop']);
});
