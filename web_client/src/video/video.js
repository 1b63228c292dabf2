/** Camera frames to FRAME records, never more under way than the server has credited. */

/** @import {Encoded, Encoder, Outlet, Stream} from './encoder.js' */
/** @import {Frame} from '../camera/frame_types.js' */
/** @import {Level} from './rate_adaptation.js' */

import { EncoderLoad } from './encoder_load.js';
import { Rate } from '../wire/clock.js';
import { Throttle } from './throttle.js';
import { Credits } from './flow_control.js';
import { H264Encoder, JpegEncoder, supportedH264 } from './encoder.js';
import { encodeFrame } from '../wire/protocol.js';

/** A new encoder that gives nothing for so long collects pictures before it begins, as Firefox's H.264 does. */
export const HELD_MS = 1500;

/**
 * @typedef {object} Surroundings
 * @property {{ now(): number }} performance
 * @property {(record: ArrayBuffer) => boolean} send Whether the record went out.
 * @property {(text: string) => void} log
 * @property {typeof VideoEncoder | undefined} VideoEncoder
 * @property {(() => Worker) | undefined} startJpegWorker
 */

export class VideoSender {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    this.sequence = 0;
    this.credits = new Credits();
    this.frames = new Rate();
    this.bytes = new Rate();
    /** @type {Encoder | null} */
    this.encoder = null;
    this.load = new EncoderLoad();
    this.throttle = new Throttle();
    this.shrunk = 0;
    /** H.264 of this browser is of no use. */
    this.needsJpeg = false;
    /** What the last pictures took from the camera out of the encoder. @type {number[]} */
    this.encodedMs = [];
  }

  /** What a picture takes from the camera out of the encoder: median [ms], or null. */
  get encodeMs() {
    const sorted = [...this.encodedMs].sort((a, b) => a - b);
    return sorted[sorted.length >> 1] ?? null;
  }

  /**
   * Chooses the encoder for a stream; resolves with its name.
   * @param {Stream} stream
   * @param {boolean} [wantsJpeg] Whatever else this browser can.
   * @returns {Promise<string>}
   */
  async prepare(stream, wantsJpeg = false) {
    const { VideoEncoder: Encoders } = this.surroundings;
    const config = wantsJpeg || this.needsJpeg ? null : await supportedH264(Encoders, stream);
    this.encodedMs = [];
    this.replace(config !== null && Encoders !== undefined
      ? new H264Encoder(Encoders, config, this.outlet())
      : this.jpegEncoder());
    return this.encoder?.name ?? 'none';
  }

  /** @param {Encoder | null} encoder Takes the place of the one before. */
  replace(encoder) {
    this.encoder?.close();
    this.credits.encoding = 0;
    this.load.reset();
    this.encoder = encoder;
    if (encoder !== null) encoder.shrunk = this.shrunk;
  }

  /** @param {Level} level So many pictures of such a size, no more. */
  ease({ hz, shrunk }) {
    this.throttle.limit(hz);
    this.shrunk = shrunk;
    if (this.encoder !== null) this.encoder.shrunk = shrunk;
  }

  jpegEncoder() {
    const { startJpegWorker } = this.surroundings;
    return startJpegWorker === undefined ? null : new JpegEncoder(startJpegWorker, this.outlet());
  }

  /** A new connection: nothing is under way on it, and its first picture must be a key. */
  restart() {
    const { encoding } = this.credits;
    this.credits = new Credits();
    this.credits.encoding = encoding;
    this.sequence = 0;
    this.encoder?.requestKey();
  }

  requestKey() {
    this.encoder?.requestKey();
  }

  /**
   * Takes a frame over: encodes it or drops it. Frames are dropped before the encoder, never after: those
   * that follow would lean on them.
   * @param {Frame} frame
   */
  offer(frame) {
    const { encoder } = this;
    const now = this.surroundings.performance.now();
    if (encoder === null || !this.throttle.passes(frame.captureUs)) {
      frame.close();
      return;
    }
    if (this.load.heldMs(now) > HELD_MS) {
      if (encoder.name !== 'JPEG' && !this.load.hasGiven) {
        frame.close();
        this.needsJpeg = true;
        this.failed(new Error('holds pictures back'));
        return;
      }
      this.lost();
    }
    this.load.meant(encoder.waiting);
    if (!this.credits.mayTake(now)) {
      frame.close();
      return;
    }
    this.credits.taken();
    this.load.entered(now);
    encoder.encode(frame);
  }

  /** A picture that was taken will not come out. */
  lost() {
    this.load.lost();
    this.credits.lost();
  }

  /**
   * @param {number} sequence The server has taken this FRAME.
   */
  credit(sequence) {
    this.credits.credit(sequence, this.surroundings.performance.now());
  }

  /** @returns {Outlet} */
  outlet() {
    return {
      onEncoded: (encoded) => {
        this.load.left(this.surroundings.performance.now());
        this.send(encoded);
      },
      onLost: () => this.lost(),
      onFailure: (error) => this.failed(error),
    };
  }

  /** @param {Encoded} encoded */
  send({ about, ...picture }) {
    const now = this.surroundings.performance.now();
    const sequence = (this.sequence + 1) >>> 0;
    const { width, height, screenAngle, shrunk } = about;
    this.encodedMs = [...this.encodedMs.slice(-29), now - about.captureUs / 1000];
    const record = encodeFrame(
      sequence, about.captureUs, { ...picture, width, height, screen_angle_deg: screenAngle, shrunk },
    );
    if (!this.surroundings.send(record)) {
      this.credits.lost();
      this.encoder?.requestKey();
      return;
    }
    this.sequence = sequence;
    this.credits.wasSent(sequence, now);
    this.frames.add(now);
    this.bytes.add(now, record.byteLength);
  }

  /**
   * The encoder has failed: JPEG always works.
   * @param {unknown} error
   */
  failed(error) {
    this.surroundings.log(`${this.encoder?.name} encoder: ${error}`);
    this.replace(this.encoder instanceof JpegEncoder ? null : this.jpegEncoder());
  }
}
