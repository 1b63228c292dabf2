/**
 * A websocket that comes back by itself and never queues: what can't leave at once is dropped by its sender.
 */

/** @import {FromPage, ToPage} from './protocol_types.js' */
/** @import {Received} from './protocol.js' */

import { decodeMessage, decodeRecord } from './protocol.js';

export const BACK_OFF_MS = Object.freeze([250, 500, 1000, 2000, 4000]);
export const SILENCE_MS = 2000;
/** A record that may be dropped is, when this much waits in the socket [bytes]. */
export const BACKLOG_BYTES = 4096;

/**
 * What the page needs of the browser.
 * @typedef {object} Surroundings
 * @property {new (url: string) => WebSocket} WebSocket
 * @property {(callback: () => void, ms: number) => any} setTimeout
 * @property {(id: any) => void} clearTimeout
 */

/**
 * @typedef {object} Handlers
 * @property {() => void} onOpen Time to say hello.
 * @property {(message: ToPage) => void} onMessage
 * @property {(record: Received) => void} onRecord
 * @property {(wasWelcome: boolean) => void} onClose A connection ended; another follows by itself.
 */

export class Link {
  /**
   * @param {string} url
   * @param {Handlers} handlers
   * @param {Surroundings} surroundings
   * @param {{ silenceMs?: number }} [options] After how long a silent server counts as lost; 0: never.
   */
  constructor(url, handlers, surroundings, { silenceMs = SILENCE_MS } = {}) {
    this.url = url;
    this.handlers = handlers;
    this.surroundings = surroundings;
    this.silenceMs = silenceMs;
    this.failures = 0;
    this.welcome = false;
    /** @type {WebSocket | null} */
    this.socket = null;
    /** @type {any} */
    this.timer = null;
  }

  /** True while records can be sent. */
  get isOpen() {
    return this.socket !== null && this.socket.readyState === 1;
  }

  open() {
    this.close();
    this.welcome = false;
    const socket = new this.surroundings.WebSocket(this.url);
    this.socket = socket;
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.expectWord(socket);
      this.handlers.onOpen();
    };
    socket.onmessage = (event) => {
      this.expectWord(socket);
      this.take(event.data);
    };
    socket.onclose = () => this.lost(socket);
    this.startTimer(() => this.lost(socket), 4000);
  }

  /** Ends the connection for good, until `open`. */
  close() {
    this.stopTimer();
    const socket = this.socket;
    this.socket = null;
    socket?.close();
  }

  /**
   * @param {FromPage} message
   * @returns {boolean} Whether it went out.
   */
  sendMessage(message) {
    if (!this.isOpen) return false;
    this.socket?.send(JSON.stringify(message));
    return true;
  }

  /**
   * @param {ArrayBuffer} record
   * @param {number} backlogBytes With more than this waiting the record is dropped.
   * @returns {boolean} Whether it went out.
   */
  sendRecord(record, backlogBytes = BACKLOG_BYTES) {
    if (!this.isOpen || this.socket === null) return false;
    if (this.socket.bufferedAmount > backlogBytes) return false;
    this.socket.send(record);
    return true;
  }

  /** @param {unknown} data */
  take(data) {
    if (data instanceof ArrayBuffer) {
      const record = this.read(() => decodeRecord(data));
      if (record !== null) this.handlers.onRecord(record);
      return;
    }
    const message = this.read(() => decodeMessage(String(data)));
    if (message === null) return;
    if (message.type === 'welcome') {
      this.welcome = true;
      this.failures = 0;
    }
    this.handlers.onMessage(message);
  }

  /**
   * What can't be read comes from a server of another version.
   * @template T
   * @param {() => T} decode
   * @returns {T | null}
   */
  read(decode) {
    try {
      return decode();
    } catch (error) {
      const allowed = error instanceof Error ? error.message : String(error);
      this.handlers.onMessage({ type: 'refused', code: 'version', field: 'page', allowed, fatal: true });
      return null;
    }
  }

  /** @param {WebSocket} socket */
  expectWord(socket) {
    this.stopTimer();
    if (this.silenceMs > 0) this.startTimer(() => this.lost(socket), this.silenceMs);
  }

  /** @param {WebSocket} socket */
  lost(socket) {
    if (socket !== this.socket) return;
    const wasWelcome = this.welcome;
    this.close();
    const wait = BACK_OFF_MS[Math.min(this.failures, BACK_OFF_MS.length - 1)] ?? 0;
    this.failures += 1;
    this.startTimer(() => this.open(), wait);
    this.handlers.onClose(wasWelcome);
  }

  /**
   * @param {() => void} callback
   * @param {number} ms
   */
  startTimer(callback, ms) {
    this.stopTimer();
    this.timer = this.surroundings.setTimeout(callback, ms);
  }

  stopTimer() {
    this.surroundings.clearTimeout(this.timer);
    this.timer = null;
  }
}

/**
 * The websocket address of a path beside the page.
 * @param {string} path
 * @param {string} base Address of the page.
 */
export function socketUrl(path, base) {
  const url = new URL(path, base);
  url.protocol = url.protocol === 'http:' ? 'ws:' : 'wss:';
  url.hash = '';
  return url.href;
}
