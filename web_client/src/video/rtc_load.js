/** What WebRTC's statistics say of the encoder and of the way. */

/** @import {Load} from './rate_adaptation.js' */

/**
 * Counts since the connection began.
 * @typedef {object} Counts
 * @property {number} encoded Pictures.
 * @property {number | null} encodeMs Spent on them; null if this browser does not say.
 * @property {boolean} starved
 */

/**
 * @param {Iterable<any>} reports Of a sender's statistics.
 * @returns {Counts | null} Null before anything was sent.
 */
export function countsOf(reports) {
  for (const report of reports) {
    if (report.type !== 'outbound-rtp' || report.framesEncoded === undefined) continue;
    const { framesEncoded: encoded, totalEncodeTime, qualityLimitationReason } = report;
    const encodeMs = totalEncodeTime === undefined ? null : 1000 * totalEncodeTime;
    return { encoded, encodeMs, starved: qualityLimitationReason === 'cpu' };
  }
  return null;
}

/**
 * There and back [ms], by RTCP; null before the first answer.
 * @param {Iterable<any>} reports Of a sender's statistics.
 */
export function roundTripOf(reports) {
  for (const { type, roundTripTime } of reports) {
    if (type === 'remote-inbound-rtp' && roundTripTime !== undefined) return 1000 * roundTripTime;
  }
  return null;
}

/** From counts to a load. */
export class RtcLoad {
  constructor() {
    /** @type {(Counts & { nowMs: number }) | null} */
    this.last = null;
  }

  /**
   * Since the last call.
   * @param {Counts | null} counts
   * @param {number} inHz Pictures a second that the camera gave.
   * @param {number} nowMs
   * @returns {Load | null}
   */
  since(counts, inHz, nowMs) {
    const { last } = this;
    this.last = counts === null ? null : { ...counts, nowMs };
    if (counts === null || last === null || counts.encoded < last.encoded || nowMs <= last.nowMs) return null;
    const pictures = counts.encoded - last.encoded;
    const known = counts.encodeMs !== null && last.encodeMs !== null && pictures > 0;
    return {
      inHz,
      outHz: (1000 * pictures) / (nowMs - last.nowMs),
      encodeMs: known ? (Number(counts.encodeMs) - Number(last.encodeMs)) / pictures : null,
      waiting: 0,
      starved: counts.starved,
    };
  }
}
