/** Holds cameras and encoders to a pace they can keep, and says so. */

/** @import {Level, Load} from './rate_adaptation.js' */

import { Pace, hasExactSizes, stepWords } from './rate_adaptation.js';

/**
 * @typedef {object} Surroundings
 * @property {{ load(): Promise<Load | null>, ease(level: Level): void }} paths
 * @property {() => { width?: number, height?: number }} camera Its picture's size.
 * @property {(words: string) => void} tell The person, and the supervisor.
 */

export class PaceKeeper {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    /** @type {Pace | null} */
    this.pace = null;
    this.isLooking = false;
    this.isWhole = false;
    this.hz = 0;
  }

  /**
   * The camera has settled on a picture: as many of it as are wanted.
   * @param {number} hz
   */
  begin(hz) {
    const { width, height } = this.surroundings.camera();
    this.hz = hz;
    this.pace = new Pace(hz, hasExactSizes(width, height));
    this.apply();
  }

  /** @param {boolean} whole Only pictures of the camera's own size are of use now. */
  wantWhole(whole) {
    if (whole === this.isWhole) return;
    this.isWhole = whole;
    this.apply();
  }

  /** @returns {Level | null} */
  get level() {
    if (this.pace === null) return null;
    return { ...this.pace.level, shrunk: this.isWhole ? 0 : this.pace.level.shrunk };
  }

  /** What is kept back, in a sign for the screen: fewer pictures, or the share of their size; "" if nothing is. */
  get sign() {
    const { level } = this;
    if (level === null || (level.hz >= this.hz && level.shrunk === 0)) return '';
    return ['↓', '¾', '½'][level.shrunk] ?? '';
  }

  /** To be called at even intervals. */
  async look() {
    const { pace } = this;
    if (pace === null || this.isLooking) return;
    this.isLooking = true;
    try {
      const step = pace.look(await this.surroundings.paths.load());
      if (step === null || pace !== this.pace) return;
      this.apply();
      this.surroundings.tell(stepWords(step, this.surroundings.camera()));
    } finally {
      this.isLooking = false;
    }
  }

  apply() {
    if (this.level !== null) this.surroundings.paths.ease(this.level);
  }
}
