import assert from 'node:assert/strict';
import { test } from 'node:test';

import { INITIAL } from '../../src/ui/session.js';
import { LensPanel, PAUSE_MS } from '../../src/ui/constraints_panel.js';
import { lackWords, lensWords, settingsWords } from '../../src/camera/constraints_words.js';
import { FakeTime, statusOf } from '../fakes.js';

/** @import {CameraHealth, Calibration, Status} from '../../src/wire/protocol_types.js' */
/** @import {Settings} from '../../src/camera/wanted_constraints.js' */

/** @type {CameraHealth} */
const FINE = {
  complaint: '', hint: '', advice: '', exposure_ms: null, readout_ms: 20, readout_learnt: false, readout_sigma_ms: null,
  time_offset_ms: null, time_offset_sigma_ms: null, larger_percent: null, larger_sigma_percent: null, held_percent: null,
  held_sigma_percent: null,
};
/** @type {CameraHealth} */
const BRIGHT = { ...FINE, hint: 'too_bright', advice: 'The LEDs are too bright.' };
const SEEN = { camera: FINE, mode: /** @type {const} */ ('DISARMED'), lacks: [''].slice(1), steps: true, manual: true, leds: 5 };

/** Settings that do what they are told. */
class FakeLens {
  steadied = true;
  isManual = true;
  /** @type {string[]} */
  lacks = [];
  /** @type {string[]} */
  deeds = [];
  /** @type {Settings} */
  able = { exposureMode: ['manual'], exposureTime: { min: 1, max: 900 }, iso: { min: 50, max: 800 } };
  is = { exposureMode: 'manual', exposureTime: 30, iso: 200 };

  /** @param {string} hint @param {number | null} robotM */
  async adjust(hint, robotM) {
    this.deeds.push(`${hint} ${robotM}`);
  }

  /** @param {boolean} automatic */
  async expose(automatic) {
    this.deeds.push(automatic ? 'automatic' : 'short');
  }
}

function rig() {
  /** @type {Record<string, any>} */
  const elements = {};
  for (const id of ['lens', 'lens-text', 'lens-0', 'lens-1']) {
    elements[id] = {
      hidden: true, textContent: '', dataset: {}, tap: () => {},
      addEventListener(/** @type {string} */ _type, /** @type {() => void} */ listener) { this.tap = listener; },
    };
  }
  const time = new FakeTime();
  const camera = { settings: /** @type {any} */ (new FakeLens()) };
  const document = /** @type {any} */ ({ getElementById: (/** @type {string} */ id) => elements[id] });
  /** @type {string[]} */
  const logged = [];
  const panel = new LensPanel(document, 'android', time, camera, (text) => logged.push(text));
  /** @param {Partial<Status>} told @param {Calibration | null} [calibration] */
  const render = (told, calibration = null) => panel.render({
    ...INITIAL, phase: 'operating', linked: true, heard: true, calibration,
    status: statusOf({ leds: 5, ...told }),
  });
  return { elements, time, camera, render, logged, settled: () => new Promise((done) => setImmediate(done)) };
}

test('nothing to say is not said', () => {
  const { elements, render } = rig();
  render({ camera: FINE });
  assert.ok(elements.lens.hidden);
});

test('before arming the page changes the exposure by itself, step by step', async () => {
  const { camera, time, render, settled } = rig();
  render({ camera: BRIGHT });
  await settled();
  render({ camera: BRIGHT });
  assert.deepEqual(camera.settings.deeds, ['too_bright null'], 'the server must judge the first step');
  time.advance(PAUSE_MS);
  render({ camera: BRIGHT });
  assert.equal(camera.settings.deeds.length, 2);
});

test('it does not step for ever', async () => {
  const { camera, time, render, settled } = rig();
  for (let i = 0; i < 50; i++) {
    render({ camera: BRIGHT });
    await settled();
    time.advance(PAUSE_MS);
  }
  assert.equal(camera.settings.deeds.length, 12);
});

for (const mode of /** @type {const} */ (['ARMED', 'TRACK', 'HOLD', 'RAMP'])) {
  test(`while ${mode} nothing is changed without a tap`, async () => {
    const { elements, camera, render, settled } = rig();
    render({ camera: BRIGHT, mode, position_mm: [2500, 0, 0] });
    assert.deepEqual(camera.settings.deeds, []);
    assert.equal(elements['lens-0'].textContent, 'Darker');
    elements['lens-0'].tap();
    await settled();
    assert.deepEqual(camera.settings.deeds, ['too_bright 2.5']);
  });
}

test('the focus is never changed without a tap: it changes the focal length', () => {
  const { camera, render } = rig();
  render({ camera: { ...FINE, hint: 'out_of_focus', advice: 'Out of focus.' } });
  assert.deepEqual(camera.settings.deeds, []);
});

test('who holds a camera that can’t be stepped hears what else helps', () => {
  const { elements, camera, render } = rig();
  camera.settings.able = {};
  render({ camera: BRIGHT });
  assert.match(elements['lens-text'].textContent, /can’t expose shorter: dim them/);
  assert.ok(elements['lens-0'].hidden);
});

test('who asks for automatic exposure keeps it until the camera is opened anew', async () => {
  const { elements, camera, time, render, settled } = rig();
  render({ camera: null, leds: 0 });
  assert.equal(elements['lens-0'].textContent, 'Automatic exposure');
  elements['lens-0'].tap();
  await settled();
  time.advance(PAUSE_MS);
  render({ camera: BRIGHT });
  assert.deepEqual(camera.settings.deeds, ['automatic']);
  camera.settings = new FakeLens();
  render({ camera: BRIGHT });
  assert.deepEqual(camera.settings.deeds, ['too_bright null']);
});

test('a board is filmed with the phone’s own exposure, for screens flicker', async () => {
  const { camera, render, settled } = rig();
  const calibration = /** @type {Calibration} */ ({ type: 'calibration', phase: 'filming' });
  render({ camera: null }, calibration);
  await settled();
  render({ camera: null }, calibration);
  render({ camera: null });
  assert.deepEqual(camera.settings.deeds, ['automatic', 'short']);
});

test('a camera that fails is told of, not thrown', async () => {
  const { elements, camera, render, logged, settled } = rig();
  camera.settings.adjust = async () => { throw new Error('gone'); };
  render({ camera: BRIGHT, mode: 'TRACK' });
  elements['lens-0'].tap();
  await settled();
  assert.deepEqual(logged, ['camera: Error: gone']);
});

test('in flight a camera that is not the calibrated one comes first', () => {
  const camera = { ...BRIGHT, complaint: 'The picture moves less than the phone turns.' };
  assert.deepEqual(lensWords({ ...SEEN, camera, mode: 'TRACK' }), { tone: 'fault', text: camera.complaint, deeds: [] });
  assert.equal(lensWords({ ...SEEN, camera })?.tone, 'hint', 'before arming it is among the refusals');
});

test('what the browser can’t set is told before arming, not in flight', () => {
  const lacks = lackWords(['exposure', 'focus', 'exposure'], 'ios');
  assert.equal(lacks.length, 2);
  assert.match(lacks[0] ?? '', /^Safari can’t fix the exposure: light the room/);
  assert.equal(lensWords({ ...SEEN, lacks, manual: false })?.text, lacks.join(' '));
  assert.equal(lensWords({ ...SEEN, lacks, manual: false, mode: 'TRACK' }), null);
  for (const platform of /** @type {const} */ (['ios', 'android', 'firefox-android', 'desktop'])) {
    for (const words of lackWords(['exposure', 'focus', 'zoom', 'torch'], platform)) assert.ok(words.length > 20);
  }
});

test('what was really set is told', () => {
  const is = { width: 1280, height: 720, frameRate: 30, exposureMode: 'manual', exposureTime: 30, iso: 400, focusMode: 'manual', focusDistance: 2, zoom: 1 };
  assert.equal(settingsWords(is), '1280x720, 30 fps, exposure manual 3 ms ISO 400, focus manual 2 m');
  assert.equal(settingsWords({ width: 640, height: 480, facingMode: 'user', zoom: 2, torch: true }), '640x480, 0 fps, user, zoom 2, torch on');
});
