/** The page of all robots of a machine: asks its own server once a second, and can do nothing else. */

/** @import {Answer, Server} from './fleet.js' */

import { browserOf } from '../app/browser.js';
import { refusalOf } from '../wire/pairing.js';
import { OLD_MS, cardOf, withEnded } from './fleet.js';
import { FleetView } from './view.js';
import { speak } from '../words/say.js';

const ASK_MS = 1000;
const PATIENCE_MS = 2500;

await speak(document, navigator.languages, () => window.localStorage);
const { fetchHere, later } = browserOf(window);
const view = new FleetView(document);
/** @type {Server[]} */
let servers = [];
let heardMs = -Infinity;

/** Resolves with why there is no answer, or "". */
async function ask() {
  try {
    const response = await fetchHere('api/fleet', {
      credentials: 'same-origin', cache: 'no-store', signal: AbortSignal.timeout(PATIENCE_MS),
    });
    if (!response.ok) return `Nothing is shown: ${await refusalOf(response, false)}`;
    /** @type {Answer} */
    const answer = await response.json();
    servers = withEnded(servers, answer.servers);
    heardMs = performance.now();
    return '';
  } catch {
    return 'The server of this page does not answer.';
  }
}

async function turn() {
  const why = await ask();
  const isOld = performance.now() - heardMs > OLD_MS;
  view.say(servers.length > 0 && !isOld ? '' : why);
  view.render(servers.map((server) => cardOf(server, window.location, isOld)));
  later(() => void turn(), ASK_MS);
}

void turn();
