/** The camera's track in a WebRTC connection: each encoded picture with its record, what the encoder may spend. */

/** @import {Frame} from '../camera/frame_types.js' */
/** @import {Level} from './rate_adaptation.js' */
/** @import {Quaternion} from '../wire/protocol.js' */
/** @import {FromWorker, ToWorker} from './rtc_worker.js' */
/** @import {Welcome} from '../wire/protocol_types.js' */

import { QUARTERS } from './rate_adaptation.js';
import { Rate } from '../wire/clock.js';
import { RtcLoad, countsOf, roundTripOf } from './rtc_load.js';

/** @typedef {{ rtpTimestamp: number, captureUs: number }} Pair */

/**
 * What it needs of the browser. Without a transform and without a sender's streams pictures go without records.
 * @typedef {object} Surroundings
 * @property {{ now(): number, timeOrigin: number }} performance
 * @property {(new (worker: Worker, options: object) => any) | undefined} ScriptTransform
 * @property {boolean} hasStreams The sender gives its encoded pictures, as Chrome 86 to 140 do.
 * @property {(() => Worker) | undefined} startWorker
 * @property {(pair: Pair) => void} onPair A picture could not be appended to.
 */

export class RtcPictures {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    /** @type {RTCRtpSender | null} */
    this.sender = null;
    /** @type {Worker | null} */
    this.worker = null;
    this.isFlowing = false;
    /** What is asked of the encoder; null: all that is wanted. @type {Level | null} */
    this.level = null;
    /** @type {Welcome | null} */
    this.welcome = null;
    this.loads = new RtcLoad();
    /** @type {number | null} */
    this.roundTripMs = null;
    this.captures = new Rate();
    this.frames = new Rate();
    this.bytes = new Rate();
  }

  /** Whether each picture can say when it was taken. */
  get haveRecords() {
    const { ScriptTransform, hasStreams, startWorker } = this.surroundings;
    return startWorker !== undefined && (ScriptTransform !== undefined || hasStreams);
  }

  /** What a connection must be made with. */
  get configuration() {
    const { ScriptTransform, hasStreams } = this.surroundings;
    return ScriptTransform === undefined && hasStreams ? { encodedInsertableStreams: true } : {};
  }

  /**
   * Takes the place that the offer has for pictures.
   * @param {RTCPeerConnection} connection
   * @param {MediaStreamTrack} track
   */
  async attach(connection, track) {
    const [transceiver] = connection.getTransceivers();
    if (transceiver === undefined) throw new Error('the offer has no place for pictures');
    transceiver.direction = 'sendonly';
    this.sender = transceiver.sender;
    if (this.haveRecords) this.record(this.sender);
    await this.sender.replaceTrack(track);
  }

  /** @param {any} sender Its encoded pictures go through the worker. */
  record(sender) {
    const { ScriptTransform, startWorker, performance } = this.surroundings;
    const worker = startWorker?.();
    if (worker === undefined) return;
    this.worker = worker;
    worker.onmessage = ({ data }) => this.sent(data);
    this.tell({ type: 'origin', timeOrigin: performance.timeOrigin });
    if (ScriptTransform !== undefined) {
      sender.transform = new ScriptTransform(worker, {});
      return;
    }
    const { readable, writable } = sender.createEncodedStreams();
    worker.postMessage({ type: 'streams', readable, writable }, [readable, writable]);
  }

  /**
   * The picture keeps its size: another size is another camera to the server.
   * @param {Welcome} welcome
   */
  async limit(welcome) {
    this.welcome = welcome;
    const { bitrate_bps, frame_rate_hz } = welcome;
    const { hz, shrunk } = this.level ?? { hz: frame_rate_hz, shrunk: 0 };
    const parameters = this.sender?.getParameters();
    if (this.sender === null || parameters === undefined) return;
    parameters.degradationPreference = 'maintain-resolution';
    for (const encoding of parameters.encodings) {
      encoding.maxBitrate = bitrate_bps;
      encoding.maxFramerate = hz;
      encoding.scaleResolutionDownBy = this.haveRecords ? QUARTERS / (QUARTERS - shrunk) : 1; // else nobody would tell
    }
    await this.sender.setParameters(parameters).catch(() => {}); // a wish; the server checks every picture
    this.holdSize(this.sender);
  }

  /**
   * Where a sender does not know what to give up last, the track says that it is the size.
   * @param {RTCRtpSender | null} sender
   */
  holdSize(sender) {
    const track = sender?.track;
    if (!track || sender.getParameters().degradationPreference === 'maintain-resolution') return;
    if ('contentHint' in track) track.contentHint = 'detail';
  }

  /** @param {Level} level So many pictures of such a size, no more. */
  async ease(level) {
    this.level = level;
    if (this.welcome !== null) await this.limit(this.welcome);
  }

  /** How the encoder has done since the last call. */
  async load() {
    const reports = [...((await this.sender?.getStats().catch(() => null))?.values() ?? [])];
    this.roundTripMs = roundTripOf(reports);
    const now = this.surroundings.performance.now();
    const inHz = Math.min(this.level?.hz ?? Infinity, this.captures.perSecond(now));
    return this.loads.since(countsOf(reports), inHz, now);
  }

  close() {
    this.worker?.terminate();
    this.sender = this.worker = null;
    this.isFlowing = false;
  }

  /**
   * The camera has given a frame: the track sends it, the record says when it was taken.
   * @param {Frame} frame
   */
  captured({ image, captureUs, lateUs, screenAngle, width, height }) {
    const stampUs = 'timestamp' in image ? image.timestamp : captureUs;
    this.captures.add(this.surroundings.performance.now());
    this.tell({ type: 'capture', capture: { captureUs, stampUs, lateUs, screenAngle }, size: { width, height } });
    if (this.worker !== null) return;
    this.isFlowing = this.sender !== null; // nobody tells of its pictures
    this.frames.add(this.surroundings.performance.now());
  }

  /** @param {Quaternion | null} orientation */
  turned(orientation) {
    this.tell({ type: 'attitude', orientation });
  }

  /** @param {MediaStreamTrack} track The camera was opened anew: by its clock nothing is known yet. */
  async replaceTrack(track) {
    this.isFlowing = false;
    this.tell({ type: 'origin', timeOrigin: this.surroundings.performance.timeOrigin });
    await this.sender?.replaceTrack(track);
    this.holdSize(this.sender);
  }

  /** @param {ToWorker} message */
  tell(message) {
    this.worker?.postMessage(message);
  }

  /** @param {FromWorker} told A picture has left the encoder. */
  sent({ bytes, pair }) {
    const now = this.surroundings.performance.now();
    this.isFlowing = true;
    this.frames.add(now);
    this.bytes.add(now, bytes);
    if (pair !== null) this.surroundings.onPair(pair);
  }
}
