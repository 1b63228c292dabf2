/**
 * Camera frames with their capture time, by whichever way this browser has: a MediaStreamTrackProcessor in
 * the page (Chrome) or in a worker (Safari), or the video element's frame callback (Firefox).
 */

/** @import {Frame, ProcessorClass, Source, Surroundings} from './frame_types.js' */
/** @import {ScreenAngle} from '../wire/protocol.js' */

import { MinimumDelayClock, eventUs, nowUs } from '../wire/clock.js';

/** Clocks are read late [µs]. */
const READ_LATE_US = 2000;
/** A video element tells of a frame on its way to the screen: a 60th of a second [µs]. */
const SHOWN_LATE_US = 17_000;

/**
 * Starts the best way of getting frames.
 * @param {Surroundings} surroundings
 * @returns {Promise<Source>}
 */
export async function startFrames(surroundings) {
  if (surroundings.Processor !== undefined) return fromProcessor(surroundings, surroundings.Processor);
  const source = surroundings.startWorker && (await fromWorker(surroundings, surroundings.startWorker()));
  return source || fromVideo(surroundings);
}

/**
 * @param {Surroundings} surroundings
 * @param {ProcessorClass} Processor
 * @returns {Source}
 */
function fromProcessor({ track, performance, screenAngle, onFrame }, Processor) {
  const clock = new MinimumDelayClock();
  const reader = new Processor({ track, maxBufferSize: 1 }).readable.getReader();
  const read = async () => {
    for (;;) {
      const { value, done } = await reader.read();
      if (done) return;
      const captureUs = clock.captureUs(value.timestamp, nowUs(performance));
      onFrame(frameOf(value, captureUs, screenAngle()));
    }
  };
  void read();
  return { name: 'track processor', stop: () => void reader.cancel().catch(() => {}) };
}

/**
 * The worker hands over one frame at a time and waits for our word, so that none pile up.
 * @param {Surroundings} surroundings
 * @param {Worker} worker
 * @returns {Promise<Source | null>} Null when the worker has no processor either.
 */
async function fromWorker({ track, performance, screenAngle, onFrame }, worker) {
  const clock = new MinimumDelayClock();
  const copy = track.clone();
  const stop = () => {
    worker.terminate();
    copy.stop();
  };
  /** @type {Promise<boolean>} */
  const ready = new Promise((resolve) => {
    worker.onerror = () => resolve(false);
    worker.onmessage = ({ data }) => {
      if (typeof data === 'boolean') {
        resolve(data);
        return;
      }
      const captureUs = clock.captureUs(data.timestamp, nowUs(performance));
      worker.postMessage('next');
      onFrame(frameOf(data, captureUs, screenAngle()));
    };
  });
  try {
    worker.postMessage(copy, /** @type {any} */ ([copy]));
  } catch { // tracks can't be handed to workers here
    stop();
    return null;
  }
  if (await ready) return { name: 'track processor in a worker', stop };
  stop();
  return null;
}

/**
 * @param {Surroundings} surroundings
 * @returns {Source}
 */
function fromVideo({ video, performance, screenAngle, onFrame }) {
  const clock = new MinimumDelayClock();
  const hasFrames = typeof VideoFrame === 'function';
  let handle = 0;
  /** @type {VideoFrameRequestCallback} */
  const callback = (_, metadata) => {
    handle = video.requestVideoFrameCallback(callback);
    const now = nowUs(performance);
    const captureUs = metadata.captureTime === undefined
      ? clock.captureUs(metadata.mediaTime * 1e6, now)
      : eventUs(metadata.captureTime, now);
    const image = hasFrames ? new VideoFrame(video, { timestamp: Math.round(captureUs) }) : video;
    onFrame({
      image,
      width: metadata.width,
      height: metadata.height,
      captureUs,
      lateUs: metadata.captureTime === undefined ? SHOWN_LATE_US : READ_LATE_US,
      screenAngle: screenAngle(),
      close: () => {
        if (image !== video) /** @type {VideoFrame} */ (image).close();
      },
    });
  };
  handle = video.requestVideoFrameCallback(callback);
  return { name: 'video element', stop: () => video.cancelVideoFrameCallback(handle) };
}

/**
 * @param {VideoFrame} raw
 * @param {number} captureUs
 * @param {ScreenAngle} screenAngle
 * @returns {Frame}
 */
function frameOf(raw, captureUs, screenAngle) {
  const image = upright(raw);
  const { displayWidth: width, displayHeight: height } = image;
  return { image, width, height, captureUs, lateUs: READ_LATE_US, screenAngle, close: () => image.close() };
}

/**
 * Frames that are only marked as turned are turned: encoders pass the mark by.
 * @param {VideoFrame & { rotation?: number, flip?: boolean }} frame
 * @returns {VideoFrame}
 */
function upright(frame) {
  if (!frame.rotation && !frame.flip) return frame;
  const canvas = new OffscreenCanvas(frame.displayWidth, frame.displayHeight);
  canvas.getContext('2d')?.drawImage(frame, 0, 0, canvas.width, canvas.height);
  const turned = new VideoFrame(canvas, { timestamp: frame.timestamp });
  frame.close();
  return turned;
}
