/** Frames to bytes: H.264 where the browser can, else JPEG. */

/** @import {Frame} from '../camera/frame_types.js' */
/** @import {JpegAnswer} from './jpeg_worker.js' */
/** @import {Wanted} from '../camera/camera.js' */

import { shrunkSize } from './rate_adaptation.js';
import { Codec, MAX_RECORD_BYTES } from '../wire/protocol.js';

/** The server asks for a key when it lacks one; each costs the ten pictures after it their sharpness. */
const KEY_EVERY_US = 10e6;
const JPEG_QUALITY = 0.7;
const HEADERS_BYTES = 24;

/**
 * A frame without its picture.
 * @typedef {Pick<Frame, 'width' | 'height' | 'captureUs' | 'screenAngle'> & { shrunk: number }} About
 */

/**
 * @typedef {object} Encoded
 * @property {number} codec One of `Codec`.
 * @property {boolean} key
 * @property {About} about
 * @property {Uint8Array} data
 */

/**
 * `encode` takes the frame over and calls `onEncoded` or `onLost` once for it.
 * @typedef {object} Encoder
 * @property {string} name
 * @property {number} shrunk By so many quarters its pictures are smaller than the camera's.
 * @property {number} waiting Pictures in its queue.
 * @property {(frame: Frame) => void} encode
 * @property {() => void} requestKey
 * @property {() => void} close
 */

/**
 * @typedef {object} Outlet
 * @property {(encoded: Encoded) => void} onEncoded
 * @property {() => void} onLost One frame that was taken will not come out.
 * @property {(error: unknown) => void} onFailure The encoder is of no more use.
 */

/** @typedef {Wanted & { bitrate_bps: number }} Stream */

/**
 * H.264 settings to try, best first: constrained baseline, at the lowest level that has the picture.
 * @param {Stream} stream
 * @returns {VideoEncoderConfig[]}
 */
export function h264Candidates(stream) {
  const blocks = Math.ceil(stream.width / 16) * Math.ceil(stream.height / 16);
  const fits = LEVELS.filter(([, size, rate]) => blocks <= size && blocks * stream.frame_rate_hz <= rate);
  return fits.flatMap(([level]) => [`42E0${level}`, `4200${level}`]).map((profile) => ({
    codec: `avc1.${profile}`,
    width: stream.width,
    height: stream.height,
    bitrate: stream.bitrate_bps,
    framerate: stream.frame_rate_hz,
    latencyMode: 'realtime',
    avc: { format: 'annexb' },
  }));
}

/** Levels 3.1 to 5.1: name, blocks in a picture, blocks a second. @type {[string, number, number][]} */
const LEVELS = [
  ['1F', 3600, 108000], ['20', 5120, 216000], ['28', 8192, 245760], ['2A', 8704, 522240],
  ['33', 36864, 983040],
];

/**
 * The first settings the browser can encode with, or null.
 * @param {Pick<typeof VideoEncoder, 'isConfigSupported'> | undefined} Encoders
 * @param {Stream} stream
 */
export async function supportedH264(Encoders, stream) {
  for (const config of h264Candidates(stream)) {
    const answer = await Encoders?.isConfigSupported(config).catch(() => null);
    if (answer?.supported) return config;
  }
  return null;
}

/** @implements {Encoder} */
export class H264Encoder {
  name = 'H.264';
  shrunk = 0;

  /**
   * @param {typeof VideoEncoder} Encoders
   * @param {VideoEncoderConfig} config Its size is replaced by that of the frames.
   * @param {Outlet} outlet
   */
  constructor(Encoders, config, outlet) {
    this.config = config;
    this.outlet = outlet;
    this.wantsKey = true;
    this.lastKeyUs = -Infinity;
    /** Frames in the encoder by time stamp. @type {Map<number, About>} */
    this.inside = new Map();
    this.encoder = new Encoders({
      output: (chunk) => this.output(chunk),
      error: (error) => outlet.onFailure(error),
    });
  }

  /** @param {Frame} frame */
  encode(frame) {
    const image = /** @type {VideoFrame} */ (frame.image);
    try {
      const about = aboutOf(frame, this.shrunk);
      this.fit(about);
      const keyFrame = this.wantsKey || frame.captureUs - this.lastKeyUs >= KEY_EVERY_US;
      this.inside.set(image.timestamp, about);
      this.encoder.encode(image, { keyFrame });
      if (keyFrame) this.lastKeyUs = frame.captureUs;
      this.wantsKey = this.wantsKey && !keyFrame;
    } catch (error) {
      this.inside.delete(image.timestamp);
      this.outlet.onLost();
      this.outlet.onFailure(error);
    } finally {
      frame.close();
    }
  }

  get waiting() {
    return this.encoder.encodeQueueSize ?? 0;
  }

  /**
   * The phone was turned, another size is wanted, or this is the first frame. The encoder scales.
   * @param {About} about
   */
  fit({ width, height }) {
    const same = this.config.width === width && this.config.height === height;
    if (same && this.encoder.state === 'configured') return;
    this.config = { ...this.config, width, height };
    this.encoder.configure(this.config);
    this.wantsKey = true;
  }

  /** @param {EncodedVideoChunk} chunk */
  output(chunk) {
    const about = this.inside.get(chunk.timestamp);
    if (about === undefined) return;
    for (const timestamp of this.inside.keys()) {
      this.inside.delete(timestamp);
      if (timestamp === chunk.timestamp) break;
      this.outlet.onLost(); // it may drop pictures, and says nothing of them
    }
    const data = new Uint8Array(chunk.byteLength);
    if (data.byteLength + HEADERS_BYTES > MAX_RECORD_BYTES) {
      this.wantsKey = true;
      this.outlet.onLost();
      return;
    }
    chunk.copyTo(data);
    this.outlet.onEncoded({ codec: Codec.H264, key: chunk.type === 'key', about, data });
  }

  requestKey() {
    this.wantsKey = true;
  }

  close() {
    if (this.encoder.state !== 'closed') this.encoder.close();
  }
}

/** Compresses in a worker, whatever the page is busy with. @implements {Encoder} */
export class JpegEncoder {
  name = 'JPEG';
  shrunk = 0;
  waiting = 0;

  /**
   * @param {() => Worker} startWorker Starts `jpeg_worker.js`.
   * @param {Outlet} outlet
   */
  constructor(startWorker, outlet) {
    this.outlet = outlet;
    this.quality = JPEG_QUALITY;
    this.newestUs = -Infinity;
    this.id = 0;
    /** Frames in the worker. @type {Map<number, About>} */
    this.inside = new Map();
    this.worker = startWorker();
    this.worker.onmessage = ({ data }) => this.output(data);
    this.worker.onerror = () => outlet.onFailure(new Error('its worker did not start'));
  }

  /** @param {Frame} frame */
  encode(frame) {
    const about = aboutOf(frame, this.shrunk);
    this.id += 1;
    this.inside.set(this.id, about);
    void this.hand(frame, this.id, about);
  }

  /**
   * @param {Frame} frame
   * @param {number} id
   * @param {About} about
   */
  async hand(frame, id, { width, height }) {
    try {
      const image = await handed(frame);
      this.worker.postMessage({ id, image, width, height, quality: this.quality }, [image]);
    } catch (error) {
      this.output({ id, error: String(error) });
    } finally {
      frame.close();
    }
  }

  /** @param {JpegAnswer} answer */
  output({ id, data, error }) {
    const about = this.inside.get(id);
    this.inside.delete(id);
    if (about === undefined) return;
    if (data === undefined) {
      this.outlet.onLost();
      this.outlet.onFailure(new Error(error));
    } else if (data.byteLength + HEADERS_BYTES > MAX_RECORD_BYTES) {
      this.quality = Math.max(0.3, this.quality - 0.1);
      this.outlet.onLost();
    } else if (about.captureUs < this.newestUs) { // overtaken by a later one
      this.outlet.onLost();
    } else {
      this.newestUs = about.captureUs;
      this.outlet.onEncoded({ codec: Codec.JPEG, key: true, about, data: new Uint8Array(data) });
    }
  }

  requestKey() {} // every JPEG is one

  close() {
    this.worker.terminate();
  }
}

/**
 * A frame's picture as a worker may own it: a video element can't be handed over.
 * @param {Frame} frame
 * @returns {Promise<VideoFrame | ImageBitmap>}
 */
async function handed({ image }) {
  return 'videoWidth' in image ? createImageBitmap(image) : image;
}

/**
 * @param {Frame} frame
 * @param {number} shrunk
 * @returns {About}
 */
function aboutOf({ width, height, captureUs, screenAngle }, shrunk) {
  return { ...shrunkSize(width, height, shrunk), captureUs, screenAngle, shrunk };
}
