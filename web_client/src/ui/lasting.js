/** What is felt and heard again as long as it lasts. */

/** @import {ShownMode, Signal, State} from './session_types.js' */

import { limitWords, runsEmpty } from './mode_words.js';
import { shownMode } from './session.js';

/** A robot that does not follow, whatever the hand does. @type {readonly ShownMode[]} */
const FAULTS = ['COAST', 'RAMP', 'LOST', 'NO_LINK', 'NO_WORD'];

export class Lasting {
  /**
   * @param {(signal: Signal) => void} signal
   * @param {{ againMs: number, most: number }} limits How soon again, and how often of one fault: a page left
   * open overnight falls silent.
   */
  constructor(signal, { againMs, most }) {
    this.signal = signal;
    this.againMs = againMs;
    this.most = most;
    /** @type {Signal | null} */
    this.last = null;
    this.lastMs = -Infinity;
    this.signals = 0;
  }

  /**
   * It was signalled elsewhere.
   * @param {Signal} signal
   * @param {number} now
   */
  felt(signal, now) {
    this.signals = signal === this.last ? this.signals + 1 : 1;
    this.last = signal;
    this.lastMs = now;
  }

  /** It is over for good: what comes next is signalled at once, the same again, too. */
  over() {
    this.last = null;
  }

  /**
   * @param {Signal | null} signal What goes on; null: nothing does for the moment.
   * @param {number} now
   */
  take(signal, now) {
    if (signal === null) {
      this.signals = 0;
      return;
    }
    const isKnown = signal === this.last;
    if (isKnown && (now - this.lastMs < this.againMs || this.signals >= this.most)) return;
    this.felt(signal, now);
    this.signal(signal);
  }
}

/**
 * What goes on, for who holds the phone.
 * @param {State} state
 * @returns {Signal | null}
 */
export function lastingSignal(state) {
  if (state.phase !== 'operating' || state.standby) return null;
  const mode = shownMode(state);
  if (FAULTS.includes(mode)) return mode;
  if (runsEmpty(mode, state.status)) return 'EMPTY';
  return limitWords(state.status).length > 0 ? 'LIMIT' : null;
}
