/**
 * Which picture of the camera is this encoded frame? Browsers do not say. The frame bears RTP's time stamp,
 * whose clock began anywhere but runs beside the camera's to a millisecond: how far it is ahead is found by
 * laying the frames' stamps over the captures', as a key over a lock. A few frames fit in many places, and a starved
 * page tells late of its captures: until it has told of enough frames' for certain, no frame has a date.
 */

/** @import {ScreenAngle} from '../wire/protocol.js' */

import { smallest } from '../wire/clock.js';

/**
 * @typedef {object} Capture
 * @property {number} captureUs On the page's clock.
 * @property {number} stampUs On the camera's.
 * @property {number} lateUs So much later than it was taken `captureUs` may be [µs].
 * @property {ScreenAngle} screenAngle
 */

/** @typedef {{ stampUs: number, outUs: number }} Encoded By RTP's clock, and when it left on the page's. */

const RTP_PER_US = 0.09;
const KEPT_CAPTURES = 128;
const KEPT_FRAMES = 40;
/** A starved page tells late of its captures: frames that left so long ago have theirs for certain [µs]. */
const HINDSIGHT_US = 300_000;
const ENOUGH = 8;
/** A capture so long before is not the one that comes out [µs]. */
const OLD_US = 200_000;
/** A capture further from where it should be is another picture's, its own was skipped [µs]. */
const FAR_US = 5000;
/** Where cameras are too regular to tell, the quicker encoder is believed: a period costs half a ms. */
const DELAY_COST = 0.015;
/** None leaves before it was taken, but a busy page takes captures for later than it knows: at a cost. */
const EARLY_COST = 0.2;

export class CaptureMatcher {
  constructor() {
    /** @type {Capture[]} */
    this.captures = [];
    /** @type {Encoded[]} */
    this.frames = [];
    /** How far RTP's clock is ahead of the camera's [µs]. @type {number | null} */
    this.aheadUs = null;
    /** How far the page's is: a busy page takes its first captures for up to 70 ms later than they were. */
    this.pageAheadUs = 0;
    this.isSure = false;
    /** @type {number | null} */
    this.lastStamp = null;
    this.ticks = 0;
    this.lastUs = -Infinity;
    /** No frame leaves before it was taken, but captures may be told so late [µs], */
    this.lateUs = 0;
    /** and are, by the quickest frame. */
    this.foundLateUs = 0;
  }

  /** @param {Capture} capture In the order of time. */
  captured(capture) {
    this.captures.push(capture);
    this.lateUs = capture.lateUs;
    if (this.captures.length > KEPT_CAPTURES) this.captures.shift();
    this.pageAheadUs = Number(smallest(this.captures.map(({ captureUs, stampUs }) => captureUs - stampUs)).at(-1));
  }

  /**
   * When an encoded frame was taken, on the page's clock, and how the screen stood; null: not known for certain.
   * @param {number} rtpTimestamp
   * @param {number} nowUs On the page's clock.
   * @returns {Pick<Capture, 'captureUs' | 'screenAngle'> | null}
   */
  match(rtpTimestamp, nowUs) {
    const stampUs = this.unwrapped(rtpTimestamp) / RTP_PER_US;
    this.frames.push({ stampUs, outUs: nowUs });
    if (this.frames.length > KEPT_FRAMES) this.frames.shift();
    this.aheadUs = this.ahead(nowUs);
    if (this.aheadUs === null) return null;
    const near = nearest(this.captures, stampUs - this.aheadUs);
    this.lastUs = Math.max(this.takenUs(stampUs - this.aheadUs) - this.foundLateUs, this.lastUs + 1);
    return { captureUs: this.lastUs, screenAngle: near?.screenAngle ?? 0 };
  }

  /**
   * On the page's clock.
   * @param {number} stampUs By the camera's: of a capture, or of one that the page has skipped.
   */
  takenUs(stampUs) {
    const offUs = offset(this.captures, stampUs);
    return stampUs + this.pageAheadUs - (Math.abs(offUs) <= FAR_US ? offUs : 0);
  }

  /**
   * How far RTP's clock is ahead of the camera's: of all that is possible, what fits best; null: not known yet.
   * @param {number} nowUs
   */
  ahead(nowUs) {
    const old = this.frames.filter(({ outUs }) => outUs <= nowUs - HINDSIGHT_US);
    this.isSure ||= old.length >= ENOUGH;
    if (!this.isSure) return null;
    const frames = old.length >= ENOUGH ? old : this.frames;
    // at first by every frame: the last one's own capture may have been skipped
    const tried = frames.slice(this.aheadUs === null ? 0 : -1).flatMap((frame) => this.possible(frame));
    if (this.aheadUs !== null) tried.push(this.aheadUs);
    let best = this.aheadUs;
    let least = Infinity;
    for (const rough of tried) {
      const { aheadUs, delayUs, misfit } = this.fit(rough, frames);
      if (misfit < least) [best, least, this.foundLateUs] = [aheadUs, misfit, Math.max(0, -delayUs)];
    }
    return best;
  }

  /** How far RTP's clock would be ahead by each capture that a frame may be. @param {Encoded} frame */
  possible({ stampUs, outUs }) {
    return this.captures
      .map((capture) => stampUs - capture.stampUs)
      .filter((aheadUs) => {
        const delayUs = outUs - stampUs + aheadUs - this.pageAheadUs;
        return delayUs < OLD_US && delayUs >= -this.lateUs;
      });
  }

  /**
   * @param {number} roughUs How far RTP's clock may be ahead.
   * @param {Encoded[]} frames
   */
  fit(roughUs, frames) {
    const offsets = frames.map(({ stampUs }) => offset(this.captures, stampUs - roughUs));
    const aheadUs = roughUs + median(offsets);
    let misfit = 0;
    let delayUs = Infinity;
    for (const { stampUs, outUs } of frames) {
      const wayUs = stampUs - aheadUs;
      misfit += Math.min(Math.abs(offset(this.captures, wayUs)), FAR_US) / frames.length;
      delayUs = Math.min(delayUs, outUs - this.takenUs(wayUs));
    }
    const earlyUs = Math.max(0, -this.lateUs - delayUs);
    return { aheadUs, delayUs, misfit: misfit + DELAY_COST * delayUs + EARLY_COST * earlyUs };
  }

  /** @param {number} rtpTimestamp */
  unwrapped(rtpTimestamp) {
    this.ticks += (rtpTimestamp - (this.lastStamp ?? rtpTimestamp)) | 0;
    this.lastStamp = rtpTimestamp;
    return this.ticks;
  }
}

/**
 * @param {Capture[]} captures In the order of time.
 * @param {number} stampUs
 */
function nearest(captures, stampUs) {
  let low = 0;
  let high = captures.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (/** @type {Capture} */ (captures[middle]).stampUs < stampUs) low = middle + 1;
    else high = middle;
  }
  const after = captures[low] ?? null;
  const before = captures[low - 1] ?? null;
  if (before === null || after === null) return before ?? after;
  return stampUs - before.stampUs <= after.stampUs - stampUs ? before : after;
}

/**
 * From the nearest capture [µs].
 * @param {Capture[]} captures
 * @param {number} stampUs
 */
function offset(captures, stampUs) {
  return stampUs - (nearest(captures, stampUs)?.stampUs ?? stampUs);
}

/** @param {number[]} values At least one. */
function median(values) {
  const sorted = [...values].sort((a, b) => a - b);
  return /** @type {number} */ (sorted[values.length >> 1]);
}
