import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Lens } from '../../src/camera/constraints.js';
import { SHORT, stepped, wished, within } from '../../src/camera/wanted_constraints.js';

/** @import {Settings} from '../../src/camera/wanted_constraints.js' */

const SIZE = { width: 1280, height: 720, frameRate: 30 };

/** Chrome on an Android phone whose camera lists AE_OFF. */
const CHROME = {
  able: {
    exposureMode: ['continuous', 'manual'],
    exposureTime: { min: 0.5, max: 2000, step: 0.1 },
    iso: { min: 50, max: 3200, step: 1 },
    exposureCompensation: { min: -2, max: 2, step: 0.1 },
    focusMode: ['manual', 'single-shot', 'continuous'],
    focusDistance: { min: 0.1, max: 10, step: 0.01 },
    zoom: { min: 1, max: 8, step: 0.1 },
    torch: true,
    whiteBalanceMode: ['continuous', 'manual'],
  },
  is: { ...SIZE, exposureMode: 'continuous', exposureTime: 200, iso: 400, focusMode: 'continuous', zoom: 1, torch: false },
};
const IOS = {
  able: { focusDistance: { min: 0.2 }, zoom: { min: 1, max: 10 }, torch: true, whiteBalanceMode: ['manual', 'continuous'] },
  is: { ...SIZE, zoom: 2, torch: true, whiteBalanceMode: 'continuous' },
};
/** Firefox has no `getCapabilities` for it. */
const FIREFOX = { able: {}, is: { ...SIZE } };

/** A camera's track as browsers have them. */
class FakeTrack {
  /** @type {any[]} */
  asked = [];

  /**
   * @param {{ able: Settings, is: Settings }} camera
   * @param {{ refuses?: (set: Settings) => boolean, deaf?: string[], resizes?: boolean }} [quirks]
   */
  constructor({ able, is }, quirks = {}) {
    this.able = able;
    this.is = { ...is };
    this.quirks = quirks;
    this.constraints = { width: { exact: 1280 }, height: { exact: 720 } };
  }

  getCapabilities = () => this.able;
  getSettings = () => ({ ...this.is });
  getConstraints = () => this.constraints;

  /** @param {any} constraints */
  async applyConstraints(constraints) {
    this.asked.push(constraints);
    const [set = {}] = constraints.advanced ?? [];
    const isMixed = 'width' in constraints && Object.keys(set).length > 0;
    if (isMixed && !this.quirks.resizes) throw new DOMException('Mixing', 'OverconstrainedError');
    if (this.quirks.refuses?.(set)) throw new DOMException('no', 'OverconstrainedError');
    if (this.quirks.resizes) Object.assign(this.is, 'width' in constraints ? SIZE : { width: 640, height: 480 });
    for (const [key, value] of Object.entries(set)) {
      if (!this.quirks.deaf?.includes(key)) this.is[key] = value;
    }
  }
}

/**
 * @param {{ able: Settings, is: Settings }} camera
 * @param {ConstructorParameters<typeof FakeTrack>[1]} [quirks]
 */
async function steadied(camera, quirks) {
  const track = new FakeTrack(camera, quirks);
  const lens = new Lens(/** @type {any} */ (track));
  await lens.steady();
  return { track, lens };
}

test('Chrome on Android: exposed shortly, focused once, as sensitive as before', async () => {
  const { track, lens } = await steadied(CHROME);
  assert.deepEqual(lens.lacks, []);
  assert.equal(track.is.exposureMode, 'manual');
  assert.equal(track.is.exposureTime, SHORT);
  assert.equal(track.is.iso, 400);
  assert.equal(track.is.focusMode, 'manual');
  assert.equal(track.is.focusDistance, 2);
  assert.deepEqual(Object.keys(track.asked[0]), ['advanced'], 'Chrome refuses a mixture with the size');
});

test('a lens is focused on where the robot is filmed from', async () => {
  const track = new FakeTrack(CHROME);
  await new Lens(/** @type {any} */ (track)).steady(0.6);
  assert.equal(track.is.focusDistance, 0.6);
});

test('the lens is told once for each opened camera', async () => {
  const { track, lens } = await steadied(CHROME);
  await lens.steady();
  assert.equal(track.asked.length, 1);
});

test('Safari: zoom and torch are put right, exposure and focus are lacking', async () => {
  const { track, lens } = await steadied(IOS);
  assert.deepEqual(lens.lacks, ['exposure', 'focus']);
  assert.equal(track.is.zoom, 1);
  assert.equal(track.is.torch, false);
});

test('Firefox: nothing can be set, so nothing is asked for', async () => {
  const { track, lens } = await steadied(FIREFOX);
  assert.deepEqual(lens.lacks, ['exposure', 'focus']);
  assert.deepEqual(track.asked, []);
  const old = new Lens(/** @type {any} */ ({ getSettings: () => ({}), getCapabilities: undefined }));
  await old.steady();
  assert.deepEqual(old.lacks, ['exposure', 'focus']);
});

test('where all at once is refused, what can be set is set', async () => {
  const refuses = (/** @type {Settings} */ set) => 'focusMode' in set;
  const { track, lens } = await steadied(CHROME, { refuses });
  assert.equal(track.is.exposureTime, SHORT);
  assert.deepEqual(lens.lacks, ['focus']);
});

test('what was taken but not done is found by reading back', async () => {
  const { lens } = await steadied(CHROME, { deaf: ['exposureTime'] });
  assert.deepEqual(lens.lacks, ['exposure']);
  const zoomed = { able: CHROME.able, is: { ...CHROME.is, zoom: 2, torch: true } };
  assert.deepEqual((await steadied(zoomed, { deaf: ['zoom', 'torch'] })).lens.lacks, ['zoom', 'torch']);
});

test('a browser that forgets the size is told it again', async () => {
  const { track } = await steadied(CHROME, { resizes: true });
  assert.equal(track.is.width, 1280);
  assert.equal(track.is.exposureTime, SHORT);
});

test('a camera that is always long is left to itself, darker if it can', () => {
  const able = { ...CHROME.able, exposureTime: { min: 100, max: 2000 } };
  const { wish, lacks } = wished(able, CHROME.is);
  assert.deepEqual(lacks, ['exposure']);
  assert.equal(wish.exposureMode, undefined);
  assert.equal(wish.exposureCompensation, -1);
});

test('a lens that can’t move lacks no focus', () => {
  assert.deepEqual(wished({ ...CHROME.able, focusMode: ['fixed'] }, CHROME.is).lacks, []);
});

test('without ISO in the settings it starts low', () => {
  assert.equal(wished(CHROME.able, { ...CHROME.is, iso: undefined }).wish.iso, 200);
});

test('steps: shorter before less sensitive, more sensitive before longer', () => {
  const is = { ...CHROME.is, exposureMode: 'manual', exposureTime: 30, iso: 400 };
  const darker = stepped('too_bright', CHROME.able, is, 2);
  assert.equal(darker?.exposureTime, within(CHROME.able.exposureTime, 30 / 1.6));
  assert.equal(darker?.iso, 400);
  assert.equal(stepped('too_bright', CHROME.able, { ...is, exposureTime: 3 }, 2)?.iso, 250);
  assert.equal(stepped('too_dim', CHROME.able, is, 2)?.iso, 640);
  assert.equal(stepped('too_dim', CHROME.able, { ...is, iso: 3200 }, 2)?.exposureTime, 48);
  const sharper = stepped('blurred', CHROME.able, is, 2);
  assert.ok(sharper && Math.abs(sharper.exposureTime * sharper.iso - 30 * 400) < 100, 'as bright as before');
});

test('steps end where the camera ends', () => {
  const is = { ...CHROME.is, exposureMode: 'manual' };
  assert.equal(stepped('too_dim', CHROME.able, { ...is, exposureTime: 80, iso: 3200 }, 2), null);
  assert.equal(stepped('too_bright', CHROME.able, { ...is, exposureTime: 3, iso: 50 }, 2), null);
  assert.equal(stepped('too_bright', IOS.able, IOS.is, 2), null);
  assert.equal(stepped('', CHROME.able, is, 2), null);
});

test('the focus goes to where the robot is, if that is known and another', () => {
  const is = { ...CHROME.is, focusMode: 'manual', focusDistance: 2 };
  assert.deepEqual(stepped('out_of_focus', CHROME.able, is, 3.1), { focusMode: 'manual', focusDistance: 3.1 });
  assert.equal(stepped('out_of_focus', CHROME.able, is, null), null);
  assert.equal(stepped('out_of_focus', CHROME.able, is, 2), null);
  assert.equal(stepped('out_of_focus', IOS.able, IOS.is, 2), null);
});

test('automatic exposure and back', async () => {
  const { track, lens } = await steadied(CHROME);
  assert.ok(lens.isManual);
  await lens.expose(true);
  assert.ok(!lens.isManual);
  assert.equal(track.is.focusMode, 'manual', 'the focus stays');
  assert.deepEqual(track.asked.at(-1).advanced[0], { exposureMode: 'continuous', focusMode: 'manual', focusDistance: 2 });
  await lens.expose(false);
  assert.ok(lens.isManual);
  assert.equal(await lens.adjust('too_bright', 2), true);
  assert.ok(track.is.exposureTime < SHORT);
});
