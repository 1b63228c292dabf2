import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { BACKLOG_BYTES, HEARD_MS, RtcPath, RtcRefused } from '../../src/video/rtc.js';
import { FakeTime, pingOf } from '../fakes.js';

/** @typedef {import('../../src/wire/protocol_types.js').Welcome} Welcome */

const WELCOME = /** @type {Welcome} */ ({ bitrate_bps: 3e6, frame_rate_hz: 30 });
const TRACK = /** @type {any} */ ({ kind: 'video' });

/** A connection whose other end is the test. */
class FakeConnection {
  /** @type {FakeConnection[]} */
  static made = [];
  connectionState = 'new';
  iceGatheringState = 'complete';
  localDescription = { sdp: 'the answer' };
  /** @type {any} */
  ondatachannel = null;
  /** @type {any} */
  onconnectionstatechange = null;
  /** @type {any} */
  parameters = { encodings: [{}] };
  sender = {
    /** @type {any} */
    track: null,
    /** @type {any} */
    transform: null,
    /** @param {any} track */
    replaceTrack: async (track) => { this.sender.track = track; },
    getParameters: () => this.parameters,
    /** @param {any} parameters */
    setParameters: async (parameters) => { this.parameters = parameters; },
  };

  transceiver = { direction: 'recvonly', sender: this.sender };

  /** @param {any} configuration */
  constructor(configuration) {
    this.configuration = configuration;
    FakeConnection.made.push(this);
  }

  getTransceivers() { return [this.transceiver]; }

  async setRemoteDescription() {}

  async createAnswer() { return {}; }

  async setLocalDescription() {}

  close() { this.becomes('closed'); }

  /** @param {string} state */
  becomes(state) {
    this.connectionState = state;
    this.onconnectionstatechange?.();
  }

  static get newest() {
    return /** @type {FakeConnection} */ (FakeConnection.made.at(-1));
  }
}

class FakeTransform {
  /** @param {Worker} worker */
  constructor(worker) {
    this.worker = worker;
  }
}

/** @type {{ path: string, body: any }[]} */
let posted = [];
/** @type {any[]} */
let told = [];
/** @type {string[]} */
let log = [];
let status = 200;
let time = new FakeTime();
/** @type {any} */
let worker = null;
/** @type {any} */
let channel = null;
/** @type {RtcPath} */
let rtc;

beforeEach(() => {
  [posted, told, log, status] = [[], [], [], 200];
  FakeConnection.made = [];
  time = new FakeTime();
  worker = { postMessage: (/** @type {any} */ one) => told.push(one), terminate: () => log.push('terminated'), onmessage: null };
  const sent = /** @type {ArrayBuffer[]} */ ([]);
  channel = { readyState: 'open', bufferedAmount: 0, sent, send: (/** @type {ArrayBuffer} */ one) => sent.push(one) };
  rtc = new RtcPath({
    performance: { now: time.now, timeOrigin: 5000 },
    fetch: async (path, init) => {
      posted.push({ path, body: JSON.parse(String(init?.body)) });
      return new Response(JSON.stringify({ id: 'o1', sdp: 'the offer', ice_servers: [{ urls: 'turn:x' }] }), { status });
    },
    setTimeout: time.setTimeout,
    PeerConnection: /** @type {any} */ (FakeConnection),
    ScriptTransform: FakeTransform,
    hasStreams: false,
    startWorker: () => worker,
    onRecord: (record) => log.push(`record ${record.kind}`),
    onLost: () => log.push('lost'),
  });
});

/** The server's channel arrives and opens. */
function channelOpens() {
  const connection = FakeConnection.newest;
  connection.ondatachannel({ channel });
  connection.becomes('connected');
  channel.onopen();
}

/** @param {MediaStreamTrack} [track] */
async function opened(track = TRACK) {
  posted.length = 0;
  const opening = rtc.open('s1', track, WELCOME);
  while (posted.length < 2) await new Promise((resolve) => setImmediate(resolve));
  channelOpens();
  await opening;
}

test('it answers the offer with the camera, records behind each picture, and a picture that keeps its size', async () => {
  await opened();
  assert.deepEqual(posted, [
    { path: 'api/rtc', body: { session: 's1' } },
    { path: 'api/rtc/answer', body: { id: 'o1', sdp: 'the answer' } },
  ]);
  const { sender, transceiver, parameters, configuration } = FakeConnection.newest;
  assert.deepEqual(configuration, { iceServers: [{ urls: 'turn:x' }] });
  assert.equal(sender.track, TRACK);
  assert.equal(sender.transform.worker, worker);
  assert.equal(transceiver.direction, 'sendonly');
  assert.equal(parameters.degradationPreference, 'maintain-resolution');
  assert.deepEqual(parameters.encodings, [{ maxBitrate: 3e6, maxFramerate: 30, scaleResolutionDownBy: 1 }]);
  assert.equal(rtc.isOpen, true);
});

test('what is asked of the encoder changes while pictures flow, and comes back with the next connection', async () => {
  await opened();
  await rtc.pictures.ease({ hz: 15, shrunk: 1 });
  assert.deepEqual(FakeConnection.newest.parameters.encodings, [
    { maxBitrate: 3e6, maxFramerate: 15, scaleResolutionDownBy: 4 / 3 },
  ]);
  await opened();
  assert.equal(FakeConnection.newest.parameters.encodings[0].maxFramerate, 15);
});

test('a browser that does not know what to give up last is told by the track', async () => {
  const track = /** @type {any} */ ({ kind: 'video', contentHint: '' });
  await opened(track);
  assert.equal(track.contentHint, '');
  FakeConnection.newest.sender.setParameters = async () => {};
  FakeConnection.newest.parameters = { encodings: [{}] };
  FakeConnection.newest.sender.getParameters = () => ({ encodings: [{}] });
  await rtc.pictures.limit(WELCOME);
  assert.equal(track.contentHint, 'detail');
  const anew = /** @type {any} */ ({ kind: 'video', contentHint: '' });
  await rtc.pictures.replaceTrack(anew);
  assert.equal(anew.contentHint, 'detail', 'each of its tracks');
});

test('the worker is told when pictures were taken, how the phone is turned, and the page’s clock', async () => {
  await opened();
  rtc.pictures.captured(/** @type {any} */ ({ image: { timestamp: 7 }, captureUs: 12, lateUs: 2000, screenAngle: 90, width: 1280, height: 720, close() {} }));
  rtc.pictures.turned([1, 0, 0, 0]);
  assert.deepEqual(told, [
    { type: 'origin', timeOrigin: 5000 },
    { type: 'capture', capture: { captureUs: 12, stampUs: 7, lateUs: 2000, screenAngle: 90 }, size: { width: 1280, height: 720 } },
    { type: 'attitude', orientation: [1, 0, 0, 0] },
  ]);
});

test('what is heard is handed on, and a channel never heard, or that falls silent, is not relied upon', async () => {
  await opened();
  assert.equal(rtc.isHeard, false, 'it is open, which says nothing of the server’s end');
  time.ms = 100;
  channel.onmessage({ data: pingOf(1n, 2) });
  assert.deepEqual(log, ['record 129']);
  time.ms = 100 + HEARD_MS - 1;
  assert.equal(rtc.isHeard, true);
  time.ms += 1;
  assert.equal(rtc.isHeard, false);
  channel.onmessage({ data: pingOf(2n, 2) });
  await opened();
  assert.equal(rtc.isHeard, false, 'what another connection heard is none of its');
});

test('a record that can’t leave at once is dropped', async () => {
  await opened();
  rtc.send(new ArrayBuffer(1));
  channel.bufferedAmount = BACKLOG_BYTES + 1;
  rtc.send(new ArrayBuffer(2));
  assert.equal(channel.sent.length, 1);
});

test('a picture that can’t be appended to is told of by a pair of times', async () => {
  await opened();
  worker.onmessage({ data: { bytes: 9, pair: { rtpTimestamp: 77, captureUs: 5000 } } });
  worker.onmessage({ data: { bytes: 9, pair: null } });
  const [stamp] = channel.sent.map((/** @type {ArrayBuffer} */ one) => new DataView(one));
  assert.deepEqual([stamp.getUint8(2), stamp.getBigInt64(8, true), stamp.getUint32(16, true)], [5, 5000n, 77]);
  assert.equal(channel.sent.length, 1);
});

test('a connection that ends is told of once, and its worker with it', async () => {
  await opened();
  FakeConnection.newest.becomes('failed');
  FakeConnection.newest.becomes('closed');
  assert.deepEqual(log, ['terminated', 'lost']);
  assert.equal(rtc.isOpen, false);
});

test('a server that hangs up is noticed by its channel', async () => {
  await opened();
  channel.onclose();
  assert.deepEqual(log, ['terminated', 'lost']);
});

test('hanging up is no loss', async () => {
  await opened();
  rtc.close();
  assert.deepEqual(log, ['terminated']);
});

test('no connection in time is an error', async () => {
  const opening = rtc.open('s1', TRACK, WELCOME);
  const failed = assert.rejects(opening, /within the time allowed/);
  while (posted.length < 2) await new Promise((resolve) => setImmediate(resolve));
  time.advance(10_000);
  await failed;
});

test('a try that has failed does not fail once more when its time is up', async () => {
  const { prototype } = FakeConnection;
  const { setRemoteDescription } = prototype;
  prototype.setRemoteDescription = async () => { throw new Error('closed'); };
  await assert.rejects(rtc.open('s1', TRACK, WELCOME), /closed/);
  prototype.setRemoteDescription = setRemoteDescription;
  time.advance(10_000);
  await new Promise((resolve) => setImmediate(resolve));
});

test('a server without WebRTC says so, one that refuses says why', async () => {
  status = 404;
  await assert.rejects(rtc.open('s1', TRACK, WELCOME), RtcRefused);
  status = 403;
  await assert.rejects(rtc.open('s1', TRACK, WELCOME), (error) => !(error instanceof RtcRefused));
});

test('pictures flow when the first one has left the encoder', async () => {
  await opened();
  assert.equal(rtc.isFlowing, false);
  worker.onmessage({ data: { bytes: 9, pair: null } });
  assert.equal(rtc.isFlowing, true);
  rtc.close();
  assert.equal(rtc.isFlowing, false);
});

test('pictures of a camera that was opened anew do not flow before one of its own has left', async () => {
  await opened();
  worker.onmessage({ data: { bytes: 9, pair: null } });
  const anew = /** @type {any} */ ({ kind: 'video' });
  await rtc.pictures.replaceTrack(anew);
  assert.deepEqual([rtc.isFlowing, FakeConnection.newest.sender.track, told.at(-1)?.type], [false, anew, 'origin']);
  worker.onmessage({ data: { bytes: 9, pair: null } });
  assert.equal(rtc.isFlowing, true);
});

test('a browser of streams instead of transforms hands them to the worker', async () => {
  rtc.pictures.surroundings.ScriptTransform = undefined;
  rtc.pictures.surroundings.hasStreams = true;
  assert.equal(rtc.pictures.haveRecords, true);
  const { prototype } = /** @type {any} */ (FakeConnection);
  const attach = prototype.getTransceivers;
  prototype.getTransceivers = /** @this {any} */ function getTransceivers() {
    this.sender.createEncodedStreams = () => ({ readable: 'from', writable: 'to' });
    return [this.transceiver];
  };
  await opened();
  prototype.getTransceivers = attach;
  assert.equal(FakeConnection.newest.configuration.encodedInsertableStreams, true);
  assert.deepEqual(told.at(-1), { type: 'streams', readable: 'from', writable: 'to' });
});

test('a browser with neither sends pictures without records, dated by their arrival', async () => {
  rtc.pictures.surroundings.ScriptTransform = undefined;
  assert.deepEqual([rtc.isAble, rtc.pictures.haveRecords], [true, false]);
  await opened();
  rtc.pictures.captured(/** @type {any} */ ({ image: { timestamp: 7 }, captureUs: 12, screenAngle: 90, width: 1280, height: 720, close() {} }));
  assert.equal(rtc.isFlowing, true);
  assert.deepEqual(told, []);
});
