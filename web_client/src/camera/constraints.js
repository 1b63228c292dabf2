/** The camera's settings: set, read back, and kept together, for constraints replace each other. */

/** @import {Hint, Lack, Settings} from './wanted_constraints.js' */

import { canExpose, refusedOf, shortly, stepped, wished } from './wanted_constraints.js';

/** One camera's settings. */
export class Lens {
  /** @param {MediaStreamTrack} track */
  constructor(track) {
    this.track = track;
    /** What this browser doesn't let us set, or took and did not do. @type {Lack[]} */
    this.lacks = [];
    /** All that was set and taken: constraints replace each other. @type {Settings} */
    this.taken = {};
    this.steadied = false;
  }

  /** @returns {Settings} */
  get able() {
    return this.track.getCapabilities?.() ?? {};
  }

  /** @returns {Settings} */
  get is() {
    return this.track.getSettings();
  }

  /** Exposure is ours. */
  get isManual() {
    return this.is.exposureMode === 'manual';
  }

  /**
   * Sets what an LED wants, once for each opened camera.
   * @param {number} [robotM] From which the robot is filmed.
   */
  async steady(robotM) {
    if (this.steadied) return;
    this.steadied = true;
    const { wish, lacks } = wished(this.able, this.is, robotM);
    await this.set(wish);
    this.lacks = [...lacks, ...refusedOf(wish, this.is)];
  }

  /**
   * One step towards what a hint asks for; resolves with false if there is none left.
   * @param {Hint} hint
   * @param {number | null} robotM How far the robot is.
   */
  async adjust(hint, robotM) {
    const wish = stepped(hint, this.able, this.is, robotM);
    if (wish === null) return false;
    await this.set(wish);
    return true;
  }

  /**
   * Leaves the exposure to the phone, or takes it back.
   * @param {boolean} automatic
   */
  async expose(automatic) {
    const { able } = this;
    if (!canExpose(able)) return;
    if (!automatic) return this.set(shortly(able, this.is));
    const { exposureTime, iso, ...others } = this.taken;
    this.taken = others;
    await this.set({ exposureMode: 'continuous' });
  }

  /**
   * All at once; where that is refused, one after the other.
   * @param {Settings} wish
   */
  async set(wish) {
    if (Object.keys(wish).length === 0) return;
    if (await this.apply(wish)) return;
    for (const group of grouped(wish)) await this.apply(group);
  }

  /**
   * Alone, as Chrome wants settings of a lens; with the picture's size where it would be lost.
   * @param {Settings} group
   */
  async apply(group) {
    const { track } = this;
    const { width, height } = this.is;
    const base = withoutAdvanced(track.getConstraints());
    const advanced = [/** @type {MediaTrackConstraintSet} */ ({ ...this.taken, ...group })];
    try {
      await track.applyConstraints({ advanced });
    } catch {
      return false;
    }
    this.taken = { ...this.taken, ...group };
    if (this.is.width !== width || this.is.height !== height) {
      await track.applyConstraints({ ...base, advanced }).catch(() => track.applyConstraints(base));
    }
    return true;
  }
}

/** @param {MediaTrackConstraints} constraints */
function withoutAdvanced({ advanced: _, ...base }) {
  return base;
}

/**
 * Settings that only make sense together.
 * @param {Settings} wish
 * @returns {Settings[]}
 */
function grouped(wish) {
  const groups = [['exposureMode', 'exposureTime', 'iso'], ['focusMode', 'focusDistance']];
  const alone = Object.keys(wish).filter((key) => !groups.flat().includes(key)).map((key) => [key]);
  return [...groups, ...alone]
    .map((keys) => Object.fromEntries(keys.filter((key) => key in wish).map((key) => [key, wish[key]])))
    .filter((group) => Object.keys(group).length > 0);
}
