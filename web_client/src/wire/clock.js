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

/**
 * Brings time stamps of an unknown epoch (camera frames) to the page's clock.
 *
 * Delay only ever makes (arrival − stamp) larger: the smallest of the last frames are the best; two
 * buckets follow a drifting clock.
 */
export class MinimumDelayClock {
  /** @param {number} window Frames a least delay may live, at most twice. */
  constructor(window = 150) {
    this.window = window;
    this.count = 0;
    /** @type {number[]} */
    this.current = [];
    /** @type {number[]} */
    this.previous = [];
  }

  /**
   * @param {number} stampUs Of the frame, on the unknown clock.
   * @param {number} arrivalUs On the page's clock.
   * @returns {number} Capture time on the page's clock, never after the arrival [µs].
   */
  captureUs(stampUs, arrivalUs) {
    const difference = arrivalUs - stampUs;
    if (Math.abs(difference - (this.current[0] ?? this.previous[0] ?? Infinity)) > 1e6) {
      this.count = 0;
      this.current = [];
      this.previous = [];
    }
    this.current = smallest([...this.current, difference]);
    const least = smallest([...this.current, ...this.previous]).at(-1) ?? difference;
    this.count += 1;
    if (this.count >= this.window) {
      this.previous = this.current;
      this.current = [];
      this.count = 0;
    }
    return Math.min(stampUs + least, arrivalUs);
  }
}

/** @param {number[]} values */
function smallest(values) {
  return values.sort((a, b) => a - b).slice(0, AGREE);
}

/** Events per second over the last second or so. */
export class Rate {
  constructor() {
    /** @type {number[]} */
    this.times = [];
    this.amounts = /** @type {number[]} */ ([]);
  }

  /**
   * @param {number} now [ms]
   * @param {number} amount
   */
  add(now, amount = 1) {
    this.times.push(now);
    this.amounts.push(amount);
    this.forget(now);
  }

  /**
   * @param {number} now [ms]
   * @returns {number} Amount per second.
   */
  perSecond(now) {
    this.forget(now);
    return this.amounts.reduce((sum, amount) => sum + amount, 0);
  }

  /** @param {number} now */
  forget(now) {
    while (this.times.length > 0 && /** @type {number} */ (this.times[0]) <= now - 1000) {
      this.times.shift();
      this.amounts.shift();
    }
  }
}
