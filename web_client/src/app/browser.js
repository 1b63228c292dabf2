/** What the pages take from the browser, gathered in one place. */

/** @import {Fetch} from '../wire/pairing.js' */
/** @import {Surroundings} from '../wire/link.js' */

import { platformOf } from '../wire/problems.js';
import { screenAngleOf } from '../motion/imu.js';

/** @param {Window & typeof globalThis} window */
export function browserOf(window) {
  /** Also what TypeScript does not know yet. @type {Record<string, any>} */
  const scope = window;
  /** @type {Fetch} */
  const fetchHere = window.fetch.bind(window);
  /** @type {(callback: () => void, ms: number) => number} */
  const later = (callback, ms) => window.setTimeout(callback, ms);
  /** @type {Surroundings} */
  const links = {
    WebSocket: window.WebSocket,
    setTimeout: later,
    clearTimeout: (id) => window.clearTimeout(id),
  };
  const canWork = scope.VideoFrame !== undefined && scope.Worker !== undefined;
  const frameWorker = new URL('../camera/frame_worker.js', import.meta.url);
  const canCompress = scope.OffscreenCanvas !== undefined && scope.Worker !== undefined;
  const jpegWorker = new URL('../video/jpeg_worker.js', import.meta.url);
  const rtcWorker = new URL('../video/rtc_worker.js', import.meta.url);
  return {
    scope,
    fetchHere,
    later,
    links,
    platform: platformOf(window.navigator),
    screenAngle: () => screenAngleOf(window.screen, scope.orientation),
    startJpegWorker: canCompress ? () => new Worker(jpegWorker, { type: 'module' }) : undefined,
    startRtcWorker: scope.Worker !== undefined ? () => new Worker(rtcWorker, { type: 'module' }) : undefined,
    startWorker: canWork ? () => new Worker(frameWorker, { type: 'module' }) : undefined,
  };
}
