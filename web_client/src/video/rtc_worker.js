/** Worker between encoder and network: each encoded picture carries its record, or goes no further. */

/** @import {Quaternion} from '../wire/protocol.js' */
/** @import {Capture} from './rtc_matcher.js' */

import { CaptureMatcher } from './rtc_matcher.js';
import { quartersOf } from './rate_adaptation.js';
import { withTrailer } from './metadata_trailer.js';

/** @typedef {{ width: number, height: number }} Size */

/**
 * From the page.
 * @typedef {{ type: 'origin', timeOrigin: number } | { type: 'capture', capture: Capture, size: Size }
 *   | { type: 'attitude', orientation: Quaternion | null }
 *   | { type: 'streams', readable: ReadableStream, writable: WritableStream }} ToWorker
 */

/**
 * To the page, for each picture. `pair`: it could not be appended to.
 * @typedef {{ bytes: number, pair: { rtpTimestamp: number, captureUs: number } | null }} FromWorker
 */

const worker = /** @type {any} */ (globalThis);
let matcher = new CaptureMatcher();
let pageOrigin = performance.timeOrigin;
let sequence = 0;
/** @type {Quaternion | null} */
let orientation = null;
/** Of the camera's pictures. @type {Size} */
let full = { width: 0, height: 0 };

/** @param {{ data: ToWorker }} event */
worker.onmessage = ({ data }) => {
  if (data.type === 'origin') {
    pageOrigin = data.timeOrigin;
    matcher = new CaptureMatcher();
  } else if (data.type === 'capture') captured(data);
  else if (data.type === 'streams') join(data);
  else orientation = data.orientation;
};

/** @param {{ capture: Capture, size: Size }} told */
function captured({ capture, size }) {
  matcher.captured(capture);
  full = size;
}

/** @param {{ rtpTimestamp?: number, width?: number, height?: number }} metadata */
function shrunkBy({ width, height }) {
  return width === undefined || height === undefined || full.width === 0 ? 0 : quartersOf({ width, height }, full);
}

/**
 * Whether the frame goes on: not while nobody knows when it was taken.
 * @param {{ data: ArrayBuffer, timestamp: number, getMetadata(): { rtpTimestamp?: number } }} frame
 */
function send(frame) {
  const nowUs = 1000 * (performance.timeOrigin - pageOrigin + performance.now());
  const metadata = frame.getMetadata();
  const rtpTimestamp = metadata.rtpTimestamp ?? frame.timestamp;
  const found = matcher.match(rtpTimestamp, nowUs);
  if (found === null) return false;
  const { captureUs, screenAngle } = found;
  sequence = (sequence + 1) >>> 0;
  /** @type {FromWorker} */
  const told = { bytes: frame.data.byteLength, pair: null };
  try {
    frame.data = withTrailer(frame.data, { sequence, captureUs, screenAngle, orientation, shrunk: shrunkBy(metadata) });
  } catch {
    told.pair = { rtpTimestamp, captureUs };
  }
  worker.postMessage(told);
  return true;
}

/** @param {{ readable: ReadableStream, writable: WritableStream }} streams Of the encoder and of the network. */
function join({ readable, writable }) {
  const records = new TransformStream({
    transform(frame, controller) {
      if (frame.data.byteLength === 0 || send(frame)) controller.enqueue(frame);
    },
  });
  void readable.pipeThrough(records).pipeTo(writable).catch(() => {}); // the connection was closed
}

/** @param {{ transformer: { readable: ReadableStream, writable: WritableStream } }} event */
worker.onrtctransform = ({ transformer }) => join(transformer);
