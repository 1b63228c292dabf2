/**
 * The records of the wire, as in `server/protocol/wire.py`: little-endian, a header of 16 bytes, then a payload.
 * A sequence number counts one kind of record of one connection.
 */

/** @import {ToPage} from './protocol_types.js' */

export const VERSION = 2;
export const MAX_RECORD_BYTES = 262_144;
const MAGIC = 0x4c;
const HEADER_BYTES = 16;
const FRAME_HEAD_BYTES = 8;

export const Kind = Object.freeze({
  MOTION: 1, FRAME: 2, TOUCH: 3, PONG: 4, STAMP: 5, PING: 129, CREDIT: 130, PICTURE: 131,
});

export const Codec = Object.freeze({ JPEG: 1, H264: 2, VP8: 3 });

/**
 * @typedef {[number, number, number]} Triple
 * @typedef {[number, number, number, number]} Quaternion w, x, y, z
 * @typedef {0 | 90 | 180 | 270} ScreenAngle
 */

/**
 * @typedef {object} Motion
 * @property {Triple} rotation_rate [rad/s] about the device's x, y, z.
 * @property {Triple} acceleration [m/s²] with gravity, +9.8 up at rest.
 * @property {Quaternion | null} orientation_wxyz Device to earth.
 * @property {ScreenAngle} screen_angle_deg
 */

/**
 * @typedef {object} Picture
 * @property {number} codec One of `Codec`.
 * @property {boolean} key Decodable without an earlier one.
 * @property {number} [shrunk] By so many quarters it is smaller than the camera's.
 * @property {number} width
 * @property {number} height
 * @property {ScreenAngle} screen_angle_deg
 * @property {Uint8Array} data
 */

/**
 * @typedef {object} Touch
 * @property {boolean} held
 * @property {boolean} visible
 * @property {number} press Counts presses.
 * @property {bigint} nonce The newest one received.
 */

/**
 * What a page receives.
 * @typedef {{ kind: 129, sequence: number, tUs: number, nonce: bigint }
 *   | { kind: 130, sequence: number, tUs: number, taken: number }
 *   | { kind: 131, sequence: number, tUs: number, data: Uint8Array<ArrayBuffer> }} Received
 */

/** A record or message that can't be read. */
export class ProtocolError extends Error {}

/**
 * @param {number} kind
 * @param {number} flags
 * @param {number} sequence
 * @param {number} tUs Time on the page's clock [µs].
 * @param {number} payloadBytes
 */
function begin(kind, flags, sequence, tUs, payloadBytes) {
  const view = new DataView(new ArrayBuffer(HEADER_BYTES + payloadBytes));
  view.setUint8(0, MAGIC);
  view.setUint8(1, VERSION);
  view.setUint8(2, kind);
  view.setUint8(3, flags);
  view.setUint32(4, sequence, true);
  view.setBigInt64(8, BigInt(Math.round(tUs)), true);
  return view;
}

/**
 * @param {number} sequence
 * @param {number} tUs When the sensors were read [µs].
 * @param {Motion} motion
 */
export function encodeMotion(sequence, tUs, motion) {
  const orientation = motion.orientation_wxyz;
  const view = begin(Kind.MOTION, orientation ? 1 : 0, sequence, tUs, 44);
  const values = [
    ...motion.rotation_rate, ...motion.acceleration, ...(orientation ?? [1, 0, 0, 0]),
  ];
  values.forEach((value, i) => view.setFloat32(HEADER_BYTES + 4 * i, value, true));
  view.setInt16(HEADER_BYTES + 40, motion.screen_angle_deg, true);
  return view.buffer;
}

/**
 * @param {number} sequence
 * @param {number} tUs When the picture was taken [µs].
 * @param {Picture} picture
 */
export function encodeFrame(sequence, tUs, picture) {
  const bytes = FRAME_HEAD_BYTES + picture.data.byteLength;
  const view = begin(Kind.FRAME, picture.key ? 1 : 0, sequence, tUs, bytes);
  view.setUint8(HEADER_BYTES, picture.codec);
  view.setUint8(HEADER_BYTES + 1, picture.shrunk ?? 0);
  view.setUint16(HEADER_BYTES + 2, picture.width, true);
  view.setUint16(HEADER_BYTES + 4, picture.height, true);
  view.setInt16(HEADER_BYTES + 6, picture.screen_angle_deg, true);
  new Uint8Array(view.buffer, HEADER_BYTES + FRAME_HEAD_BYTES).set(picture.data);
  return view.buffer;
}

/**
 * @param {number} sequence
 * @param {number} tUs Now [µs].
 * @param {Touch} touch
 */
export function encodeTouch(sequence, tUs, touch) {
  const view = begin(Kind.TOUCH, 0, sequence, tUs, 16);
  view.setUint8(HEADER_BYTES, touch.held ? 1 : 0);
  view.setUint8(HEADER_BYTES + 1, touch.visible ? 1 : 0);
  view.setUint32(HEADER_BYTES + 4, touch.press, true);
  view.setBigUint64(HEADER_BYTES + 8, touch.nonce, true);
  return view.buffer;
}

/**
 * @param {number} sequence
 * @param {number} tUs Now [µs].
 * @param {{ nonce: bigint, tUs: number }} ping The PING to answer.
 */
export function encodePong(sequence, tUs, ping) {
  const view = begin(Kind.PONG, 0, sequence, tUs, 16);
  view.setBigUint64(HEADER_BYTES, ping.nonce, true);
  view.setBigInt64(HEADER_BYTES + 8, BigInt(ping.tUs), true);
  return view.buffer;
}

/**
 * @param {number} sequence
 * @param {number} tUs When the picture was taken [µs].
 * @param {number} rtpTimestamp Of the picture, which can't say so itself.
 */
export function encodeStamp(sequence, tUs, rtpTimestamp) {
  const view = begin(Kind.STAMP, 0, sequence, tUs, 4);
  view.setUint32(HEADER_BYTES, rtpTimestamp, true);
  return view.buffer;
}

/**
 * The record in `buffer`.
 * @param {ArrayBuffer} buffer
 * @returns {Received}
 */
export function decodeRecord(buffer) {
  const view = new DataView(buffer);
  if (view.byteLength < HEADER_BYTES || view.getUint8(0) !== MAGIC) {
    throw new ProtocolError('not a Lightleash record');
  }
  if (view.getUint8(1) !== VERSION) {
    throw new ProtocolError(`record version ${view.getUint8(1)}, this page speaks ${VERSION}`);
  }
  const kind = view.getUint8(2);
  const sequence = view.getUint32(4, true);
  const tUs = Number(view.getBigInt64(8, true));
  switch (kind) {
    case Kind.PING:
      demandPayload(view, 8);
      return { kind: Kind.PING, sequence, tUs, nonce: view.getBigUint64(HEADER_BYTES, true) };
    case Kind.CREDIT:
      demandPayload(view, 4);
      return { kind: Kind.CREDIT, sequence, tUs, taken: view.getUint32(HEADER_BYTES, true) };
    case Kind.PICTURE:
      return { kind: Kind.PICTURE, sequence, tUs, data: new Uint8Array(buffer, HEADER_BYTES) };
  }
  throw new ProtocolError(`record of unknown kind ${kind}`);
}

/**
 * @param {DataView} view
 * @param {number} bytes
 */
function demandPayload(view, bytes) {
  if (view.byteLength !== HEADER_BYTES + bytes) {
    throw new ProtocolError(`payload of ${view.byteLength - HEADER_BYTES} bytes, expected ${bytes}`);
  }
}

/**
 * The JSON message in `text`; unknown types are the caller's to ignore.
 * @param {string} text
 * @returns {ToPage}
 */
export function decodeMessage(text) {
  const message = JSON.parse(text);
  if (typeof message !== 'object' || message === null || typeof message.type !== 'string') {
    throw new ProtocolError('message without a type');
  }
  return message;
}
