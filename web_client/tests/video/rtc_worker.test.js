import assert from 'node:assert/strict';
import { mock, test } from 'node:test';

/** What the worker's scope is to the page, and what a page has put into it. @type {any} */
const scope = globalThis;

test('frames go on with their records once they have a date, and all that the page is told of has gone on', async () => {
  /** @type {any[]} */
  const told = [];
  scope.postMessage = (/** @type {any} */ one) => told.push(one);
  await import('../../src/video/rtc_worker.js');
  scope.onmessage({ data: { type: 'origin', timeOrigin: performance.timeOrigin } });
  const encoder = new TransformStream();
  const network = new TransformStream();
  scope.onrtctransform({ transformer: { readable: encoder.readable, writable: network.writable } });
  const writer = encoder.writable.getWriter();
  const reader = network.readable.getReader();
  /** @param {number} k */
  const film = (k) => {
    mock.method(performance, 'now', () => 1000 + 20 * k + 3);
    const capture = { captureUs: 1e6 + k * 20_000, stampUs: k * 20_000, lateUs: 2000, screenAngle: 0 };
    scope.onmessage({ data: { type: 'capture', capture, size: { width: 640, height: 360 } } });
    const frame = {
      data: new Uint8Array([0, 0, 0, 1, 0x65, k]).buffer, timestamp: 1800 * k, getMetadata: () => ({ rtpTimestamp: 1800 * k }),
    };
    return writer.write(frame);
  };
  const filming = (async () => {
    for (let k = 0; k < 40; k += 1) await film(k);
    await writer.close();
    mock.restoreAll();
  })();
  const gone = [];
  for (let one = await reader.read(); !one.done; one = await reader.read()) gone.push(one.value);
  await filming;
  const first = new Uint8Array(gone[0].data)[5] ?? 0;
  assert.ok(first >= 8, `frame ${first} went first`);
  assert.deepEqual(gone.map(({ timestamp }) => timestamp / 1800), Array.from({ length: 40 - first }, (_, k) => first + k));
  assert.ok(gone.every(({ data }) => data.byteLength > 6), 'each has its record');
  assert.equal(told.length, gone.length);
  delete scope.postMessage;
  delete scope.onmessage;
  delete scope.onrtctransform;
});
