/**
 * How many pictures a second, of what size, can this phone's encoder make? Steps down where it can't keep up,
 * first in pictures a second, then in size, and up again when it could for a while.
 */

/**
 * What is asked of an encoder.
 * @typedef {object} Level
 * @property {number} hz Pictures a second.
 * @property {number} shrunk By so many quarters a picture is smaller than the camera's.
 */

/**
 * How an encoder has done since the last look.
 * @typedef {object} Load
 * @property {number} inHz Pictures a second that it was given.
 * @property {number} outHz Pictures a second that came out.
 * @property {number | null} encodeMs Mean time of a picture in it; null if nobody knows.
 * @property {number} waiting Pictures in its queue.
 * @property {boolean} starved The browser says that the processor is too slow.
 */

/** @typedef {{ level: Level, isEasier: boolean }} Step */

export const QUARTERS = 4;
/** A size in which each number divides by this one has exact sizes below it, as encoders like them. */
const DIVISOR = 8;
/** Pictures a second as a share of what is wanted, and size; each step saves a third or more. */
const STEPS = [[1, 0], [2 / 3, 0], [1 / 2, 0], [1 / 2, 1], [1 / 2, 2]];
/** So many looks that show strain, less those that do not, and it is too much. */
const STRAINED = 4;
/** Looks after a step that say nothing yet. */
const SETTLING = 3;
/** Looks without strain before a step up; twice as many each time it was too early. */
export const CALM = 20;
const MOST_CALM = 320;
/** A step up that lasted so many looks was not too early. */
const PROVEN = 60;
const KEEPS_UP = 0.85;
const BUSY = 0.9;
const CROWDED = 2;

export class Pace {
  /**
   * @param {number} hz Wanted pictures a second.
   * @param {boolean} mayShrink Whether there are exact sizes below the camera's.
   */
  constructor(hz, mayShrink) {
    /** @type {Level[]} */
    this.levels = STEPS.filter(([, shrunk]) => mayShrink || shrunk === 0)
      .map(([share = 1, shrunk = 0]) => ({ hz: Math.round(share * hz), shrunk }));
    this.at = 0;
    this.strain = 0;
    this.calm = 0;
    this.settling = 0;
    this.patience = CALM;
    this.sinceUp = Infinity;
  }

  /** @returns {Level} */
  get level() {
    return /** @type {Level} */ (this.levels[this.at]);
  }

  /**
   * To be called at even intervals; a step to take, or null.
   * @param {Load | null} load Null: no picture was wanted, or nobody knows.
   * @returns {Step | null}
   */
  look(load) {
    this.sinceUp += 1;
    this.settling = Math.max(0, this.settling - 1);
    if (load === null || this.settling > 0) return null;
    const strained = isStrained(load);
    this.strain = strained ? this.strain + 1 : Math.max(0, this.strain - 1);
    this.calm = strained ? 0 : this.calm + 1;
    if (this.sinceUp === PROVEN) this.patience = CALM;
    if (this.strain >= STRAINED && this.at < this.levels.length - 1) return this.down();
    return this.calm >= this.patience && this.at > 0 ? this.up() : null;
  }

  down() {
    if (this.sinceUp < PROVEN) this.patience = Math.min(MOST_CALM, 2 * this.patience);
    this.sinceUp = Infinity;
    return this.step(1);
  }

  up() {
    this.sinceUp = 0;
    return this.step(-1);
  }

  /** @param {1 | -1} by */
  step(by) {
    this.at += by;
    this.strain = this.calm = 0;
    this.settling = SETTLING;
    return { level: this.level, isEasier: by > 0 };
  }
}

/**
 * Fewer pictures come out than go in, and it is the encoder that takes the time. A long time alone says
 * nothing: some encoders work on several pictures at once.
 * @param {Load} load
 */
function isStrained({ inHz, outHz, encodeMs, waiting, starved }) {
  if (waiting >= CROWDED) return true;
  const isBusy = starved || (encodeMs !== null && encodeMs * inHz * 1e-3 > BUSY);
  return isBusy && outHz < KEEPS_UP * inHz;
}

/**
 * Size of a picture of one level.
 * @param {number} width
 * @param {number} height
 * @param {number} shrunk
 */
export function shrunkSize(width, height, shrunk) {
  const share = (QUARTERS - shrunk) / QUARTERS;
  return { width: Math.round(share * width), height: Math.round(share * height) };
}

/**
 * By how many quarters a picture was made smaller: the inverse of the above, whichever way it is turned.
 * @param {{ width: number, height: number }} small
 * @param {{ width: number, height: number }} full
 */
export function quartersOf(small, full) {
  const share = Math.sqrt((small.width * small.height) / (full.width * full.height));
  return Math.min(2, Math.max(0, Math.round(QUARTERS * (1 - share))));
}

/**
 * @param {number | undefined} width Of the camera's pictures.
 * @param {number | undefined} height
 */
export function hasExactSizes(width, height) {
  return width !== undefined && height !== undefined && width % DIVISOR === 0 && height % DIVISOR === 0;
}

/**
 * A step in words.
 * @param {Step} step
 * @param {{ width?: number, height?: number }} camera
 */
export function stepWords({ level, isEasier }, { width, height }) {
  const why = isEasier ? 'The phone can’t keep up' : 'The phone keeps up again';
  const size = width !== undefined && height !== undefined ? shrunkSize(width, height, level.shrunk) : null;
  const of = size === null ? '' : ` of ${size.width}×${size.height}`;
  return `${why}: ${level.hz} pictures a second${of}`;
}
