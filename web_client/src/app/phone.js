/** The phone's two links and what travels on them: who we are, motion, touch, pictures, requests. */

/** @import {Calibrate, Command, Hello, ToPage, Welcome} from '../wire/protocol_types.js' */
/** @import {Motion, Received, Touch} from '../wire/protocol.js' */
/** @import {FastRecords, Ping, Surroundings} from './phone_types.js' */
/** @import {VideoSender} from '../video/video.js' */

import { nowUs } from '../wire/clock.js';
import { ServerTime, commandOf } from '../wire/command.js';
import { Link, socketUrl } from '../wire/link.js';
import { Kind, MAX_RECORD_BYTES, VERSION, encodeMotion, encodePong, encodeTouch } from '../wire/protocol.js';

const LOG_EVERY_MS = 200;
/** An older touch is not said again: whatever makes them may have stopped. */
const NEWEST_TOUCH_MS = 100;

export class Phone {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    this.session = '';
    this.loggedMs = -Infinity;
    this.sequences = { motion: 0, touch: 0, pong: 0, ping: 0 };
    /** The newest PING and when it came. @type {{ tUs: number, atMs: number }} */
    this.asked = { tUs: 0, atMs: -Infinity };
    /** Answers the newest of PINGs that came together. @type {(() => void) | null} */
    this.due = null;
    /** @type {{ touch: Touch | null, tMs: number }} */
    this.newest = { touch: null, tMs: -Infinity };
    this.serverTime = new ServerTime(surroundings.clock);
    /** @type {VideoSender | null} */
    this.video = null;
    /** @type {FastRecords | null} */
    this.fast = null;
    const { base, links } = surroundings;
    this.link = new Link(socketUrl('ws/phone', base), {
      onOpen: () => this.hello('operator'),
      onMessage: (message) => this.take(message),
      onRecord: (record) => this.record(record, (answer) => this.link.sendRecord(answer)),
      onClose: (wasWelcome) => this.closed(wasWelcome),
    }, links);
    this.videoLink = new Link(socketUrl('ws/video', base), {
      onOpen: () => this.videoOpened(),
      onMessage: (message) => this.take(message),
      onRecord: (record) => this.record(record, () => {}),
      onClose: () => {},
    }, links, { silenceMs: 0 });
  }

  open() {
    this.link.open();
  }

  close() {
    this.link.close();
    this.videoLink.close();
  }

  /** @param {'operator' | 'video'} role */
  hello(role) {
    const session = role === 'video' ? this.session : '';
    /** @type {Hello} */
    const hello = { type: 'hello', version: VERSION, role, session, ...this.surroundings.identity() };
    (role === 'video' ? this.videoLink : this.link).sendMessage(hello);
  }

  videoOpened() {
    this.hello('video');
    this.video?.restart();
  }

  /** @param {boolean} wasWelcome */
  closed(wasWelcome) {
    this.videoLink.close();
    this.serverTime.forget();
    this.surroundings.dispatch({ type: 'disconnected' });
    if (!wasWelcome) this.surroundings.onUnwelcome();
  }

  /** @param {ToPage} message */
  take(message) {
    const { dispatch, clock } = this.surroundings;
    const now = clock.now();
    switch (message.type) {
      case 'welcome':
        this.welcomed(message);
        break;
      case 'status':
        this.serverTime.heard(message.time_ms);
        dispatch({ type: 'status', status: message, now });
        break;
      case 'refused':
        dispatch({ type: 'refused', refused: message, now });
        break;
      case 'calibration':
        dispatch({ type: 'calibration', calibration: message });
        break;
      case 'path':
        this.surroundings.onPath(message);
        break;
      case 'sight':
        this.surroundings.onSight(message);
        break;
      case 'command':
        if (message.what === 'key_frame') this.video?.requestKey();
    }
  }

  /** @param {Welcome} welcome */
  welcomed(welcome) {
    if (welcome.session === this.session && this.videoLink.isOpen) return; // said again, on the video link
    this.session = welcome.session;
    this.sequences = { motion: 0, touch: 0, pong: 0, ping: 0 };
    this.newest = { touch: null, tMs: -Infinity };
    this.asked = { tUs: 0, atMs: -Infinity };
    this.due = null;
    this.videoLink.failures = 0;
    this.videoLink.open();
    this.surroundings.dispatch({ type: 'welcomed', you: welcome.you });
    this.surroundings.onWelcome(welcome);
  }

  /**
   * @param {Received} record
   * @param {(record: ArrayBuffer) => void} answer By the way that it came.
   */
  record(record, answer) {
    if (record.kind === Kind.PING) this.pinged(record, answer);
    else if (record.kind === Kind.CREDIT) this.video?.credit(record.taken);
  }

  /**
   * Each PING comes by all ways: the first one is answered at once. After a gap of the link many come together;
   * only the newest of those is worth an answer.
   * @param {Ping} ping
   * @param {(record: ArrayBuffer) => void} answer
   */
  pinged(ping, answer) {
    const { performance, dispatch, links } = this.surroundings;
    if (ping.sequence <= this.sequences.ping) return;
    this.sequences.ping = ping.sequence;
    const now = performance.now();
    const waited = ping.tUs - this.asked.tUs > 2000 * (now - this.asked.atMs); // behind others
    this.asked = { tUs: ping.tUs, atMs: now };
    dispatch({ type: 'ping', nonce: ping.nonce });
    const isWaiting = this.due !== null;
    this.due = waited ? () => this.answer(ping, answer) : null;
    if (!waited) this.answer(ping, answer);
    else if (!isWaiting) links.setTimeout(() => this.answerDue(), 0);
  }

  answerDue() {
    const { due } = this;
    this.due = null;
    due?.();
  }

  /**
   * With the touch too: waiting for the next tick would let the nonce grow old.
   * @param {Ping} ping
   * @param {(record: ArrayBuffer) => void} answer
   */
  answer(ping, answer) {
    const { performance } = this.surroundings;
    this.sequences.pong += 1;
    answer(encodePong(this.sequences.pong, nowUs(performance), ping));
    const { touch, tMs } = this.newest;
    if (touch !== null && performance.now() - tMs <= NEWEST_TOUCH_MS) {
      answer(this.touchRecord({ ...touch, nonce: ping.nonce }));
    }
  }

  /**
   * @param {number} tUs
   * @param {Motion} motion
   */
  sendMotion(tUs, motion) {
    if (this.session === '') return;
    this.sequences.motion += 1;
    const record = encodeMotion(this.sequences.motion, tUs, motion);
    if (this.fast?.isHeard) this.fast.send(record);
    else this.link.sendRecord(record);
  }

  /** @param {Touch} touch By all ways at once: whatever becomes of one, the server knows of the finger. */
  sendTouch(touch) {
    this.newest = { touch, tMs: this.surroundings.performance.now() };
    const record = this.touchRecord(touch);
    this.fast?.send(record);
    // Never dropped: a release must get through, and an old one says nothing that a newer one does not.
    this.link.sendRecord(record, Infinity);
  }

  /** @param {Touch} touch */
  touchRecord(touch) {
    this.sequences.touch += 1;
    return encodeTouch(this.sequences.touch, nowUs(this.surroundings.performance), touch);
  }

  /** @param {ArrayBuffer} record */
  sendFrame(record) {
    return this.videoLink.sendRecord(record, MAX_RECORD_BYTES);
  }

  /**
   * @param {Command['what']} what
   * @param {number} ageMs Since it was asked for.
   */
  command(what, ageMs) {
    return this.link.sendMessage(commandOf(what, ageMs, this.serverTime));
  }

  /** @param {Calibrate['what']} what */
  calibrate(what) {
    return this.link.sendMessage({ type: 'calibrate', what });
  }

  /** @param {string} text For the supervisor to read; a flood of them is cut. */
  log(text) {
    const now = this.surroundings.performance.now();
    if (now - this.loggedMs < LOG_EVERY_MS) return;
    this.loggedMs = now;
    this.link.sendMessage({ type: 'log', text: text.slice(0, 200) });
  }
}
