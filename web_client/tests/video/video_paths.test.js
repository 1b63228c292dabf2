import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { RtcRefused } from '../../src/video/rtc.js';
import { VideoPaths } from '../../src/video/video_paths.js';
import { FIRST_PICTURE_MS, OLD_FOR_MS, OLD_MS, SILENT_MS, SLOW_ENCODER_MS, SLOW_FOR_MS } from '../../src/video/transport_health.js';
import { GOOD_MS, RETRY_MS } from '../../src/video/retry.js';
import { FakeTime } from '../fakes.js';

const WELCOME = /** @type {any} */ ({ session: 's1' });

/** @type {string[]} */
let log = [];
/** What the server is told of choices. @type {string[]} */
let told = [];
let time = new FakeTime();
/** What the next tries come to; none left: they succeed. @type {(Error | null)[]} */
let tries = [];
/** @type {any} */
let rtc;
/** @type {any} */
let video;
let socketIsOpen = true;
/** @type {VideoPaths} */
let paths;

beforeEach(() => {
  [log, told, time, tries, socketIsOpen] = [[], [], new FakeTime(), [], true];
  rtc = {
    isAble: true,
    isOpen: false,
    isFlowing: false,
    heardMs: 0,
    pictures: { haveRecords: true, captured: () => log.push('captured') },
    async open() {
      log.push('open');
      const failure = tries.shift();
      await null;
      if (failure) throw failure;
      rtc.isOpen = rtc.isFlowing = true;
      rtc.heardMs = time.ms;
    },
    close() { rtc.isOpen = rtc.isFlowing = false; },
  };
  video = {
    encoder: { name: 'H.264' },
    encodeMs: 10,
    offer: () => log.push('offered'),
    requestKey: () => log.push('key'),
    async prepare(/** @type {any} */ _, wantsJpeg = false) { video.encoder.name = wantsJpeg ? 'JPEG' : 'H.264'; },
  };
  paths = new VideoPaths({
    performance: time,
    setTimeout: time.setTimeout,
    clearTimeout: time.clearTimeout,
    rtc,
    video,
    socketIsOpen: () => socketIsOpen,
    place: () => ({ session: 's1', track: /** @type {any} */ ({}) }),
    say: (text) => log.push(text),
    tell: ({ wish, by }) => told.push(`${wish} ${by}`),
  });
});

const settled = () => new Promise((resolve) => setImmediate(resolve));

/** @returns {any} */
const frame = () => ({ close: () => log.push('closed') });

test('pictures go by websocket until the fast path is open, and then by that alone', async () => {
  paths.begin(WELCOME);
  paths.offer(frame());
  assert.deepEqual(log, ['open', 'captured', 'offered'], 'the worker learns of captures before it needs them');
  assert.equal(paths.name, 'WebSocket');
  await settled();
  log = [];
  paths.offer(frame());
  assert.deepEqual(log, ['captured', 'closed']);
  assert.equal(paths.name, 'WebRTC');
});

test('a camera that was opened anew goes by websocket, with a key, until its clock is known', async () => {
  paths.begin(WELCOME);
  await settled();
  rtc.pictures.replaceTrack = async () => { rtc.isFlowing = false; };
  time.advance(2 * FIRST_PICTURE_MS);
  rtc.heardMs = time.ms;
  log = [];
  await paths.filmAnew(/** @type {any} */ ({}));
  paths.offer(frame());
  assert.deepEqual(log, ['key', 'captured', 'offered']);
  paths.look(null);
  assert.equal(rtc.isOpen, true, 'it has as long as a new one until its first picture');
});

test('a fast path that ends gives way with a key picture, and is tried again later and later', async () => {
  paths.begin(WELCOME);
  await settled();
  rtc.close();
  tries = [new Error('a'), new Error('b'), new Error('c')];
  log = [];
  paths.lost('gone');
  assert.deepEqual(log, ['key', 'WebRTC: gone; pictures go by websocket']);
  for (const wait of [RETRY_MS[0], RETRY_MS[1], RETRY_MS[2], RETRY_MS[2]]) {
    log = [];
    time.advance(Number(wait) - 1);
    assert.deepEqual(log, []);
    time.advance(1);
    await settled();
    assert.equal(log[0], 'open');
  }
  assert.equal(paths.name, 'WebRTC');
});

test('after a good while the next try comes soon again', async () => {
  paths.begin(WELCOME);
  await settled();
  paths.fastTries.failures = 3;
  time.advance(GOOD_MS + 1);
  rtc.close();
  paths.lost('gone');
  log = [];
  time.advance(Number(RETRY_MS[0]));
  assert.deepEqual(log, ['open']);
});

test('a fast path that says nothing is given up', async () => {
  paths.begin(WELCOME);
  await settled();
  time.advance(SILENT_MS);
  paths.look(50);
  assert.equal(rtc.isOpen, true);
  time.advance(1);
  paths.look(50);
  assert.equal(rtc.isOpen, false);
  assert.ok(log.includes('key'));
});

/** Looks each half second while the server is heard. @param {number} ms @param {number | null} ageMs */
function lookFor(ms, ageMs) {
  for (let passed = 0; passed <= ms; passed += 500) {
    rtc.heardMs = time.ms;
    paths.look(ageMs);
    time.advance(500);
  }
}

test('pictures that are old for a while are a reason to go by websocket; one old picture is none', async () => {
  paths.begin(WELCOME);
  await settled();
  for (let k = 0; k < 4; k += 1) {
    lookFor(OLD_FOR_MS - 1000, OLD_MS + 1);
    lookFor(500, k % 2 ? null : OLD_MS);
  }
  assert.equal(paths.name, 'WebRTC');
  lookFor(OLD_FOR_MS, OLD_MS + 1);
  assert.equal(paths.name, 'WebSocket');
  assert.match(String(log.at(-1)), /WebRTC: pictures are 401 ms old/);
  time.advance(Number(RETRY_MS[0]));
  await settled();
  assert.equal(paths.name, 'WebRTC', 'and back up again');
});

test('until the first picture flows the websocket goes on; without any the fast path is given up', async () => {
  paths.begin(WELCOME);
  await settled();
  rtc.isFlowing = false;
  log = [];
  paths.offer(frame());
  assert.deepEqual(log, ['captured', 'offered']);
  lookFor(FIRST_PICTURE_MS, 50);
  assert.equal(rtc.isOpen, true);
  lookFor(500, 50);
  assert.equal(rtc.isOpen, false);
});

test('a fast path that is never heard has as long from its beginning as one that falls silent', async () => {
  paths.begin(WELCOME);
  await settled();
  rtc.heardMs = -Infinity;
  time.advance(SILENT_MS);
  paths.look(null);
  assert.equal(rtc.isOpen, true);
  time.advance(1);
  paths.look(null);
  assert.equal(rtc.isOpen, false);
});

test('an encoder that is too slow gives way to JPEG, and is tried again later', async () => {
  rtc.pictures.haveRecords = false;
  paths.begin(WELCOME);
  video.encodeMs = SLOW_ENCODER_MS + 1;
  lookFor(SLOW_FOR_MS, 300);
  await settled();
  assert.equal(paths.name, 'JPEG');
  video.encodeMs = 10;
  time.advance(Number(RETRY_MS[0]));
  await settled();
  assert.equal(paths.name, 'WebSocket');
});

test('a person’s choice is kept until he chooses again', async () => {
  paths.begin(WELCOME);
  await settled();
  for (const wish of /** @type {const} */ (['JPEG', 'WebSocket'])) {
    paths.choose(wish, 'operator');
    await settled();
    paths.lost('late news');
    time.advance(1e6);
    await settled();
    assert.equal(paths.name, wish);
  }
  paths.choose('auto', 'operator');
  await settled();
  assert.equal(paths.name, 'WebRTC');
});

test('the websocket that is chosen while the fast path is being connected stays chosen', async () => {
  for (const wish of /** @type {const} */ (['WebSocket', 'JPEG'])) {
    paths.choose('auto', 'operator');
    paths.begin(WELCOME);
    paths.choose(wish, 'supervisor');
    await settled();
    assert.equal(paths.name, wish);
    paths.choose('auto', 'operator');
    paths.choose(wish, 'supervisor');
    paths.begin(/** @type {any} */ ({ session: 's2' }));
    await settled();
    assert.equal(paths.name, wish, 'welcomed anew meanwhile, too');
  }
});

test('who chose last is obeyed, and the server is told of it, and again when it welcomes the page anew', async () => {
  paths.begin(WELCOME);
  await settled();
  paths.choose('JPEG', 'supervisor');
  await settled();
  assert.equal(paths.name, 'JPEG');
  paths.choose('WebSocket', 'operator');
  await settled();
  assert.equal(paths.name, 'WebSocket');
  paths.end();
  paths.choose('JPEG', 'supervisor');
  paths.begin(/** @type {any} */ ({ session: 's2' }));
  assert.deepEqual(told, ['auto ', 'JPEG supervisor', 'WebSocket operator', 'JPEG supervisor']);
});

test('by choice pictures go by WebRTC even without records', async () => {
  rtc.pictures.haveRecords = false;
  paths.begin(WELCOME);
  await settled();
  assert.equal(paths.name, 'WebSocket');
  paths.choose('WebRTC', 'operator');
  await settled();
  assert.equal(paths.name, 'WebRTC');
});

test('a server that has no WebRTC is not asked again', async () => {
  tries = [new RtcRefused('off')];
  paths.begin(WELCOME);
  await settled();
  time.advance(1e6);
  assert.deepEqual(log, ['open', 'no WebRTC: off']);
});

test('a browser that is not able says so and stays with the websocket', () => {
  rtc.pictures.haveRecords = false;
  paths.begin(WELCOME);
  assert.match(String(log[0]), /by websocket/);
  assert.equal(paths.name, 'WebSocket');
});

test('JPEG and no way at all are named', () => {
  /** @type {any} */ (paths.surroundings.video.encoder).name = 'JPEG';
  assert.equal(paths.name, 'JPEG');
  socketIsOpen = false;
  assert.equal(paths.name, '–');
  paths.offer(frame());
  assert.deepEqual(log, ['closed']);
});

test('with the server gone nothing is tried; welcomed anew, at once', async () => {
  paths.begin(WELCOME);
  await settled();
  paths.end();
  log = [];
  paths.lost('late news');
  time.advance(1e6);
  assert.deepEqual(log, []);
  paths.begin(/** @type {any} */ ({ session: 's2' }));
  assert.deepEqual(log, ['open']);
});

test('welcomed anew while connecting, the new session is connected after the old try', async () => {
  paths.begin(WELCOME);
  paths.begin(/** @type {any} */ ({ session: 's2' }));
  await settled();
  assert.equal(log.filter((one) => one === 'open').length, 2);
});
