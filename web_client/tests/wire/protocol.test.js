import assert from 'node:assert/strict';
import { test } from 'node:test';

import * as protocol from '../../src/wire/protocol.js';
import { pingOf } from '../fakes.js';

/** @param {ArrayBuffer} buffer */
const hex = (buffer) => Buffer.from(buffer).toString('hex');

test('a TOUCH has the bytes worked out by hand', () => {
  const touch = { held: true, visible: false, press: 7, nonce: 0x0102030405060708n };
  assert.equal(
    hex(protocol.encodeTouch(5, 1e6, touch)),
    '4c020300' + '05000000' + '40420f0000000000' + '01' + '00' + '0000' + '07000000' + '0807060504030201',
  );
});

test('a PONG returns nonce and time of its PING unchanged, to the last bit', () => {
  const nonce = 0xffff_ffff_ffff_fffen;
  const ping = protocol.decodeRecord(pingOf(nonce, 2 ** 52 + 1));
  assert.ok(ping.kind === protocol.Kind.PING);
  const pong = new DataView(protocol.encodePong(1, 3, ping));
  assert.equal(pong.getBigUint64(16, true), nonce);
  assert.equal(pong.getBigInt64(24, true), 2n ** 52n + 1n);
});

test('a MOTION flags whether it has an orientation', () => {
  /** @type {import('../../src/wire/protocol.js').Motion} */
  const motion = {
    rotation_rate: [1, 2, 3], acceleration: [4, 5, 6], orientation_wxyz: null, screen_angle_deg: 270,
  };
  const without = new DataView(protocol.encodeMotion(1, 0, motion));
  const orientation = /** @type {import('../../src/wire/protocol.js').Quaternion} */ ([0.5, 0.5, 0.5, 0.5]);
  const with_ = new DataView(protocol.encodeMotion(1, 0, { ...motion, orientation_wxyz: orientation }));
  assert.equal(without.byteLength, 16 + 44);
  assert.deepEqual([without.getUint8(3), with_.getUint8(3)], [0, 1]);
  assert.equal(without.getFloat32(16 + 20, true), 6);
  assert.equal(without.getFloat32(16 + 24, true), 1);
  assert.equal(with_.getFloat32(16 + 24, true), 0.5);
  assert.equal(without.getInt16(16 + 40, true), 270);
});

test('a FRAME carries its head and then its data', () => {
  const picture = {
    codec: protocol.Codec.H264, key: true, width: 1280, height: 720, screen_angle_deg: /** @type {90} */ (90),
    data: new Uint8Array([9, 8, 7]),
  };
  assert.equal(hex(protocol.encodeFrame(1, 0, picture)).slice(32), '0200' + '0005' + 'd002' + '5a00' + '090807');
});

test('records of another version, kind, size or magic are refused', () => {
  for (const [at, value] of [[0, 0], [1, 1], [2, 77]]) {
    const record = new Uint8Array(pingOf(1n, 0));
    record[at ?? 0] = value ?? 0;
    assert.throws(() => protocol.decodeRecord(record.buffer), protocol.ProtocolError);
  }
  assert.throws(() => protocol.decodeRecord(pingOf(1n, 0).slice(0, 20)), protocol.ProtocolError);
  assert.throws(() => protocol.decodeRecord(new ArrayBuffer(3)), protocol.ProtocolError);
});

test('messages without a type are refused', () => {
  for (const text of ['7', 'null', '[]', '{}']) {
    assert.throws(() => protocol.decodeMessage(text), protocol.ProtocolError);
  }
});
