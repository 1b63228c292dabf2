/** The way of STOP beside the socket: a POST of its own, one at a time, for as long as it is asked for. */

/** @import {Fetch} from './pairing.js' */
/** @import {Command} from './protocol_types.js' */

import { OWN_HEADERS, PATIENCE_MS, refusalOf } from './pairing.js';

/**
 * What the server said to a POST.
 * @typedef {object} StopAnswer
 * @property {boolean} taken
 * @property {string} why It was not, in words.
 * @property {string} mode Of the robot as it was answered, or "" of a server that does not say.
 */

/** How a STOP ended that no Status has confirmed; "": none did. @typedef {'' | 'unlinked' | 'unconfirmed' | 'unseen' | 'refused' | 'stopped'} StopEnd */

const SILENT_LEADER = 'A robot whose leader is silent coasts, then ramps down by itself; with another leader it flies on.';

/** @type {Record<Exclude<StopEnd, ''>, string>} */
const END_WORDS = {
  unlinked: `STOP did not reach the robot: there is no link. Press it again, or cut the robot’s power. ${SILENT_LEADER}`,
  unconfirmed: 'STOP is not confirmed by the robot. Press it again, or cut the robot’s power.',
  unseen: 'The server has taken STOP, but nothing shows that the robot did. Press it again, or cut the robot’s power.',
  refused: `The robot can’t be stopped from this page. Stop it from another one, or cut its power. ${SILENT_LEADER}`,
  stopped: 'STOPPED: the server has taken STOP from this page, and the robot confirms it.',
};

/**
 * @param {Exclude<StopEnd, ''>} end
 * @param {StopAnswer | null} answer
 */
export function endWords(end, answer) {
  return end === 'refused' ? `STOP was refused (${answer?.why.replace(/\.$/, '')}). ${END_WORDS.refused}` : END_WORDS[end];
}

/**
 * While it is asked for.
 * @param {boolean} heard The server is.
 * @param {StopAnswer | null} answer
 */
export function stopWords(heard, answer) {
  if (heard) return 'STOP sent: waiting for the robot to confirm';
  if (answer === null) return 'STOP: no link, trying…';
  return answer.taken ? 'STOP taken by the server: waiting for the robot to confirm'
    : `STOP refused (${answer.why}): still trying…`;
}

/**
 * How a STOP has ended that was given up.
 * @param {boolean} heard The server is.
 * @param {StopAnswer | null} answer
 * @returns {StopEnd}
 */
export function endOf(heard, answer) {
  if (heard) return 'unconfirmed';
  if (answer === null) return 'unlinked';
  return answer.taken ? 'unseen' : 'refused';
}

/**
 * Of two answers the one that counts: a STOP that was taken once was taken.
 * @param {StopAnswer | null} before
 * @param {StopAnswer} answer
 */
export function weigh(before, answer) {
  return before?.taken && !answer.taken ? before : answer;
}

/** Whether the robot has stopped, by an answer. @param {StopAnswer} answer */
export function hasStopped({ taken, mode }) {
  return taken && mode === 'STOPPED';
}

export class StopPost {
  /**
   * @param {Fetch} fetch
   * @param {(answer: StopAnswer) => void} onAnswer Not called without one.
   */
  constructor(fetch, onAnswer) {
    this.fetch = fetch;
    this.onAnswer = onAnswer;
    this.busy = false;
  }

  /** Sends one unless one is still under way. @param {Command} stop */
  send(stop) {
    if (this.busy) return;
    this.busy = true;
    void this.ask(stop).finally(() => { this.busy = false; });
  }

  /** @param {Command} stop */
  async ask(stop) {
    let response;
    try {
      response = await this.post(JSON.stringify(stop));
      // a server of another version may not know our words, but it knows a STOP without any
      if (response.status === 400) response = await this.post(null);
    } catch {
      return; // it can't be reached
    }
    this.onAnswer(response.ok ? { taken: true, why: '', mode: await modeOf(response) }
      : { taken: false, why: await refusalOf(response, false), mode: '' });
  }

  /** @param {string | null} body */
  post(body) {
    return this.fetch('api/stop', {
      method: 'POST', credentials: 'same-origin', headers: OWN_HEADERS, keepalive: true,
      signal: AbortSignal.timeout(PATIENCE_MS), body,
    });
  }
}

/** @param {Response} response */
async function modeOf(response) {
  try {
    return String((await response.json()).mode ?? '');
  } catch {
    return ''; // of a server that says it in other words
  }
}
