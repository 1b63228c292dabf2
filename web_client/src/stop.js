/** The way of STOP beside the socket: a POST of its own, one at a time, for as long as it is asked for. */

/** @import {Fetch} from './pairing.js' */

import { ask } from './pairing.js';

export class StopPost {
  /** @param {Fetch} fetch */
  constructor(fetch) {
    this.fetch = fetch;
    this.busy = false;
  }

  /** Sends one unless one is still under way. */
  send() {
    if (this.busy) return;
    this.busy = true;
    void ask(this.fetch, 'POST', 'api/stop').finally(() => { this.busy = false; });
  }
}
