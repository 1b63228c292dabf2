/** Whether pictures have been too old for so long that another way is worth a try. */

export class Staleness {
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
