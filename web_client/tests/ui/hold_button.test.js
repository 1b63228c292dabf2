import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { attachHold } from '../../src/ui/hold_button.js';

class FakeButton extends EventTarget {
  /** @type {number[]} */
  captured = [];

  /** @param {number} id */
  setPointerCapture(id) {
    if (id < 0) throw new Error('NotFoundError');
    this.captured.push(id);
  }
}

/** @type {string[]} */
let log = [];
let button = new FakeButton();
let window = new EventTarget();
let document = Object.assign(new EventTarget(), { hidden: false });

beforeEach(() => {
  log = [];
  button = new FakeButton();
  window = new EventTarget();
  document = Object.assign(new EventTarget(), { hidden: false });
  attachHold(/** @type {any} */ (button), { window, document }, {
    onPress: () => log.push('press'), onRelease: () => log.push('release'),
  });
});

/** @param {string} type @param {object} parts */
function fire(type, parts = {}, target = /** @type {EventTarget} */ (button)) {
  const event = new Event(type, { cancelable: true });
  target.dispatchEvent(Object.assign(event, { button: 0, pointerId: 1, ...parts }));
  return event;
}

test('everything that may end a touch releases, once', () => {
  /** @type {(() => void)[]} */
  const ends = [
    () => fire('pointerup'), () => fire('pointercancel'), () => fire('lostpointercapture'),
    () => fire('blur', {}, window), () => fire('pagehide', {}, window), () => fire('freeze', {}, document),
    () => {
      document.hidden = true;
      fire('visibilitychange', {}, document);
      document.hidden = false;
    },
  ];
  for (const end of ends) {
    log.length = 0;
    fire('pointerdown');
    end();
    end();
    assert.deepEqual(log, ['press', 'release'], String(end));
  }
});

test('a finger that slides off still holds: the pointer is captured', () => {
  fire('pointerdown', { pointerId: 7 });
  assert.deepEqual(button.captured, [7]);
  fire('pointerleave', { pointerId: 7 });
  assert.deepEqual(log, ['press']);
});

test('the first finger alone counts', () => {
  fire('pointerdown', { pointerId: 1 });
  fire('pointerdown', { pointerId: 2 });
  fire('pointerup', { pointerId: 2 });
  assert.deepEqual(log, ['press']);
  fire('pointerup', { pointerId: 1 });
  assert.deepEqual(log, ['press', 'release']);
});

test('a finger that is already gone does not press', () => {
  fire('pointerdown', { pointerId: -1 });
  assert.deepEqual(log, []);
});

test('other mouse buttons do not press', () => {
  fire('pointerdown', { button: 2 });
  assert.deepEqual(log, []);
});

test('the space bar holds while it is down, and its repeats are nothing new', () => {
  fire('keydown', { key: ' ', repeat: false });
  fire('keydown', { key: ' ', repeat: true });
  fire('keyup', { key: ' ' });
  fire('keydown', { key: 'a', repeat: false });
  assert.deepEqual(log, ['press', 'release']);
});

test('long presses open no menu and select nothing', () => {
  assert.ok(fire('touchstart').defaultPrevented);
  assert.ok(fire('contextmenu', {}, document).defaultPrevented);
  assert.ok(fire('selectstart', {}, document).defaultPrevented);
});
