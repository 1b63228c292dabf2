/** The mode where nobody looks at the page: in its title, and as sound that lasts as long as the fault. */

/** @import {ShownMode, Signal} from '../ui/session_types.js' */

import { Lasting } from '../ui/lasting.js';
import { say } from '../words/say.js';

/** @type {readonly ShownMode[]} */
const ALARMS = ['RAMP', 'LOST'];
/** Alarms of a robot that was last heard of in the air. @type {readonly ShownMode[]} */
const DEAF = ['NO_LINK', 'NO_WORD'];
/** For a minute. */
const LIMITS = { againMs: 3000, most: 20 };

export class Alarm {
  /**
   * @param {{ title: string }} document
   * @param {(signal: Signal) => void} signal
   */
  constructor(document, signal) {
    this.document = document;
    /** The server's name, by which one of several pages is told from the others. */
    this.server = '';
    this.lasting = new Lasting(signal, LIMITS);
  }

  /**
   * @param {ShownMode} mode
   * @param {string} name For people.
   * @param {boolean} flies As far as the page knows.
   * @param {number} now
   * @param {boolean} empty It runs on an empty battery.
   */
  take(mode, name, flies, now, empty = false) {
    const isAlarm = ALARMS.includes(mode) || (flies && DEAF.includes(mode));
    const warns = isAlarm || empty ? '⚠ ' : '';
    this.document.title = `${warns}${say(name)} · ${this.server || 'Lightleash'}`;
    if (isAlarm) this.lasting.take(mode, now);
    else if (empty) this.lasting.take('EMPTY', now);
    else this.lasting.over();
  }
}
