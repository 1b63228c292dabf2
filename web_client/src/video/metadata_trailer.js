/**
 * The record that rides at the end of an encoded picture, as `server/rtc/receiving/metadata_trailer.py` reads it: 30 bytes, each
 * with its highest bit set, so that no start code can appear in them.
 */

/** @import {Quaternion, ScreenAngle} from '../wire/protocol.js' */

/**
 * What is said of one picture.
 * @typedef {object} FrameRecord
 * @property {number} sequence Counts the pictures that left the encoder.
 * @property {number} captureUs When it was taken, on the page's clock.
 * @property {ScreenAngle} screenAngle
 * @property {Quaternion | null} orientation Device to earth.
 * @property {number} shrunk By so many quarters the picture is smaller than the camera's.
 */

const FIELDS_BYTES = 21;
const RAW_BYTES = FIELDS_BYTES + 2;
const GROUP = 7;
const MARK = [0xcc, 0xd2, 0x81];
export const TRAILER_BYTES = RAW_BYTES + Math.ceil(RAW_BYTES / GROUP) + MARK.length;
const ONE = 32767;
const HAS_ORIENTATION = 4;
const SHRUNK = 3;

/**
 * An encoded picture with its record behind it.
 * @param {ArrayBuffer} data
 * @param {FrameRecord} record
 */
export function withTrailer(data, record) {
  const whole = new Uint8Array(data.byteLength + TRAILER_BYTES);
  whole.set(new Uint8Array(data));
  whole.set(escaped(rawOf(record)), data.byteLength);
  whole.set(MARK, whole.length - MARK.length);
  return whole.buffer;
}

/** @param {FrameRecord} record */
function rawOf({ sequence, captureUs, screenAngle, orientation, shrunk }) {
  const raw = new Uint8Array(RAW_BYTES);
  const view = new DataView(raw.buffer);
  view.setUint32(0, sequence, true);
  view.setBigInt64(4, BigInt(Math.max(0, Math.round(captureUs))), true);
  view.setUint8(12, screenAngle / 90 + (orientation ? HAS_ORIENTATION : 0) + (shrunk << SHRUNK));
  (orientation ?? [1, 0, 0, 0]).forEach((q, i) => {
    view.setInt16(13 + 2 * i, Math.round(ONE * Math.min(1, Math.max(-1, q))), true);
  });
  view.setUint16(FIELDS_BYTES, crc16(raw.subarray(0, FIELDS_BYTES)), true);
  return raw;
}

/**
 * CRC-16 with polynomial 0x1021, beginning with 0.
 * @param {Uint8Array} bytes
 */
export function crc16(bytes) {
  let crc = 0;
  for (const byte of bytes) {
    crc ^= byte << 8;
    for (let bit = 0; bit < 8; bit += 1) crc = (crc & 0x8000 ? (crc << 1) ^ 0x1021 : crc << 1) & 0xffff;
  }
  return crc;
}

/**
 * Groups of seven bytes with their highest bits set, each followed by a byte of what those bits were.
 * @param {Uint8Array} raw
 */
function escaped(raw) {
  const out = [];
  for (let at = 0; at < raw.length; at += GROUP) {
    const group = [...raw.subarray(at, at + GROUP)];
    out.push(...group.map((byte) => byte | 0x80));
    out.push(0x80 | group.reduce((bits, byte, i) => bits | ((byte >> 7) << i), 0));
  }
  return out;
}
