/** Stand-ins for what a browser gives: a clock with timers, a websocket, a server. */

/** @import {Estimate, Status} from '../src/wire/protocol_types.js' */

/** A clock that moves only when told, and its timers. */
export class FakeTime {
  ms = 0;
  next = 1;
  /** @type {Map<number, { at: number, callback: () => void }>} */
  timers = new Map();

  now = () => this.ms;

  /** @type {(callback: () => void, ms: number) => number} */
  setTimeout = (callback, ms) => {
    this.timers.set(this.next, { at: this.ms + ms, callback });
    return this.next++;
  };

  /** @type {(id: number) => void} */
  clearTimeout = (id) => void this.timers.delete(id);

  /** @param {number} ms */
  advance(ms) {
    const end = this.ms + ms;
    for (;;) {
      const due = [...this.timers].filter(([, timer]) => timer.at <= end).sort(([, a], [, b]) => a.at - b.at)[0];
      if (due === undefined) break;
      const [id, timer] = due;
      this.timers.delete(id);
      this.ms = timer.at;
      timer.callback();
    }
    this.ms = end;
  }
}

/** A websocket whose other end is the test. */
export class FakeSocket {
  /** Those made so far, oldest first. @type {FakeSocket[]} */
  static made = [];

  readyState = 0;
  bufferedAmount = 0;
  binaryType = 'blob';
  /** @type {(string | ArrayBuffer)[]} */
  sent = [];
  onopen = () => {};
  onclose = () => {};
  /** @type {(event: { data: string | ArrayBuffer }) => void} */
  onmessage = () => {};

  /** @param {string} url */
  constructor(url) {
    this.url = url;
    FakeSocket.made.push(this);
  }

  /** @param {string | ArrayBuffer} data */
  send(data) {
    this.sent.push(data);
  }

  close() {
    this.readyState = 3;
  }

  /** The handshake is done. */
  opens() {
    this.readyState = 1;
    this.onopen();
  }

  /** @param {object | ArrayBuffer} data */
  says(data) {
    this.onmessage({ data: data instanceof ArrayBuffer ? data : JSON.stringify(data) });
  }

  /** The other end hangs up. */
  drops() {
    this.readyState = 3;
    this.onclose();
  }

  static get newest() {
    const socket = FakeSocket.made.at(-1);
    if (socket === undefined) throw new Error('no socket was made');
    return socket;
  }
}

/** @returns {typeof WebSocket} */
export function fakeWebSocket() {
  FakeSocket.made = [];
  return /** @type {any} */ (FakeSocket);
}

/**
 * @param {Partial<Status>} parts
 * @returns {Status}
 */
export function statusOf(parts = {}) {
  return {
    type: 'status', mode: 'DISARMED', reason: '', ready: false, refusals: [], robot: 'ames', operator: '', video_path: '',
    streams: {}, latency_ms: {}, leds: 0, reprojection_px: null, position_mm: null, error_mm: null,
    error_deg: null, sigma_mm: null, saturated: false, virtual_camera: null, estimate: null, camera: null,
    path_choice: null, time_ms: 0, until_ramp_ms: null, resumes: false, gaps: {}, warnings: [], sensors_doubted: [], thrusters_weak: [], at_limit: false,
    recording: '', phones: 0, supervisors: 0, realtime: '',
    control: {}, server: {}, events: [], people: [], leading: null, tool: null, takes: 'thrusts', thrusts_n: [], thrust_limit_n: 3, told_mm_s: null, told_deg_s: null,
    battery: 'untold', battery_v: null, e_stop: 'untold', health: [], task: '', episode: null, ...parts,
  };
}

/**
 * @param {Partial<Estimate>} parts
 * @returns {Estimate}
 */
export function estimateOf(parts = {}) {
  return {
    name: 'relative', complaint: '', nis: 1, age_ms: 90, fused: 100, dropped: 2, late: 1, leds_rejected: 0,
    time_offset_ms: 0, time_offset_sigma_ms: 0.3, sigma_deg: 0.2, bias_body_deg_s: [0, 0, 0], bias_body_m_s2: [0, 0, 0],
    bias_phone_deg_s: [0, 0, 0], bias_phone_m_s2: [0, 0, 0], ...parts,
  };
}

/** A PING as the server writes it. @param {bigint} nonce @param {number} tUs @param {number} sequence */
export function pingOf(nonce, tUs, sequence = 1) {
  const view = new DataView(new ArrayBuffer(24));
  [0x4c, 2, 129, 0].forEach((byte, i) => view.setUint8(i, byte));
  view.setUint32(4, sequence, true);
  view.setBigInt64(8, BigInt(tUs), true);
  view.setBigUint64(16, nonce, true);
  return view.buffer;
}
