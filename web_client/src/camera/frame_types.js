/** Frames of a camera, and what they are taken with. */

/** @import {ScreenAngle} from '../wire/protocol.js' */

/**
 * One frame; whoever gets it calls `close`.
 * @typedef {object} Frame
 * @property {VideoFrame | HTMLVideoElement} image
 * @property {number} width As seen upright.
 * @property {number} height
 * @property {number} captureUs On the page's clock.
 * @property {number} lateUs So much later than it was taken that may be [µs].
 * @property {ScreenAngle} screenAngle When it was taken.
 * @property {() => void} close
 */

/** @typedef {(frame: Frame) => void} OnFrame */
/** @typedef {{ name: string, stop: () => void }} Source */
/** @typedef {{ readable: ReadableStream<VideoFrame> }} Processor */
/** @typedef {new (init: { track: MediaStreamTrack, maxBufferSize?: number }) => Processor} ProcessorClass */

/**
 * @typedef {object} Surroundings
 * @property {{ now(): number }} performance
 * @property {HTMLVideoElement} video Shows the stream.
 * @property {MediaStreamTrack} track
 * @property {ProcessorClass | undefined} Processor Of the page.
 * @property {(() => Worker) | undefined} startWorker Where a worker may have the processor.
 * @property {() => ScreenAngle} screenAngle
 * @property {OnFrame} onFrame
 */

export {};
