/** WebRTC to the server: it offers, the page answers; pictures as a track, records on a data channel. */

/** @import {Fetch} from '../wire/pairing.js' */
/** @import {Received} from '../wire/protocol.js' */
/** @import {Pair, Surroundings as PictureSurroundings} from './rtc_frames.js' */
/** @import {Welcome} from '../wire/protocol_types.js' */

import { OWN_HEADERS, refusalOf } from '../wire/pairing.js';
import { RtcPictures } from './rtc_frames.js';
import { decodeRecord, encodeStamp } from '../wire/protocol.js';

/** A data channel that was silent for longer, which is twelve PINGs, is not relied upon. */
export const HEARD_MS = 200;
/** With more waiting in the data channel a record is dropped [bytes]. */
export const BACKLOG_BYTES = 2048;
const GATHER_MS = 1000;
const CONNECT_MS = 8000;
const ENDS = ['failed', 'closed', 'disconnected'];

/** The server does not want WebRTC at all. */
export class RtcRefused extends Error {}

/**
 * What the page needs of the browser.
 * @typedef {object} OwnSurroundings
 * @property {Fetch} fetch
 * @property {(callback: () => void, ms: number) => any} setTimeout
 * @property {typeof RTCPeerConnection | undefined} PeerConnection
 * @property {(record: Received) => void} onRecord
 * @property {() => void} onLost
 */

/** @typedef {OwnSurroundings & Omit<PictureSurroundings, 'onPair'>} Surroundings */

export class RtcPath {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    /** @type {RTCPeerConnection | null} */
    this.connection = null;
    /** @type {RTCDataChannel | null} */
    this.channel = null;
    this.pictures = new RtcPictures({ ...surroundings, onPair: (pair) => this.stamp(pair) });
    /** Of this connection. */
    this.heardMs = -Infinity;
    this.wasOpen = false;
    this.stamps = 0;
  }

  /** Whether this browser has WebRTC. */
  get isAble() {
    return this.surroundings.PeerConnection !== undefined;
  }

  /** Whether all is connected. */
  get isOpen() {
    return this.channel?.readyState === 'open' && this.connection?.connectionState === 'connected';
  }

  /** Whether pictures go this way. */
  get isFlowing() {
    return this.isOpen && this.pictures.isFlowing;
  }

  /** Whether the server was heard here lately. */
  get isHeard() {
    return this.isOpen && this.surroundings.performance.now() - this.heardMs < HEARD_MS;
  }

  /**
   * Connects; resolves when pictures and records can go.
   * @param {string} session
   * @param {MediaStreamTrack} track
   * @param {Welcome} welcome
   */
  async open(session, track, welcome) {
    this.close();
    const offer = await this.post('api/rtc', { session });
    const { PeerConnection } = this.surroundings;
    if (PeerConnection === undefined) return;
    const connection = new PeerConnection({ iceServers: offer.ice_servers, ...this.pictures.configuration });
    this.connection = connection;
    const opened = this.expectChannel(connection);
    opened.catch(() => {}); // awaited below
    await connection.setRemoteDescription({ type: 'offer', sdp: offer.sdp });
    await this.pictures.attach(connection, track);
    await connection.setLocalDescription(await connection.createAnswer());
    await this.gathered(connection);
    await this.post('api/rtc/answer', { id: offer.id, sdp: connection.localDescription?.sdp });
    await this.pictures.limit(welcome);
    await opened;
  }

  /** Hangs up. */
  close() {
    const { connection } = this;
    this.connection = this.channel = null;
    this.heardMs = -Infinity;
    this.wasOpen = false;
    connection?.close();
    this.pictures.close();
  }

  /**
   * Sends a record or drops it.
   * @param {ArrayBuffer} record
   */
  send(record) {
    if (this.channel?.readyState !== 'open' || this.channel.bufferedAmount > BACKLOG_BYTES) return;
    this.channel.send(record);
  }

  /** @param {Pair} pair */
  stamp({ captureUs, rtpTimestamp }) {
    this.stamps += 1;
    this.send(encodeStamp(this.stamps, captureUs, rtpTimestamp));
  }

  /**
   * Resolves when the data channel is open.
   * @param {RTCPeerConnection} connection
   * @returns {Promise<void>}
   */
  expectChannel(connection) {
    return new Promise((resolve, reject) => {
      /** @param {string} why */
      const end = (why) => {
        reject(new Error(why));
        this.ended(connection);
      };
      this.surroundings.setTimeout(() => reject(new Error('no connection within the time allowed')), CONNECT_MS);
      connection.ondatachannel = ({ channel }) => {
        this.channel = channel;
        channel.binaryType = 'arraybuffer';
        channel.onmessage = ({ data }) => this.take(data);
        channel.onclose = () => end('the server has hung up');
        channel.onopen = () => {
          this.wasOpen = true;
          resolve();
        };
      };
      connection.onconnectionstatechange = () => {
        if (ENDS.includes(connection.connectionState)) end(`the connection has ${connection.connectionState}`);
      };
    });
  }

  /** @param {RTCPeerConnection} connection One of ours, or an earlier one of which nothing is wanted. */
  ended(connection) {
    const { wasOpen } = this;
    if (connection !== this.connection) return;
    this.close();
    if (wasOpen) this.surroundings.onLost();
  }

  /** @param {unknown} data */
  take(data) {
    this.heardMs = this.surroundings.performance.now();
    if (data instanceof ArrayBuffer) this.surroundings.onRecord(decodeRecord(data));
  }

  /**
   * Resolves when our addresses are known, or enough of them.
   * @param {RTCPeerConnection} connection
   * @returns {Promise<void>}
   */
  gathered(connection) {
    return new Promise((resolve) => {
      const look = () => {
        if (connection.iceGatheringState === 'complete') resolve();
      };
      connection.onicegatheringstatechange = look;
      this.surroundings.setTimeout(resolve, GATHER_MS);
      look();
    });
  }

  /**
   * @param {string} path
   * @param {object} body
   */
  async post(path, body) {
    const response = await this.surroundings.fetch(path, {
      method: 'POST',
      credentials: 'same-origin',
      headers: { ...OWN_HEADERS, 'Content-Type': 'application/json' },
      body: JSON.stringify(body),
    });
    if (response.status === 404 && path === 'api/rtc') throw new RtcRefused(await refusalOf(response));
    if (!response.ok) throw new Error(await refusalOf(response));
    return response.json();
  }
}
