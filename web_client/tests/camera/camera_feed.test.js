import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { CameraFeed } from '../../src/camera/camera_feed.js';

const WANTED = { width: 1280, height: 720, frame_rate_hz: 30 };

class FakeTrack extends EventTarget {
  readyState = 'live';
  label = 'back';
  getSettings = () => ({ width: 1280, height: 720, frameRate: 30 });
}

/** Chrome's: of a track that has ended it can't be made. */
class FakeProcessor {
  static running = 0;

  /** @param {{ track: FakeTrack }} init */
  constructor({ track }) {
    if (track.readyState === 'ended') throw new TypeError('Input track cannot be ended');
    FakeProcessor.running += 1;
    const cancel = async () => { FakeProcessor.running -= 1; };
    this.readable = { getReader: () => ({ read: () => new Promise(() => {}), cancel }) };
  }
}

/** @type {CameraFeed} */
let feed;
let track = new FakeTrack();

beforeEach(() => {
  FakeProcessor.running = 0;
  feed = new CameraFeed(/** @type {any} */ ({
    mediaDevices: { getUserMedia: async () => {
      track = new FakeTrack();
      return { getVideoTracks: () => [track] };
    } },
    performance,
    preview: () => {},
    Processor: FakeProcessor,
    screenAngle: () => 0,
    onFrame: () => {},
    onLost: () => {},
  }));
});

test('a camera that is away is settled when it is back, and is no error meanwhile', async () => {
  await feed.open();
  track.readyState = 'ended';
  assert.equal(await feed.settle(WANTED), 'no camera');
  assert.equal(FakeProcessor.running, 0);
  assert.match(await feed.revive(), /^1280x720/);
  assert.equal(FakeProcessor.running, 1);
});

test('whatever settles it at the same time, it gives each frame once', async () => {
  await feed.open();
  await Promise.all([feed.settle(WANTED), feed.settle(WANTED)]);
  assert.equal(FakeProcessor.running, 1);
  await feed.settle(WANTED);
  assert.equal(FakeProcessor.running, 1);
});
