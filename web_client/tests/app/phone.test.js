import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { WakefulClock } from '../../src/wire/command.js';
import { Phone } from '../../src/app/phone.js';
import { FakeSocket, FakeTime, fakeWebSocket, pingOf, statusOf } from '../fakes.js';

/** @type {string[]} */
let log = [];
let time = new FakeTime();
/** @type {Phone} */
let phone;

beforeEach(() => {
  log = [];
  time = new FakeTime();
  phone = new Phone({
    base: 'https://robot:8443/',
    performance: time,
    clock: new WakefulClock(time, time),
    links: { WebSocket: fakeWebSocket(), setTimeout: time.setTimeout, clearTimeout: time.clearTimeout },
    dispatch: (event) => log.push(event.type),
    identity: () => ({ device: 'Pixel 7', sensors: 'DeviceMotion', video: 'H.264' }),
    onWelcome: () => log.push('onWelcome'),
    onPath: ({ wish }) => log.push(`onPath ${wish}`),
    onSight: ({ distance_m }) => log.push(`onSight ${distance_m}`),
    onUnwelcome: () => log.push('onUnwelcome'),
  });
  phone.open();
});

const WELCOME = {
  type: 'welcome', session: 's1', version: 2, robot: 'ames', width: 1280, height: 720, frame_rate_hz: 30, bitrate_bps: 4e6,
};

/** @param {FakeSocket | undefined} socket */
const firstMessage = (socket) => JSON.parse(String(socket?.sent[0]));

test('a PING is answered with the newest touch and its nonce too, while that is fresh', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  /** @type {ArrayBuffer[]} */
  const answers = [];
  const ping = (/** @type {number} */ sequence) => {
    answers.length = 0;
    phone.record({ kind: 129, sequence, tUs: 5, nonce: BigInt(sequence) }, (answer) => answers.push(answer));
    return answers.map((answer) => new DataView(answer));
  };
  assert.equal(ping(1).length, 1, 'no touch yet');
  time.ms = 200;
  phone.sendTouch({ held: true, visible: true, press: 3, nonce: 1n });
  time.ms = 250;
  const [pong, touch] = ping(2);
  assert.deepEqual([pong?.getUint8(2), touch?.getUint8(2)], [4, 3]);
  assert.deepEqual(
    [touch?.getUint32(4, true), touch?.getUint8(16), touch?.getUint32(20, true), touch?.getBigUint64(24, true)],
    [2, 1, 3, 2n],
  );
  time.ms = 301;
  assert.equal(ping(4).length, 1, 'an old touch may be of a page that hangs');
  main?.says({ ...WELCOME, session: 's2' });
  assert.equal(ping(1).length, 1, 'nor is one of a former session said again');
});

test('of PINGs that come together after a gap the first and the newest are answered', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  const answered = /** @type {bigint[]} */ ([]);
  const come = (/** @type {number} */ sequence) => phone.record(
    { kind: 129, sequence, tUs: 16_667 * sequence, nonce: BigInt(sequence) },
    (answer) => answered.push(new DataView(answer).getBigUint64(16, true)),
  );
  for (let sequence = 1; sequence <= 3; sequence++) {
    come(sequence);
    time.advance(17);
  }
  assert.deepEqual(answered.splice(0), [1n, 2n, 3n], 'each at once, as they come one by one');
  time.advance(500);
  for (let sequence = 4; sequence <= 33; sequence++) come(sequence);
  time.advance(0);
  assert.deepEqual(answered.splice(0), [4n, 33n]);
  assert.equal(log.filter((type) => type === 'ping').length, 33, 'the newest nonce is known at once');
  time.advance(17);
  come(34);
  assert.deepEqual(answered, [34n]);
});

test('a way of the pictures that a supervisor chose is handed on', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  main?.says({ type: 'path', wish: 'WebSocket', by: 'supervisor' });
  assert.equal(log.at(-1), 'onPath WebSocket');
});

test('what is seen in the picture is handed on', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  main?.says({ type: 'sight', width: 4, height: 3, found: [], robot: [], goal: [], toward: null, distance_m: 2.5 });
  assert.equal(log.at(-1), 'onSight 2.5');
});

test('hello comes first, and the video socket follows the welcome with its session', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  assert.deepEqual(firstMessage(main), {
    type: 'hello', version: 2, role: 'operator', session: '', device: 'Pixel 7', sensors: 'DeviceMotion', video: 'H.264',
  });
  assert.equal(FakeSocket.made.length, 1);
  main?.says(WELCOME);
  const video = FakeSocket.made[1];
  video?.opens();
  assert.equal(video?.url, 'wss://robot:8443/ws/video');
  assert.deepEqual([firstMessage(video).role, firstMessage(video).session], ['video', 's1']);
  video?.says(WELCOME);
  assert.equal(FakeSocket.made.length, 2, 'a welcome on the video socket opens nothing');
});

test('a PING is answered at once with its nonce and its time', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  time.ms = 77;
  main?.says(pingOf(42n, 1234));
  const pong = new DataView(/** @type {ArrayBuffer} */ (main?.sent.at(-1)));
  assert.deepEqual(
    [pong.getUint8(2), pong.getBigInt64(8, true), pong.getBigUint64(16, true), pong.getBigInt64(24, true)],
    [4, 77_000n, 42n, 1234n],
  );
  assert.equal(log.at(-1), 'ping');
});

test('motion waits for the welcome, numbers from one, and is dropped on a full socket', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  /** @type {import('../../src/wire/protocol.js').Motion} */
  const motion = { rotation_rate: [0, 0, 0], acceleration: [0, 0, 9.8], orientation_wxyz: null, screen_angle_deg: 0 };
  phone.sendMotion(1, motion);
  assert.equal(main?.sent.length, 1);
  main?.says(WELCOME);
  phone.sendMotion(2, motion);
  if (main) main.bufferedAmount = 5000;
  phone.sendMotion(3, motion);
  if (main) main.bufferedAmount = 0;
  phone.sendMotion(4, motion);
  const numbers = main?.sent.slice(1).map((record) => new DataView(/** @type {ArrayBuffer} */ (record)).getUint32(4, true));
  assert.deepEqual(numbers, [1, 3], 'the gap shows what was dropped');
});

test('a touch goes out even on a full socket', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  if (main) main.bufferedAmount = 1e6;
  phone.sendTouch({ held: false, visible: true, press: 1, nonce: 1n });
  assert.equal(main?.sent.length, 2);
});

test('losing the main link ends the video link and asks whether we are still known', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  FakeSocket.newest.opens();
  const video = FakeSocket.newest;
  main?.drops();
  assert.equal(video.readyState, 3);
  assert.equal(log.includes('onUnwelcome'), false);
  time.advance(250);
  FakeSocket.newest.drops();
  assert.equal(log.at(-1), 'onUnwelcome');
});

test('credits and wishes for a key reach the encoder', () => {
  /** @type {string[]} */
  const heard = [];
  phone.video = /** @type {any} */ ({
    restart: () => heard.push('restart'), requestKey: () => heard.push('key'), credit: (/** @type {number} */ n) => heard.push(`credit ${n}`),
  });
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  FakeSocket.newest.opens();
  const credit = new DataView(new ArrayBuffer(20));
  [0x4c, 2, 130].forEach((byte, i) => credit.setUint8(i, byte));
  credit.setUint32(16, 9, true);
  FakeSocket.newest.says(credit.buffer);
  FakeSocket.newest.says({ type: 'command', what: 'key_frame' });
  assert.deepEqual(heard, ['restart', 'credit 9', 'key']);
});

test('a command says its age and the server’s time, which a lost link makes unknown', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  main?.says({ type: 'status', time_ms: 50_000 });
  time.advance(20);
  phone.command('stop', 40);
  assert.deepEqual(JSON.parse(String(main?.sent.at(-1))), { type: 'command', what: 'stop', age_ms: 40, server_ms: 50_020 });
  main?.drops();
  assert.equal(phone.command('stop', 90), false, 'nothing is kept for later');
  assert.equal(phone.serverTime.now(), null);
});

test('a flood of faults on the page does not become a flood on the wire', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  for (let i = 0; i < 100; i++) phone.log('x'.repeat(500));
  assert.equal(main?.sent.length, 2);
  assert.equal(JSON.parse(String(main?.sent[1])).text.length, 200);
});

/** A fast way, and the kinds of records that went it. */
function fastWay() {
  const kinds = /** @type {number[]} */ ([]);
  return { isHeard: true, kinds, send: (/** @type {ArrayBuffer} */ one) => kinds.push(new Uint8Array(one)[2] ?? 0) };
}

const STILL = /** @type {import('../../src/wire/protocol.js').Motion} */ ({
  rotation_rate: [0, 0, 0], acceleration: [0, 0, 9.8], orientation_wxyz: null, screen_angle_deg: 0,
});

test('motion goes the fast way while the server is heard there, and by websocket otherwise', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  const way = fastWay();
  phone.fast = way;
  const before = Number(main?.sent.length);
  phone.sendMotion(1, STILL);
  assert.deepEqual([way.kinds, main?.sent.length], [[1], before]);
  way.isHeard = false;
  phone.sendMotion(2, STILL);
  assert.deepEqual([way.kinds, main?.sent.length], [[1], before + 1]);
});

test('a finger is told of by both ways, heard or not', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  const way = fastWay();
  phone.fast = way;
  const before = Number(main?.sent.length);
  for (const isHeard of [true, false]) {
    way.isHeard = isHeard;
    phone.sendTouch({ held: isHeard, visible: true, press: 1, nonce: 1n });
  }
  assert.deepEqual([way.kinds, main?.sent.length], [[3, 3], before + 2]);
});

test('a PING that comes by both ways is answered once, by the first; a new session counts anew', () => {
  const [main] = FakeSocket.made;
  main?.opens();
  main?.says(WELCOME);
  /** @type {string[]} */
  const answers = [];
  const ping = (/** @type {number} */ sequence, /** @type {string} */ way) => phone.record(
    { kind: 129, sequence, tUs: 5, nonce: BigInt(sequence) }, () => answers.push(`${sequence} ${way}`),
  );
  ping(1, 'fast');
  ping(1, 'slow');
  ping(2, 'slow');
  ping(2, 'fast');
  main?.says({ ...WELCOME, session: 's2' });
  ping(1, 'fast');
  assert.deepEqual(answers, ['1 fast', '2 slow', '1 fast']);
});

test('what the server says is told at the time of the clock that goes on while the phone sleeps', () => {
  const wall = new FakeTime();
  const told = /** @type {(number | undefined)[]} */ ([]);
  const { surroundings } = phone;
  surroundings.clock = new WakefulClock(time, wall);
  surroundings.dispatch = (event) => void told.push('now' in event ? event.now : undefined);
  wall.advance(60_000);
  phone.take({ type: 'refused', code: 'rate', field: 'message', allowed: 'less', fatal: false });
  phone.take(statusOf());
  assert.deepEqual(told, [60_000, 60_000]);
});
