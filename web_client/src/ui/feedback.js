/** What the holder feels and hears when the mode changes, without looking. */

/** @import {ShownMode, Signal} from './session_types.js' */

/**
 * Vibration [ms on, off, on …] and tones [Hz] of each mode.
 * @type {Record<Signal, { vibration: number[], tones: number[] }>}
 */
const SIGNALS = {
  DISARMED: { vibration: [30], tones: [330] },
  ARMED: { vibration: [40, 60, 40], tones: [440, 554] },
  TRACK: { vibration: [60], tones: [660] },
  COAST: { vibration: [25, 60, 25], tones: [370] },
  HOLD: { vibration: [120], tones: [494] },
  RAMP: { vibration: [250], tones: [440, 330, 247] },
  STOPPED: { vibration: [500], tones: [196, 196] },
  LOST: { vibration: [200, 100, 200, 100, 200], tones: [247, 196, 247, 196] },
  LIMIT: { vibration: [35, 45, 35], tones: [587, 494] },
  WEAK: { vibration: [80, 60, 80, 60, 80], tones: [330, 294, 330] },
  EMPTY: { vibration: [120, 60, 120, 60, 300], tones: [494, 370, 277, 208] },
  STOP_LOST: { vibration: [400, 100, 400, 100, 400], tones: [196, 175, 196, 175] },
  NO_LINK: { vibration: [200, 100, 200], tones: [247, 196] },
  NO_WORD: { vibration: [200, 100, 200], tones: [247, 196] },
};
const TONE_S = 0.11;

export class Feedback {
  /**
   * @param {{ vibrate?: (pattern: number[]) => boolean }} navigator
   * @param {(new () => AudioContext) | undefined} Audio
   * @param {boolean} sound Changes are heard too: vibration is nothing to a phone in a holder, or an iPhone.
   */
  constructor(navigator, Audio, sound) {
    this.navigator = navigator;
    this.Audio = Audio;
    /** @type {AudioContext | null} */
    this.context = null;
    this.sound = sound;
  }

  /** Browsers let pages sound only after a tap: call this in one. */
  unlock() {
    if (this.Audio === undefined) return;
    this.context ??= new this.Audio();
    void this.context.resume();
  }

  /** @param {Signal} mode */
  signal(mode) {
    const { vibration, tones } = SIGNALS[mode];
    this.navigator.vibrate?.(vibration);
    if (!this.sound) return;
    void this.context?.resume().catch(() => {}); // iPhones silence it for a call or another app, for good
    tones.forEach((hz, i) => this.tone(hz, i * TONE_S));
  }

  /**
   * @param {number} hz
   * @param {number} delay [s]
   */
  tone(hz, delay) {
    const { context } = this;
    if (context === null || context.state !== 'running') return;
    const begin = context.currentTime + delay;
    const volume = context.createGain();
    volume.gain.setValueAtTime(0, begin);
    volume.gain.linearRampToValueAtTime(0.25, begin + 0.01);
    volume.gain.linearRampToValueAtTime(0, begin + TONE_S);
    const oscillator = context.createOscillator();
    oscillator.frequency.value = hz;
    oscillator.connect(volume).connect(context.destination);
    oscillator.start(begin);
    oscillator.stop(begin + TONE_S);
  }
}
