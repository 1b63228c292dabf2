/** The mode where nobody looks at the page: in its title, and as sound that lasts as long as the fault. */

/** @import {ShownMode} from '../ui/session_types.js' */

/** @type {readonly ShownMode[]} */
const ALARMS = ['RAMP', 'LOST'];
/** Alarms of a robot that was last heard of in the air. @type {readonly ShownMode[]} */
const DEAF = ['NO_LINK', 'NO_WORD'];
const AGAIN_MS = 3000;
/** Of one fault: a page left open overnight falls silent. */
const MOST = 20;

export class Alarm {
  /**
   * @param {{ title: string }} document
   * @param {(mode: ShownMode) => void} signal
   */
  constructor(document, signal) {
    this.document = document;
    this.signal = signal;
    /** @type {ShownMode | ''} */
    this.mode = '';
    this.signals = 0;
    this.lastMs = 0;
  }

  /**
   * @param {ShownMode} mode
   * @param {string} name For people.
   * @param {boolean} flies As far as the page knows.
   * @param {number} now
   */
  take(mode, name, flies, now) {
    const isAlarm = ALARMS.includes(mode) || (flies && DEAF.includes(mode));
    this.document.title = `${isAlarm ? '⚠ ' : ''}${name} · Lightleash`;
    if (mode !== this.mode) this.signals = 0;
    this.mode = mode;
    if (!isAlarm || this.signals >= MOST) return;
    if (this.signals > 0 && now - this.lastMs < AGAIN_MS) return;
    this.signals += 1;
    this.lastMs = now;
    this.signal(mode);
  }
}
