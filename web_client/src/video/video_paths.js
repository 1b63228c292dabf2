/** The ways of a picture to the server, best first: WebRTC, H.264 by websocket, JPEG by websocket. */

/** @import {Frame} from '../camera/frame_types.js' */
/** @import {Level} from './rate_adaptation.js' */
/** @import {PathChoice, Welcome} from '../wire/protocol_types.js' */
/** @import {RtcPath} from './rtc.js' */
/** @import {VideoSender} from './video.js' */

import { Complaints } from './transport_health.js';
import { RtcRefused } from './rtc.js';
import { Retry } from './retry.js';

/** @typedef {'WebRTC' | 'WebSocket' | 'JPEG' | '–'} PathName */
/** What a person wants. @typedef {PathChoice['wish']} RequestedPath */

/**
 * @typedef {object} Surroundings
 * @property {{ now(): number }} performance
 * @property {(callback: () => void, ms: number) => any} setTimeout
 * @property {(id: any) => void} clearTimeout
 * @property {RtcPath} rtc
 * @property {VideoSender} video
 * @property {() => boolean} socketIsOpen
 * @property {() => { session: string, track: MediaStreamTrack | null }} place
 * @property {(text: string) => void} say To the supervisor.
 * @property {(choice: PathChoice) => void} tell To the server.
 */

export class VideoPaths {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    /** @type {Welcome | null} */
    this.welcome = null;
    /** @type {RequestedPath} */
    this.requested = 'auto';
    /** Whose request. @type {PathChoice['by']} */
    this.by = '';
    this.isConnecting = false;
    this.fastTries = new Retry(surroundings);
    this.encoderTries = new Retry(surroundings);
    this.complaints = new Complaints();
  }

  /** The way pictures go now. @returns {PathName} */
  get name() {
    const { rtc, video, socketIsOpen } = this.surroundings;
    if (rtc.isFlowing) return 'WebRTC';
    if (!socketIsOpen() || video.encoder === null) return '–';
    return video.encoder.name === 'JPEG' ? 'JPEG' : 'WebSocket';
  }

  get wantsSocket() {
    return this.requested === 'WebSocket' || this.requested === 'JPEG';
  }

  /**
   * The server has welcomed us, and the camera is settled: begin with the websocket, look for better.
   * @param {Welcome} welcome
   */
  begin(welcome) {
    this.end();
    this.welcome = welcome;
    this.tell();
    this.seek();
  }

  tell() {
    this.surroundings.tell({ type: 'path', wish: this.requested, by: this.by });
  }

  /** The server has gone. */
  end() {
    this.welcome = null;
    this.fastTries.reset();
    this.encoderTries.reset();
    this.surroundings.rtc.close();
  }

  /**
   * The last one to choose is obeyed.
   * @param {RequestedPath} requested
   * @param {PathChoice['by']} by
   */
  choose(requested, by) {
    const { rtc, video } = this.surroundings;
    const { welcome } = this;
    Object.assign(this, { requested, by });
    if (welcome === null) return;
    this.tell();
    this.fastTries.reset();
    this.encoderTries.reset();
    if (this.wantsSocket) rtc.close();
    if ((requested === 'JPEG') !== (video.encoder?.name === 'JPEG')) void video.prepare(welcome, requested === 'JPEG');
    else video.requestKey();
    this.seek();
  }

  /** Connects, if the fast path is wanted and not there. */
  seek() {
    const { rtc, say } = this.surroundings;
    if (this.wantsSocket || rtc.isOpen) return;
    if (rtc.isAble && (this.requested === 'WebRTC' || rtc.pictures.haveRecords)) void this.connect();
    else say('no WebRTC with records in this browser: pictures go by websocket');
  }

  /**
   * Takes a frame over.
   * @param {Frame} frame
   */
  offer(frame) {
    const { rtc, video, socketIsOpen } = this.surroundings;
    if (rtc.isOpen || this.isConnecting) rtc.pictures.captured(frame);
    if (!rtc.isFlowing && socketIsOpen()) video.offer(frame);
    else frame.close();
  }

  /** @param {MediaStreamTrack} track The camera was opened anew: pictures go by websocket until its clock is known. */
  async filmAnew(track) {
    const { rtc, video } = this.surroundings;
    video.requestKey();
    this.fastTries.succeeded(); // as much time as a new one has until its first picture
    await rtc.pictures.replaceTrack(track);
  }

  /**
   * What the screen shows of it.
   * @param {number} now [ms]
   */
  health(now) {
    const { rtc, video } = this.surroundings;
    const { frames, bytes } = rtc.isFlowing ? rtc.pictures : video;
    return {
      path: this.name,
      fps: frames.perSecond(now),
      rttMs: rtc.isFlowing ? rtc.pictures.roundTripMs : video.credits.roundTripMs,
      kbps: bytes.perSecond(now) * 0.008,
    };
  }

  /** @param {Level} level So many pictures of such a size, by whichever way. */
  ease(level) {
    this.surroundings.video.ease(level);
    void this.surroundings.rtc.pictures.ease(level);
  }

  /** How the encoder of the present way has done since the last call. */
  async load() {
    const { rtc, video, performance } = this.surroundings;
    return rtc.isFlowing ? rtc.pictures.load() : video.load.since(performance.now());
  }

  /**
   * To be called now and then: leaves a way that is no good.
   * @param {number | null} ageMs Of the pictures, as the server says.
   */
  look(ageMs) {
    const { rtc, video, performance } = this.surroundings;
    const now = performance.now();
    if (rtc.isOpen) {
      const why = this.complaints.ofFast(now, rtc, this.fastTries.goodSinceMs, ageMs);
      if (why === '') return;
      rtc.close();
      this.lost(why);
    } else if (this.requested === 'auto' && this.complaints.ofEncoder(now, video.encodeMs) && this.name === 'WebSocket') {
      this.complaints.slow.reset();
      void this.encodeLess();
    }
  }

  async connect() {
    const { rtc, place, say } = this.surroundings;
    const { session, track } = place();
    const { welcome } = this;
    if (welcome === null || this.wantsSocket || this.isConnecting || track === null) return;
    this.isConnecting = true;
    try {
      await rtc.open(session, track, welcome);
      if (this.wantsSocket) return rtc.close(); // chosen meanwhile
      this.complaints.old.reset();
      this.fastTries.succeeded();
      say('pictures go by WebRTC');
    } catch (error) {
      rtc.close();
      const why = error instanceof Error ? error.message : String(error);
      if (error instanceof RtcRefused) say(`no WebRTC: ${why}`);
      else if (welcome === this.welcome) this.lost(why);
    } finally {
      this.isConnecting = false;
      if (welcome !== this.welcome) void this.connect(); // welcomed anew meanwhile
    }
  }

  /** @param {string} why The fast path has ended: the websocket takes over, with a key; later, another try. */
  lost(why) {
    const { video, say } = this.surroundings;
    if (this.welcome === null || this.wantsSocket) return;
    video.requestKey();
    say(`WebRTC: ${why}; pictures go by websocket`);
    this.fastTries.failed(() => void this.connect());
  }

  /** The encoder is too slow: JPEG for a while. */
  async encodeLess() {
    const { video, say } = this.surroundings;
    const { welcome } = this;
    if (welcome === null) return;
    say(`${video.encoder?.name} takes ${Math.round(video.encodeMs ?? 0)} ms a picture: JPEG`);
    await video.prepare(welcome, true);
    this.encoderTries.failed(() => {
      this.encoderTries.succeeded();
      if (welcome === this.welcome && this.requested === 'auto') void video.prepare(welcome);
    });
  }
}
