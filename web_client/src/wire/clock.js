/**
 * The page's one clock: monotonic microseconds since the page was loaded, and other clocks brought to it.
 */

/**
 * @param {{ now(): number }} performance
 * @returns {number} [µs]
 */
export function nowUs(performance) {
  return performance.now() * 1000;
}

/**
 * A DOM time stamp [ms] as microseconds of the page's clock; now, if the browser gave something else.
 * @param {number | null | undefined} timeStampMs
 * @param {number} now [µs]
 */
export function eventUs(timeStampMs, now) {
  const tUs = (timeStampMs ?? NaN) * 1000;
  return tUs > now - 1e6 && tUs <= now ? tUs : now;
}

/** So many frames must agree: one stamp that is wrong would date all others. */
const AGREE = 3;
/** So many frames a least delay may live, at most twice. */
const WINDOW = 150;

/**
 * Brings time stamps of an unknown epoch (camera frames) to the page's clock.
 *
 * Delay only ever makes (arrival − stamp) larger: the smallest of the last frames are the best; two
 * buckets follow a drifting clock. One frame far off has waited; several in a row, and the camera began anew.
 */
export class MinimumDelayClock {
  count = 0;
  far = 0;
  /** @type {number[]} */
  current = [];
  /** @type {number[]} */
  previous = [];

  /**
   * @param {number} stampUs Of the frame, on the unknown clock.
   * @param {number} arrivalUs On the page's clock.
   * @returns {number} Capture time on the page's clock, never after the arrival [µs].
   */
  captureUs(stampUs, arrivalUs) {
    const difference = arrivalUs - stampUs;
    this.far = Math.abs(difference - this.least()) > 1e6 ? this.far + 1 : 0;
    if (this.far >= AGREE) [this.current, this.previous, this.count, this.far] = [[], [], 0, 0];
    if (this.far === 0) this.current = smallest([...this.current, difference]);
    const captureUs = Math.min(stampUs + this.least(), arrivalUs);
    this.count += 1;
    if (this.count >= WINDOW) [this.previous, this.current, this.count] = [this.current, [], 0];
    return captureUs;
  }

  least() {
    return smallest([...this.current, ...this.previous]).at(-1) ?? NaN;
  }
}

/** @param {number[]} values */
export function smallest(values) {
  return values.sort((a, b) => a - b).slice(0, AGREE);
}

/** An amount per second over the last second. */
export class Rate {
  /** @type {{ t: number, amount: number }[]} */
  events = [];

  /** @param {number} now [ms] */
  add(now, amount = 1) {
    this.events.push({ t: now, amount });
    this.perSecond(now);
  }

  /** @param {number} now [ms] */
  perSecond(now) {
    this.events = this.events.filter(({ t }) => t > now - 1000);
    return this.events.reduce((sum, { amount }) => sum + amount, 0);
  }
}
