/** What is wrong with a way of pictures, for so long that another one is worth a try. */

/** A fast path that was silent for longer, or has no picture after so long, is given up [ms]. */
export const SILENT_MS = 1500;
export const FIRST_PICTURE_MS = 4000;
/** Pictures older than this at the server, for so long, are reason to try the next way [ms]. */
export const OLD_MS = 400;
export const OLD_FOR_MS = 1500;
/** The same of what the page's own encoder takes. */
export const SLOW_ENCODER_MS = 200;
export const SLOW_FOR_MS = 3000;

/** Whether something has been too old for too long. */
class Staleness {
  /**
   * @param {number} limitMs Older than this is too old.
   * @param {number} patienceMs So long it must last.
   */
  constructor(limitMs, patienceMs) {
    this.limitMs = limitMs;
    this.patienceMs = patienceMs;
    /** @type {number | null} */
    this.sinceMs = null;
  }

  /**
   * @param {number} now [ms]
   * @param {number | null} ageMs Null: nobody knows, which is no reason to change.
   */
  isStale(now, ageMs) {
    if (ageMs === null || ageMs <= this.limitMs) {
      this.sinceMs = null;
      return false;
    }
    this.sinceMs ??= now;
    return now - this.sinceMs >= this.patienceMs;
  }

  reset() {
    this.sinceMs = null;
  }
}

export class Complaints {
  constructor() {
    this.old = new Staleness(OLD_MS, OLD_FOR_MS);
    this.slow = new Staleness(SLOW_ENCODER_MS, SLOW_FOR_MS);
  }

  /**
   * About the fast path that is open; "" for none.
   * @param {number} now [ms]
   * @param {{ isFlowing: boolean, heardMs: number }} rtc
   * @param {number} sinceMs When it was opened.
   * @param {number | null} ageMs Of the pictures, as the server says.
   */
  ofFast(now, rtc, sinceMs, ageMs) {
    if (now - Math.max(rtc.heardMs, sinceMs) > SILENT_MS) return 'silent';
    if (!rtc.isFlowing) return now - sinceMs > FIRST_PICTURE_MS ? 'no picture' : '';
    return this.old.isStale(now, ageMs) ? `pictures are ${ageMs} ms old` : '';
  }

  /**
   * The page's own encoder is too slow.
   * @param {number} now [ms]
   * @param {number | null} encodeMs
   */
  ofEncoder(now, encodeMs) {
    return this.slow.isStale(now, encodeMs);
  }
}
