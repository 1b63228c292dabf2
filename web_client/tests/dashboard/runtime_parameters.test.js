import assert from 'node:assert/strict';
import { test } from 'node:test';

import { KnobPanel, PATIENCE_MS, PendingTunes, hzOf, limitOf, placeOfHz, placeOfLimit, words } from '../../src/dashboard/runtime_parameters.js';

/** @import {RuntimeParameters, Tune} from '../../src/wire/protocol_types.js' */

/** @type {RuntimeParameters} */
const STANDING = { cutoff_hz: 0.28, mode: 'full', adaptive_beta: 0, max_speed_m_s: 1, guard: true };

/** @param {Partial<RuntimeParameters>} knobs */
const camera = (knobs = {}, lag = 3.24, guarding = 0) => ({ knobs: { ...STANDING, ...knobs }, lag_deg: lag, guarding });

test('every place of the cut-off slider is within the range and found again from its value', () => {
  assert.deepEqual([hzOf(0), hzOf(200), hzOf(placeOfHz(0.28)), hzOf(placeOfHz(0.05))], [0.03, 3, 0.28, 0.0498]);
  for (let place = 1; place <= 200; place++) {
    assert.ok(hzOf(place) > hzOf(place - 1));
    assert.equal(placeOfHz(hzOf(place)), place, 'an arrow key is never undone');
  }
});

test('the speed limit loosens to the right, and the last place is none', () => {
  assert.deepEqual([limitOf(1), limitOf(10), limitOf(50), limitOf(51)], [0.1, 1, 5, 0]);
  for (let place = 1; place <= 51; place++) assert.equal(placeOfLimit(limitOf(place)), place);
});

test('knobs are said with their units', () => {
  assert.deepEqual(words(STANDING), { cutoff: '0.28 Hz', adaptive: 'off', limit: '1.0 m/s' });
  assert.deepEqual(words({ ...STANDING, cutoff_hz: 2, adaptive_beta: 0.6, max_speed_m_s: 0 }), {
    cutoff: '2.00 Hz', adaptive: '+0.6 Hz/(rad/s)', limit: 'no limit',
  });
});

test('of a knob being turned only the last value is sent, alone', () => {
  const wishes = new PendingTunes();
  for (let t = 0; t < 1000; t += 50) {
    wishes.turn({ cutoff_hz: 0.3 + t / 1000 }, t);
    assert.equal(wishes.due(t), null);
  }
  assert.deepEqual(wishes.due(1150), {
    type: 'tune', cutoff_hz: 1.25, mode: null, adaptive_beta: null, max_speed_m_s: null, guard: null,
  });
  assert.equal(wishes.due(1200), null);
});

test('a wish is shown until it stands, or until it is clear that it will not', () => {
  const wishes = new PendingTunes();
  wishes.turn({ mode: 'off' }, 0);
  assert.equal(wishes.over(STANDING, 100).mode, 'off');
  wishes.due(200);
  assert.equal(wishes.over(STANDING, 200 + PATIENCE_MS).mode, 'off');
  assert.equal(wishes.over(STANDING, 201 + PATIENCE_MS).mode, 'full');
  wishes.turn({ mode: 'off' }, 5000);
  wishes.due(5200);
  assert.equal(wishes.over({ ...STANDING, mode: 'off' }, 5300).mode, 'off');
  assert.equal(wishes.over({ ...STANDING, mode: 'selective' }, 5301).mode, 'selective', 'another supervisor');
});

function panel() {
  /** @type {Record<string, any>} */
  const elements = {};
  /** @type {Record<string, () => void>} */
  const turned = {};
  const ids = ['knobs', 'knob-state', 'cutoff', 'adaptive', 'limit',
    ...['mode', 'cutoff', 'adaptive', 'limit', 'guard'].map((name) => `knob-${name}`)];
  for (const id of ids) {
    /** @type {Record<string, string>} */
    const attributes = {};
    elements[id] = {
      value: '', checked: false, disabled: false, textContent: '',
      getAttribute: (/** @type {string} */ name) => attributes[name] ?? null,
      setAttribute: (/** @type {string} */ name, /** @type {string} */ value) => void (attributes[name] = value),
      addEventListener: (/** @type {string} */ _type, /** @type {() => void} */ listener) => { turned[id] = listener; },
    };
  }
  const time = { ms: 0 };
  /** @type {Tune[]} */
  const sent = [];
  const document = /** @type {any} */ ({ getElementById: (/** @type {string} */ id) => elements[id] ?? null });
  const made = new KnobPanel(document, (tune) => void sent.push(tune), () => time.ms);
  return { made, elements, turned, time, sent };
}

test('the panel shows how the knobs stand, and is off while nobody knows', () => {
  const { made, elements } = panel();
  made.take(null);
  assert.equal(elements.knobs.disabled, true);
  made.take(camera({ mode: 'selective', max_speed_m_s: 0 }, 3.24, 0.5));
  assert.equal(elements.knobs.disabled, false);
  assert.deepEqual(
    ['knob-mode', 'knob-cutoff', 'knob-adaptive', 'knob-limit'].map((id) => elements[id].value),
    ['selective', '97', '0', '51'],
  );
  assert.equal(elements['knob-guard'].checked, true);
  assert.equal(elements['knob-cutoff'].getAttribute('aria-valuetext'), '0.28 Hz');
  assert.equal(elements['knob-state'].textContent, 'lag 3.2° · hurrying');
  made.take(camera({ mode: 'off' }));
  assert.deepEqual([elements['knob-cutoff'].disabled, elements['knob-limit'].disabled], [true, false]);
});

test('a turned knob stays under the hand while old news arrive, and is sent once', () => {
  const { made, elements, turned, time, sent } = panel();
  made.take(camera());
  elements['knob-cutoff'].value = '0';
  turned['knob-cutoff']?.();
  for (time.ms = 0; time.ms <= 500; time.ms += 100) {
    made.take(camera());
    made.tick();
    assert.equal(elements['knob-cutoff'].value, '0');
    assert.equal(elements.cutoff.textContent, '0.030 Hz');
  }
  assert.deepEqual(sent.map((tune) => [tune.cutoff_hz, tune.mode, tune.guard]), [[0.03, null, null]]);
  made.take(camera({ cutoff_hz: 0.03 }));
  made.take(camera({ cutoff_hz: 0.5 }));
  assert.equal(elements.cutoff.textContent, '0.50 Hz');
});

test('a click on the guard is a wish for its new state', () => {
  const { made, elements, turned, time, sent } = panel();
  made.take(camera());
  elements['knob-guard'].checked = false;
  turned['knob-guard']?.();
  time.ms = 200;
  made.tick();
  assert.equal(sent[0]?.guard, false);
});
