/** How an encoder of ours has done: what went in, what came out, and how long it took. */

/** @import {Load} from './rate_adaptation.js' */

export class EncoderLoad {
  constructor() {
    /** When the pictures inside went in. @type {number[]} */
    this.inside = [];
    this.hasGiven = false;
    this.sinceMs = this.given = this.out = this.tookMs = 0;
    this.waiting = Infinity;
  }

  /**
   * A picture was meant for it.
   * @param {number} waiting Pictures in its queue.
   */
  meant(waiting) {
    this.given += 1;
    this.waiting = Math.min(this.waiting, waiting);
  }

  /** @param {number} nowMs */
  entered(nowMs) {
    this.inside.push(nowMs);
  }

  /** @param {number} nowMs */
  left(nowMs) {
    const entered = this.inside.shift();
    if (entered === undefined) return;
    this.hasGiven = true;
    this.out += 1;
    this.tookMs += nowMs - entered;
  }

  lost() {
    this.inside.shift();
  }

  /** Another encoder, or another line to the server. */
  reset() {
    this.inside = [];
    this.hasGiven = false;
  }

  /**
   * How long it has held its oldest picture back [ms].
   * @param {number} nowMs
   */
  heldMs(nowMs) {
    return nowMs - (this.inside[0] ?? nowMs);
  }

  /**
   * Since the last call.
   * @param {number} nowMs
   * @returns {Load | null}
   */
  since(nowMs) {
    const seconds = 1e-3 * (nowMs - this.sinceMs);
    const { given, out, tookMs, waiting } = this;
    this.sinceMs = nowMs;
    this.given = this.out = this.tookMs = 0;
    this.waiting = Infinity;
    if (given === 0 || seconds <= 0) return null;
    return {
      inHz: given / seconds,
      outHz: out / seconds,
      encodeMs: out > 0 ? tookMs / out : null,
      waiting,
      starved: out === 0 && this.inside.length > 0,
    };
  }
}
