import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Credits, MAX_UNDER_WAY } from '../../src/video/flow_control.js';
import { H264Encoder, JpegEncoder, h264Candidates, supportedH264 } from '../../src/video/encoder.js';
import { MAX_RECORD_BYTES } from '../../src/wire/protocol.js';
import { HELD_MS, VideoSender } from '../../src/video/video.js';
import { FakeTime } from '../fakes.js';

/** @import {Frame} from '../../src/camera/frame_types.js' */

/** An encoder that keeps what it is given until the test lets it out. */
class FakeEncoder {
  static supported = true;
  /** @type {FakeEncoder} */
  static newest;
  state = 'unconfigured';
  /** @type {{ timestamp: number, key: boolean }[]} */
  inside = [];
  /** @type {VideoEncoderConfig[]} */
  configs = [];

  /** @param {{ output: (chunk: any) => void, error: (error: Error) => void }} init */
  constructor(init) {
    this.init = init;
    FakeEncoder.newest = this;
  }

  /** @param {VideoEncoderConfig} config */
  static async isConfigSupported(config) {
    return { supported: FakeEncoder.supported, config };
  }

  /** @param {VideoEncoderConfig} config */
  configure(config) {
    this.state = 'configured';
    this.configs.push(config);
  }

  /** @param {{ timestamp: number }} image @param {{ keyFrame: boolean }} options */
  encode(image, { keyFrame }) {
    this.inside.push({ timestamp: image.timestamp, key: keyFrame });
  }

  out(byteLength = 100) {
    const frame = this.inside.shift();
    this.init.output({
      timestamp: frame?.timestamp, type: frame?.key ? 'key' : 'delta', byteLength, copyTo: () => {},
    });
    return frame;
  }

  close() {
    this.state = 'closed';
  }
}

/** The worker that compresses, as far as a page sees it: it answers by and by. */
class FakeJpegWorker {
  /** @type {((event: { data: any }) => void) | null} */
  onmessage = null;
  ended = false;

  /** @param {{ id: number, width: number }} wish @param {unknown[]} handed */
  postMessage({ id }, handed) {
    assert.equal(handed.length, 1);
    setImmediate(() => this.onmessage?.({ data: { id, data: new Uint8Array([0xff, 0xd8, 1]).buffer } }));
  }

  terminate() {
    this.ended = true;
  }
}

const STREAM = { width: 1280, height: 720, frame_rate_hz: 30, bitrate_bps: 4e6 };

/** @param {boolean} [h264] */
async function senderOf(h264 = true) {
  const time = new FakeTime();
  FakeEncoder.supported = h264;
  const state = { open: true, closed: 0, captureUs: 0 };
  /** @type {ArrayBuffer[]} */
  const sent = [];
  const sender = new VideoSender({
    performance: time,
    send: (record) => state.open && sent.push(record) > 0,
    log: () => {},
    VideoEncoder: /** @type {any} */ (FakeEncoder),
    startJpegWorker: () => /** @type {any} */ (new FakeJpegWorker()),
  });
  await sender.prepare(STREAM);
  /** @param {Partial<Frame>} [parts] */
  const offer = (parts) => {
    state.captureUs += 33_333;
    const image = /** @type {any} */ ({ timestamp: state.captureUs });
    sender.offer({
      image, width: 1280, height: 720, captureUs: state.captureUs, lateUs: 2000, screenAngle: 0,
      close: () => { state.closed += 1; }, ...parts,
    });
  };
  return { sender, time, sent, state, offer };
}

/** @param {ArrayBuffer | undefined} record */
const headOf = (record) => {
  const view = new DataView(record ?? new ArrayBuffer(64));
  return {
    sequence: view.getUint32(4, true), key: view.getUint8(3), tUs: Number(view.getBigInt64(8, true)),
    codec: view.getUint8(16), width: view.getUint16(18, true), height: view.getUint16(20, true),
    angle: view.getInt16(22, true),
  };
};

test('never more than three frames are under way, and the newest is the one dropped', async () => {
  const { sender, sent, state, offer } = await senderOf();
  for (let i = 0; i < 5; i++) offer();
  assert.equal(FakeEncoder.newest.inside.length, MAX_UNDER_WAY);
  assert.equal(state.closed, 5);
  FakeEncoder.newest.out();
  offer();
  assert.equal(FakeEncoder.newest.inside.length, 2, 'sent but not credited is still under way');
  sender.credit(headOf(sent[0]).sequence);
  offer();
  assert.equal(FakeEncoder.newest.inside.length, 3);
});

test('a credit covers the frames before it, and unknown credits change nothing', () => {
  const credits = new Credits();
  for (let i = 1; i <= 3; i++) {
    credits.taken();
    credits.wasSent(i, 10 * i);
  }
  credits.credit(77, 40);
  assert.equal(credits.mayTake(40), false);
  credits.credit(2, 45);
  assert.deepEqual(credits.sent.map((frame) => frame.sequence), [3]);
  assert.equal(credits.roundTripMs, 25);
});

test('a frame that is never credited blocks for two seconds only', () => {
  const credits = new Credits();
  for (let i = 1; i <= 3; i++) {
    credits.taken();
    credits.wasSent(i, 0);
  }
  assert.equal(credits.mayTake(2000), false);
  assert.equal(credits.mayTake(2001), true);
});

test('pictures that an encoder drops without a word free their places', async () => {
  const { sender, sent, time, offer } = await senderOf();
  for (let i = 0; i < 2 * MAX_UNDER_WAY; i++) {
    offer();
    offer();
    FakeEncoder.newest.inside.shift();
    FakeEncoder.newest.out();
    assert.equal(sent.length, i + 1, 'at the next one that comes out');
    sender.credit(headOf(sent.at(-1)).sequence);
  }
  for (let i = 0; i < MAX_UNDER_WAY; i++) offer();
  FakeEncoder.newest.inside = [];
  offer();
  assert.equal(FakeEncoder.newest.inside.length, 0);
  time.ms += HELD_MS + 1;
  offer();
  assert.equal(FakeEncoder.newest.inside.length, 1, 'or where none does for a while');
  assert.equal(sender.encoder?.name, 'H.264');
});

test('the first frame is a key, then one each ten seconds and one when asked', async () => {
  const { sender, sent, offer } = await senderOf();
  /** @type {number[]} */
  const keys = [];
  for (let i = 0; i < 350; i++) {
    if (i === 20) sender.requestKey();
    offer();
    FakeEncoder.newest.out();
    const { key, sequence } = headOf(sent.at(-1));
    if (key) keys.push(i);
    sender.credit(sequence);
  }
  assert.deepEqual(keys, [0, 20, 321]);
});

test('a turned phone gives a new configuration, a key, the new size and angle', async () => {
  const { sender, sent, offer } = await senderOf();
  offer();
  FakeEncoder.newest.out();
  offer({ width: 720, height: 1280, screenAngle: 90 });
  FakeEncoder.newest.out();
  assert.deepEqual(FakeEncoder.newest.configs.map(({ width, height }) => [width, height]), [[1280, 720], [720, 1280]]);
  const { key, width, height, angle, codec, tUs } = headOf(sent[1]);
  assert.deepEqual({ key, width, height, angle, codec, tUs }, {
    key: 1, width: 720, height: 1280, angle: 90, codec: 2, tUs: 66_666,
  });
  assert.equal(sender.sequence, 2);
});

test('a frame that could not leave frees its place and asks for a key', async () => {
  const { sender, sent, state, offer } = await senderOf();
  offer();
  FakeEncoder.newest.out();
  state.open = false;
  offer();
  FakeEncoder.newest.out();
  state.open = true;
  sender.credit(1);
  for (let i = 0; i < 3; i++) offer();
  assert.equal(FakeEncoder.newest.inside.length, 3);
  assert.equal(FakeEncoder.newest.out()?.key, true);
  assert.equal(headOf(sent.at(-1)).sequence, 2);
});

test('a frame too large for a record is left out and the next is a key', async () => {
  const { sent, offer } = await senderOf();
  offer();
  FakeEncoder.newest.out(262_144);
  assert.deepEqual(sent, []);
  offer();
  assert.equal(FakeEncoder.newest.out()?.key, true);
});

test('a new connection starts its numbers and its pictures anew', async () => {
  const { sender, sent, offer } = await senderOf();
  offer();
  FakeEncoder.newest.out();
  sender.restart();
  offer();
  assert.equal(FakeEncoder.newest.out()?.key, true);
  assert.equal(headOf(sent[1]).sequence, 1);
});

test('without H.264, and after it has failed, JPEG takes over under the same credits', async () => {
  for (const h264 of [false, true]) {
    const { sender, sent, offer } = await senderOf(h264);
    if (h264) FakeEncoder.newest.init.error(new Error('no hardware'));
    assert.equal(sender.encoder?.name, 'JPEG');
    for (let i = 0; i < 5; i++) offer();
    await new Promise((resolve) => { setImmediate(resolve); });
    await new Promise((resolve) => { setImmediate(resolve); });
    assert.equal(sent.length, 3);
    assert.deepEqual([headOf(sent[0]).codec, headOf(sent[0]).key], [1, 1]);
  }
});

test('H.264 is asked for as constrained baseline at the lowest level that has the picture', async () => {
  assert.equal(h264Candidates(STREAM)[0]?.codec, 'avc1.42E01F');
  assert.equal(h264Candidates({ ...STREAM, frame_rate_hz: 60 })[0]?.codec, 'avc1.42E020');
  assert.equal(h264Candidates({ ...STREAM, width: 1920, height: 1080 })[0]?.codec, 'avc1.42E028');
  assert.deepEqual(h264Candidates(STREAM)[0]?.avc, { format: 'annexb' });
  assert.equal(await supportedH264(undefined, STREAM), null);
  const throwing = { isConfigSupported: () => Promise.reject(new TypeError('unknown member')) };
  assert.equal(await supportedH264(throwing, STREAM), null);
});

test('an encoder that throws frees the frame and is given up', () => {
  /** @type {string[]} */
  const log = [];
  class Throwing extends FakeEncoder {
    encode() {
      throw new Error('closed codec');
    }
  }
  const encoder = new H264Encoder(/** @type {any} */ (Throwing), { codec: 'avc1.42E01F', width: 16, height: 16 }, {
    onEncoded: () => {}, onLost: () => log.push('lost'), onFailure: () => log.push('failure'),
  });
  encoder.encode({
    image: /** @type {any} */ ({ timestamp: 1 }), width: 16, height: 16, captureUs: 1, lateUs: 2000, screenAngle: 0,
    close: () => log.push('closed'),
  });
  assert.deepEqual(log, ['lost', 'failure', 'closed']);
});

test('fewer and smaller pictures are asked of the encoder, and each says by how much it was made smaller', async () => {
  const { sender, sent, offer } = await senderOf();
  sender.ease({ hz: 15, shrunk: 1 });
  let taken = 0;
  for (let i = 0; i < 30; i++) {
    offer();
    if (FakeEncoder.newest.out() === undefined) continue;
    taken += 1;
    sender.credit(headOf(sent.at(-1)).sequence);
  }
  assert.ok(Math.abs(taken - 15) <= 1, `${taken} of 30`);
  assert.deepEqual(FakeEncoder.newest.configs.map(({ width, height }) => [width, height]), [[960, 540]]);
  const { width, height } = headOf(sent[0]);
  assert.deepEqual([width, height, new DataView(sent[0] ?? new ArrayBuffer(0)).getUint8(17)], [960, 540, 1]);
  sender.failed(new Error('the encoder is gone')); // JPEG takes over at the same size
  assert.equal(sender.encoder?.shrunk, 1);
  offer();
  offer();
  for (let k = 0; k < 500 && headOf(sent.at(-1)).codec !== 1; k++) await new Promise((resolve) => setTimeout(resolve, 10));
  assert.deepEqual([headOf(sent.at(-1)).codec, headOf(sent.at(-1)).width], [1, 960]);
});

test('an encoder that holds its first pictures back is given up for good, one that was only slow is not', async () => {
  const { sender, time, offer } = await senderOf();
  offer();
  time.ms = HELD_MS;
  offer();
  assert.equal(sender.encoder?.name, 'H.264');
  FakeEncoder.newest.out();
  time.ms = 3 * HELD_MS;
  offer();
  assert.equal(sender.encoder?.name, 'H.264');
  await sender.prepare(STREAM);
  offer();
  time.ms += HELD_MS + 1;
  offer();
  assert.equal(sender.encoder?.name, 'JPEG');
  assert.equal(await sender.prepare(STREAM), 'JPEG');
});

test('a JPEG worker that is slow to load is waited for: there is no other encoder', async () => {
  const { sender, sent, time, offer } = await senderOf(false);
  offer();
  time.ms = HELD_MS + 1;
  offer();
  await new Promise((resolve) => { setImmediate(() => setImmediate(resolve)); });
  assert.deepEqual([sender.encoder?.name, sent.length, sender.needsJpeg], ['JPEG', 2, false]);
});

test('JPEGs that fail, are too large or were overtaken count as lost, and a worker that fails is given up', async () => {
  /** @type {string[]} */
  const log = [];
  const worker = new FakeJpegWorker();
  worker.postMessage = () => {}; // answers below, one by one
  const encoder = new JpegEncoder(() => /** @type {any} */ (worker), {
    onEncoded: ({ about }) => log.push(`encoded ${about.captureUs}`),
    onLost: () => log.push('lost'),
    onFailure: (error) => log.push(`${error}`),
  });
  for (const captureUs of [1, 2, 3, 4]) {
    const frame = { image: /** @type {any} */ ({}), width: 16, height: 16, captureUs, lateUs: 2000, close: () => {} };
    encoder.encode({ ...frame, screenAngle: 0 });
  }
  const { quality } = encoder;
  const small = new ArrayBuffer(9);
  worker.onmessage?.({ data: { id: 2, data: small } });
  worker.onmessage?.({ data: { id: 1, data: small } });
  worker.onmessage?.({ data: { id: 3, data: new ArrayBuffer(MAX_RECORD_BYTES) } });
  worker.onmessage?.({ data: { id: 4, error: 'no canvas' } });
  worker.onmessage?.({ data: { id: 4, data: small } }); // it was answered before
  assert.deepEqual(log, ['encoded 2', 'lost', 'lost', 'lost', 'Error: no canvas']);
  assert.ok(encoder.quality < quality);
  encoder.close();
  assert.ok(worker.ended);
});

test('the worker draws what it is handed, closes it, and hands the bytes back', async () => {
  const scope = /** @type {any} */ (globalThis);
  /** @type {any[]} */
  const log = [];
  scope.OffscreenCanvas = class {
    /** @param {number} width @param {number} height */
    constructor(width, height) {
      Object.assign(this, { width, height });
      log.push(`canvas ${width}×${height}`);
    }

    getContext() {
      return { drawImage: (/** @type {any} */ image, /** @type {number[]} */ ...to) => log.push(image.name, to.join()) };
    }

    async convertToBlob(/** @type {{ type: string, quality: number }} */ { type, quality }) {
      log.push(`${type} ${quality}`);
      if (quality === 0) throw new Error('no memory');
      return new Blob([new Uint8Array([0xff, 0xd8])]);
    }
  };
  /** @type {any[]} */
  const answers = [];
  scope.postMessage = (/** @type {any} */ answer, /** @type {any[]} */ handed = []) => answers.push([answer, handed]);
  await import('../../src/video/jpeg_worker.js');
  const image = { name: 'picture', close: () => log.push('closed') };
  const wish = { image, width: 480, height: 270 };
  await scope.onmessage({ data: { ...wish, id: 7, quality: 0.7 } });
  await scope.onmessage({ data: { ...wish, id: 8, quality: 0 } });
  assert.deepEqual(log, [
    'canvas 480×270', 'picture', '0,0,480,270', 'closed', 'image/jpeg 0.7',
    'picture', '0,0,480,270', 'closed', 'image/jpeg 0',
  ]);
  const [[first, handed], [second]] = answers;
  assert.deepEqual([first.id, [...new Uint8Array(first.data)], handed], [7, [0xff, 0xd8], [first.data]]);
  assert.deepEqual([second.id, second.error], [8, 'Error: no memory']);
  delete scope.OffscreenCanvas;
  delete scope.postMessage;
  delete scope.onmessage;
});
