import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ServerTime, WakefulClock, commandOf } from '../../src/wire/command.js';
import { FakeTime } from '../fakes.js';

test('the clock of wishes goes on while the device sleeps, and never back', () => {
  const [page, wall] = [new FakeTime(), new FakeTime()];
  wall.ms = 5_000_000;
  const clock = new WakefulClock(page, wall);
  const both = (/** @type {number} */ ms) => [page, wall].forEach((one) => one.advance(ms));
  both(100);
  assert.equal(clock.now(), 100);
  wall.advance(120_000); // asleep: the page's own clock stood still
  both(50);
  assert.equal(clock.now(), 120_150);
  wall.ms -= 3_600_000; // somebody puts the wall's clock right
  both(50);
  assert.equal(clock.now(), 120_200);
  wall.advance(900); // less than a sleep: the clocks drift
  assert.equal(clock.now(), 120_200);
});

test('a wish says how old it is and what time it is at the server, as far as it is known', () => {
  const time = new FakeTime();
  const server = new ServerTime(new WakefulClock(time, time));
  assert.deepEqual(commandOf('arm', 0, server), { type: 'command', what: 'arm', age_ms: 0, server_ms: null });
  server.heard(77_000);
  time.advance(250.7);
  assert.deepEqual(commandOf('stop', 12.4, server), { type: 'command', what: 'stop', age_ms: 12, server_ms: 77_250 });
  server.forget();
  assert.equal(commandOf('stop', 12.4, server).server_ms, null);
});

test('a Status that was held back makes no wish older than it is', () => {
  const time = new FakeTime();
  const server = new ServerTime(new WakefulClock(time, time));
  server.heard(77_000);
  time.advance(6000);
  server.heard(78_000); // five seconds on its way
  assert.equal(server.now(), 83_000);
  server.forget(); // another server, perhaps
  server.heard(500);
  assert.equal(server.now(), 500);
});

test('what time it is at the server is not known after a sleep until it is heard again', () => {
  const [page, wall] = [new FakeTime(), new FakeTime()];
  const server = new ServerTime(new WakefulClock(page, wall));
  server.heard(77_000);
  wall.advance(120_000);
  assert.equal(server.now(), null);
  server.heard(197_000);
  assert.equal(server.now(), 197_000);
});
