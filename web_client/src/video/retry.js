/** When a way that was left is tried again. */

/** Between a way that was left and another try of it [ms]; the last one stays. */
export const RETRY_MS = Object.freeze([2000, 10_000, 30_000]);
/** A way that lasted so long was a good one: the next try comes soon again [ms]. */
export const GOOD_MS = 20_000;

/**
 * @typedef {object} Surroundings
 * @property {{ now(): number }} performance
 * @property {(callback: () => void, ms: number) => any} setTimeout
 * @property {(id: any) => void} clearTimeout
 */

/** Waits longer from failure to failure, and begins anew after a good while. */
export class Retry {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    this.failures = 0;
    this.goodSinceMs = Infinity;
    /** @type {any} */
    this.timer = null;
  }

  succeeded() {
    this.goodSinceMs = this.surroundings.performance.now();
  }

  /** @param {() => void} again */
  failed(again) {
    const { performance, setTimeout } = this.surroundings;
    if (performance.now() - this.goodSinceMs > GOOD_MS) this.failures = 0;
    this.goodSinceMs = Infinity;
    const waitMs = RETRY_MS[Math.min(this.failures, RETRY_MS.length - 1)] ?? 0;
    this.failures += 1;
    this.stop();
    this.timer = setTimeout(again, waitMs);
  }

  stop() {
    this.surroundings.clearTimeout(this.timer);
  }

  reset() {
    this.stop();
    this.failures = 0;
    this.goodSinceMs = Infinity;
  }
}
