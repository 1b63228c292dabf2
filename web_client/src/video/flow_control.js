/** How many frames may be under way between the camera and the server. */

export const MAX_UNDER_WAY = 3;
/** A frame whose credit has not come for so long is given up: the server has refused it. */
const GIVE_UP_MS = 2000;

/** Counts the frames under way: taken by the encoder, or sent and not yet credited. */
export class Credits {
  constructor() {
    this.encoding = 0;
    /** @type {{ sequence: number, sentMs: number }[]} */
    this.sent = [];
    /** @type {number[]} */
    this.roundTripsMs = [];
  }

  /** @param {number} now [ms] */
  mayTake(now) {
    while (this.sent[0] !== undefined && now - this.sent[0].sentMs > GIVE_UP_MS) this.sent.shift();
    return this.encoding + this.sent.length < MAX_UNDER_WAY;
  }

  /** A frame went into the encoder. */
  taken() {
    this.encoding += 1;
  }

  /** A frame that was taken will not be sent. */
  lost() {
    this.encoding = Math.max(0, this.encoding - 1);
  }

  /**
   * @param {number} sequence Of the FRAME sent.
   * @param {number} now [ms]
   */
  wasSent(sequence, now) {
    this.lost();
    this.sent.push({ sequence, sentMs: now });
  }

  /**
   * The server has taken this frame, and with it all before.
   * @param {number} sequence
   * @param {number} now [ms]
   */
  credit(sequence, now) {
    const i = this.sent.findIndex((frame) => frame.sequence === sequence);
    const frame = this.sent[i];
    if (frame === undefined) return;
    this.roundTripsMs = [...this.roundTripsMs.slice(-19), now - frame.sentMs];
    this.sent = this.sent.slice(i + 1);
  }

  /** The quickest way there and back of the last frames [ms], or null. */
  get roundTripMs() {
    return this.roundTripsMs.length > 0 ? Math.min(...this.roundTripsMs) : null;
  }
}
