import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { BACKLOG_BYTES, BACK_OFF_MS, Link, socketUrl } from '../../src/wire/link.js';
import { FakeSocket, FakeTime, fakeWebSocket, pingOf, statusOf } from '../fakes.js';

/** @type {string[]} */
let log = [];
let time = new FakeTime();
/** @type {Link} */
let link;

beforeEach(() => {
  log = [];
  time = new FakeTime();
  link = new Link('ws://here/ws/phone', {
    onOpen: () => log.push('open'),
    onMessage: (message) => log.push(message.type),
    onRecord: (record) => log.push(`record ${record.kind}`),
    onClose: (wasWelcome) => log.push(`close ${wasWelcome}`),
  }, { WebSocket: fakeWebSocket(), setTimeout: time.setTimeout, clearTimeout: time.clearTimeout });
  link.open();
});

const WELCOME = { type: 'welcome', session: 's' };

test('records and messages reach their handlers', () => {
  FakeSocket.newest.opens();
  FakeSocket.newest.says(WELCOME);
  FakeSocket.newest.says(statusOf());
  FakeSocket.newest.says(pingOf(1n, 0));
  assert.deepEqual(log, ['open', 'welcome', 'status', 'record 129']);
});

test('failed connections are tried again after 0.25, 0.5, 1, 2, 4, 4 s', () => {
  for (const wait of [...BACK_OFF_MS, 4000]) {
    const made = FakeSocket.made.length;
    FakeSocket.newest.drops();
    time.advance(wait - 1);
    assert.equal(FakeSocket.made.length, made);
    time.advance(1);
    assert.equal(FakeSocket.made.length, made + 1);
  }
});

test('only a welcome makes the next wait short again', () => {
  for (let i = 0; i < 3; i++) {
    FakeSocket.newest.opens();
    FakeSocket.newest.drops();
    time.advance(4000);
  }
  FakeSocket.newest.opens();
  FakeSocket.newest.says(WELCOME);
  FakeSocket.newest.drops();
  assert.equal(log.at(-1), 'close true');
  const made = FakeSocket.made.length;
  time.advance(250);
  assert.equal(FakeSocket.made.length, made + 1);
});

test('a handshake that hangs and a server that falls silent count as lost', () => {
  time.advance(3999);
  assert.deepEqual(log, []);
  time.advance(1);
  assert.deepEqual(log, ['close false']);
  time.advance(250);
  FakeSocket.newest.opens();
  for (let i = 0; i < 20; i++) {
    time.advance(1900);
    FakeSocket.newest.says(pingOf(1n, 0));
  }
  const silent = FakeSocket.newest;
  time.advance(2000);
  assert.equal(log.at(-1), 'close false');
  assert.equal(silent.readyState, 3);
});

test('a record is dropped rather than queued', () => {
  assert.equal(link.sendRecord(new ArrayBuffer(8)), false, 'not open yet');
  FakeSocket.newest.opens();
  assert.equal(link.sendRecord(new ArrayBuffer(8)), true);
  FakeSocket.newest.bufferedAmount = BACKLOG_BYTES + 1;
  assert.equal(link.sendRecord(new ArrayBuffer(8)), false);
  assert.equal(link.sendRecord(new ArrayBuffer(8), Infinity), true);
  assert.equal(link.sendMessage({ type: 'command', what: 'stop', age_ms: 0, server_ms: null }), true);
  assert.equal(FakeSocket.newest.sent.length, 3);
});

test('a socket given up is not listened to', () => {
  const old = FakeSocket.newest;
  old.opens();
  old.drops();
  time.advance(250);
  old.drops();
  assert.deepEqual(log, ['open', 'close false']);
});

test('closed for good stays closed', () => {
  FakeSocket.newest.opens();
  link.close();
  time.advance(60_000);
  assert.equal(FakeSocket.made.length, 1);
});

test('what cannot be read is a fatal refusal of this version of the page', () => {
  FakeSocket.newest.opens();
  FakeSocket.newest.says(new ArrayBuffer(2));
  FakeSocket.newest.onmessage({ data: 'not JSON' });
  assert.deepEqual(log, ['open', 'refused', 'refused']);
});

test('addresses follow the page’s scheme and folder and lose its secret', () => {
  assert.equal(socketUrl('ws/phone', 'https://robot.lan:8443/#k=secret'), 'wss://robot.lan:8443/ws/phone');
  assert.equal(socketUrl('ws/phone', 'http://localhost:8443/lab/supervisor'), 'ws://localhost:8443/lab/ws/phone');
});
