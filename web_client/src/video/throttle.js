/** Lets so many pictures a second pass, evenly. */

/** A picture so much too early is let through: cameras are not that exact [share of the interval]. */
const EARLY = 0.25;

export class Throttle {
  constructor() {
    this.intervalUs = 0;
    this.nextUs = -Infinity;
  }

  /** @param {number} hz */
  limit(hz) {
    this.intervalUs = 1e6 / hz;
  }

  /** @param {number} captureUs In the order of time. */
  passes(captureUs) {
    if (captureUs < this.nextUs - EARLY * this.intervalUs) return false;
    // on the grid while pictures come in time, anew after a pause
    this.nextUs = Math.max(this.nextUs, captureUs - this.intervalUs) + this.intervalUs;
    return true;
  }
}
