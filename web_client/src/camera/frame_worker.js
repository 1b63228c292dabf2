/**
 * Worker for browsers that have the track processor only here (Safari): hands over the newest frame when
 * asked.
 */

/** @typedef {{ readable: ReadableStream<VideoFrame> }} Processor */

const worker = /** @type {any} */ (globalThis);

/** @type {() => void} */
let allow = () => {};

/** @param {MediaStreamTrack} track */
async function pump(track) {
  /** @type {Processor} */
  const processor = new worker.MediaStreamTrackProcessor({ track, maxBufferSize: 1 });
  const reader = processor.readable.getReader();
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    /** @type {Promise<void>} */
    const allowed = new Promise((resolve) => { allow = resolve; });
    worker.postMessage(value, [value]);
    await allowed;
  }
}

worker.onmessage = (/** @type {MessageEvent} */ { data }) => {
  if (data === 'next') {
    allow();
    return;
  }
  const able = typeof worker.MediaStreamTrackProcessor === 'function';
  worker.postMessage(able);
  if (able) void pump(data);
};
