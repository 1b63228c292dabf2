import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Feedback } from '../../src/ui/feedback.js';

/** An iPhone's: a call or another app silences it, and it does not begin again by itself. */
class FakeAudio {
  /** @type {FakeAudio} */
  static newest;
  state = 'suspended';
  currentTime = 0;
  calls = false;
  tones = 0;

  constructor() {
    FakeAudio.newest = this;
  }

  async resume() {
    await null;
    if (this.calls) throw new DOMException('a call', 'InvalidStateError');
    this.state = 'running';
  }

  createGain = () => ({ gain: { setValueAtTime() {}, linearRampToValueAtTime() {} }, connect() {} });
  createOscillator = () => ({
    frequency: { value: 0 }, connect: (/** @type {unknown} */ to) => to, start: () => { this.tones += 1; }, stop() {},
  });
}

test('sound that a call or another app has silenced comes back with the next signals', async () => {
  const feedback = new Feedback({}, /** @type {any} */ (FakeAudio), true);
  feedback.signal('COAST'); // before any tap: nothing to sound by
  feedback.unlock();
  const audio = FakeAudio.newest;
  /** @param {string} state */
  const heard = async (state) => {
    audio.state = state;
    audio.tones = 0;
    for (let k = 0; k < 2; k++) {
      feedback.signal('COAST');
      await new Promise((resolve) => setImmediate(resolve));
    }
    return audio.tones;
  };
  assert.equal(await heard('running'), 2);
  audio.calls = true;
  assert.equal(await heard('interrupted'), 0);
  audio.calls = false;
  assert.equal(await heard('interrupted'), 1);
  assert.equal(await heard('suspended'), 1);
  feedback.sound = false;
  assert.equal(await heard('running'), 0);
});
