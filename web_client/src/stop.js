/** The way of STOP beside the socket: a POST of its own, one at a time, for as long as it is asked for. */

/** @import {Fetch} from './pairing.js' */
/** @import {Command} from './protocol_types.js' */

import { ask } from './pairing.js';

/** What the page says when it has given up, in words for who pressed it. */
export const STOP_LOST = {
  unlinked: 'STOP did not reach the robot: there is no link. Press it again, or cut the robot’s power.',
  unconfirmed: 'STOP is not confirmed by the robot. Press it again, or cut the robot’s power.',
};

/** While it is asked for. @param {boolean} heard The server is. */
export function stopWords(heard) {
  return heard ? 'STOP sent: waiting for the robot to confirm' : 'STOP: no link, trying…';
}

export class StopPost {
  /** @param {Fetch} fetch */
  constructor(fetch) {
    this.fetch = fetch;
    this.busy = false;
  }

  /** Sends one unless one is still under way. @param {Command} stop */
  send(stop) {
    if (this.busy) return;
    this.busy = true;
    void ask(this.fetch, 'POST', 'api/stop', stop).finally(() => { this.busy = false; });
  }
}
