/** The supervisor's page as a pure function: what is known, and what an event makes of it. */

/** @import {Refused, Status} from '../wire/protocol_types.js' */
/** @import {ShownMode} from '../ui/session_types.js' */
/** @import {StopAnswer} from '../wire/stop.js' */

import { isAtRest } from '../ui/mode_words.js';
import { GIVE_UP_MS } from '../wire/command.js';
import { Problem } from '../wire/problems.js';
import { endOf, endWords, hasStopped, weigh } from '../wire/stop.js';
import { STATUS_LIFE_MS } from '../ui/session.js';

/** Twenty seconds of Status at 10 Hz. */
export const REMEMBERED = 200;
/** A place that is less sure than this is none, and no other could be read beside it. */
const NOWHERE_MM = 1000;
const NOTICE_MS = 5000;

/**
 * @typedef {{ errorMm: number | null, errorDeg: number | null, sigmaMm: number | null,
 *   rejected: number | null }} Sample
 */

/**
 * @typedef {object} Board
 * @property {boolean} linked The server has welcomed us.
 * @property {boolean} heard The newest Status is young enough to be believed.
 * @property {Status | null} status
 * @property {number} statusAtMs
 * @property {boolean} stopping STOP was asked for and not yet confirmed.
 * @property {number} stopAtMs When it was asked for.
 * @property {StopAnswer | null} stopAnswer What the server said to it beside the socket.
 * @property {boolean} known The server has let this browser in, at least once.
 * @property {readonly Sample[]} history Oldest first.
 * @property {{ text: string, untilMs: number } | null} notice
 * @property {Problem | null} problem
 */

/**
 * @typedef {{ type: 'welcomed' } | { type: 'paired' } | { type: 'stop_answer', answer: StopAnswer } | { type: 'disconnected' } | { type: 'problem', problem: Problem }
 *   | { type: 'status', status: Status, now: number } | { type: 'refused', refused: Refused, now: number }
 *   | { type: 'notice', text: string, now: number } | { type: 'tick', now: number }
 *   | { type: 'stop', now: number } | { type: 'stop_tick', now: number }} Event
 */

/** @type {Board} */
export const EMPTY = Object.freeze({
  linked: false,
  heard: false,
  status: null,
  statusAtMs: -Infinity,
  stopping: false,
  stopAtMs: -Infinity,
  stopAnswer: null,
  known: false,
  history: [],
  notice: null,
  problem: null,
});

/**
 * @param {Board} board
 * @param {Event} event
 * @returns {Board}
 */
export function reduce(board, event) {
  switch (event.type) {
    case 'welcomed':
      return { ...board, linked: true, problem: null };
    case 'paired':
      return { ...board, known: true };
    case 'disconnected':
      return { ...board, linked: false, heard: false };
    case 'problem':
      return { ...board, linked: false, heard: false, problem: event.problem };
    case 'status':
      return heardFrom(board, event.status, event.now);
    case 'refused':
      return refused(board, event.refused, event.now);
    case 'notice':
      return { ...board, notice: { text: event.text, untilMs: event.now + NOTICE_MS } };
    case 'stop':
      return { ...board, stopping: true, stopAtMs: event.now, stopAnswer: null, notice: null };
    case 'stop_answer':
      return answered(board, event.answer);
    case 'stop_tick':
      return insisted(board, event.now);
    case 'tick':
      return ticked(board, event.now);
  }
}

/**
 * @param {Board} board
 * @param {Status} status
 * @param {number} now
 * @returns {Board}
 */
function heardFrom(board, status, now) {
  const sample = {
    errorMm: status.error_mm,
    errorDeg: status.error_deg,
    sigmaMm: status.sigma_mm !== null && status.sigma_mm < NOWHERE_MM ? status.sigma_mm : null,
    rejected: status.estimate?.leds_rejected ?? null,
  };
  return {
    ...board,
    status,
    statusAtMs: now,
    heard: true,
    stopping: board.stopping && status.mode !== 'STOPPED',
    // of a robot at rest nobody need be told any more that STOP did not reach it
    notice: board.notice?.untilMs === Infinity && isAtRest(status.mode) ? null : board.notice,
    history: [...board.history.slice(1 - REMEMBERED), sample],
  };
}

/**
 * @param {Board} board
 * @param {number} now
 * @returns {Board}
 */
function insisted(board, now) {
  if (!board.stopping || now - board.stopAtMs <= GIVE_UP_MS) return board;
  return stopEnded(board, endOf(board.heard, board.stopAnswer));
}

/**
 * @param {Board} board
 * @param {StopAnswer} answer
 * @returns {Board}
 */
function answered(board, answer) {
  if (!board.stopping) return board;
  if (hasStopped(answer) && !board.heard) return stopEnded(board, 'stopped');
  return { ...board, stopAnswer: weigh(board.stopAnswer, answer) };
}

/**
 * @param {Board} board
 * @param {import('../wire/stop.js').StopEnd} end
 * @returns {Board}
 */
function stopEnded(board, end) {
  const text = end === '' ? '' : endWords(end, board.stopAnswer);
  return { ...board, stopping: false, notice: { text, untilMs: Infinity } };
}

/**
 * @param {Board} board
 * @param {Refused} refusal
 * @param {number} now
 * @returns {Board}
 */
function refused(board, refusal, now) {
  const words = `${refusal.field}: ${refusal.allowed}`;
  if (refusal.fatal) {
    const code = refusal.code === 'version' ? 'old_page' : refusal.code === 'role' ? 'wrong_role' : 'refused';
    return reduce(board, { type: 'problem', problem: new Problem(code, words) });
  }
  if (refusal.code === 'age' && board.stopping) return board; // it is said again
  return reduce(board, { type: 'notice', text: `Not taken: ${words}`, now });
}

/**
 * @param {Board} board
 * @param {number} now
 * @returns {Board}
 */
function ticked(board, now) {
  const heard = board.heard && now - board.statusAtMs <= STATUS_LIFE_MS;
  const notice = board.notice !== null && now < board.notice.untilMs ? board.notice : null;
  return { ...board, heard, notice };
}

/**
 * @param {Board} board
 * @returns {ShownMode}
 */
export function shownMode(board) {
  if (!board.linked) return 'NO_LINK';
  if (!board.heard || board.status === null) return 'NO_WORD';
  return board.status.mode;
}

const ARMED = ['ARMED', 'TRACK', 'COAST', 'HOLD'];

/**
 * What the card about arming says; of a robot that is armed, what would keep it from it says nothing.
 * @param {Pick<Status, 'mode' | 'ready' | 'refusals'>} status
 */
export function beforeArming({ mode, ready, refusals }) {
  const waiting = mode === 'DISARMED', fine = refusals.length === 0;
  const armed = [...ARMED, 'RAMP'].includes(mode);
  return {
    title: armed ? 'While armed' : 'Before arming',
    badge: !waiting ? mode.toLowerCase() : ready ? 'ready' : `${refusals.length} to mend`,
    tone: !waiting ? '' : ready ? 'good' : 'bad',
    lines: armed ? [] : fine ? ['Nothing is in the way'] : refusals,
    fine,
  };
}

/**
 * Which requests make sense now.
 * @param {Board} board
 */
export function requests(board) {
  const mode = shownMode(board);
  return {
    arm: mode === 'DISARMED' && board.status?.ready === true,
    disarm: ARMED.includes(mode),
    reset: mode === 'STOPPED',
  };
}
