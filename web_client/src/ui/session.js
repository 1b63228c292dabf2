/**
 * The phone page as a pure function: what is known, and what an event makes of it. The page only asks; the
 * control process decides, and `Status` alone says what is true.
 */

/** @import {Status, Refused} from '../wire/protocol_types.js' */
/** @import {Touch} from '../wire/protocol.js' */
/** @import {Effect, Event, Outcome, ShownMode, State, Signal} from './session_types.js' */

import { GIVE_UP_MS } from '../wire/command.js';
import { Problem } from '../wire/problems.js';
import { AGAIN_MS, FREE_MS, isFree, isLed } from './standby.js';
import { endOf, hasStopped, weigh } from '../wire/stop.js';

/** A Status older than this is no news any more [ms]. */
export const STATUS_LIFE_MS = 500;
const NOTICE_MS = 5000;
/** A page that had no time for itself for so long kept the robot waiting, and says that it was no link [ms]. */
const BUSY_MS = 250;
/** @type {ShownMode[]} */
const FLYING = ['TRACK', 'COAST', 'HOLD'];
/** Batteries that people must know of. @type {Status['battery'][]} */
const WORSE = ['unknown', 'low', 'empty'];
/** How a STOP ended is told of for at least so long [ms]. */
const STOP_END_MS = 8000;

/** @type {State} */
export const INITIAL = Object.freeze({
  phase: 'welcome',
  step: '',
  problem: null,
  notice: null,
  linked: false,
  status: null,
  statusAtMs: -Infinity,
  pressAtMode: 0,
  leftOfMs: 0,
  tickedMs: Infinity,
  heard: false,
  held: false,
  visible: true,
  press: 0,
  nonce: 0n,
  stopping: false,
  stopAtMs: -Infinity,
  stopAnswer: null,
  stopEnd: /** @type {const} */ (''),
  known: false,
  standby: false,
  led: false,
  freeMs: Infinity,
  you: '',
  asked: null,
  motionSilent: false,
  health: { path: /** @type {const} */ ('–'), fps: 0, eased: '', rttMs: null, imuHz: 0, kbps: 0 },
  calibration: null,
});

/**
 * What an event makes of the state.
 * @param {State} state
 * @param {Event} event
 * @returns {Outcome}
 */
export function reduce(state, event) {
  const outcome = transition(state, event);
  if (outcome.state.phase !== 'operating' || outcome.state.standby) return outcome;
  const mode = shownMode(outcome.state);
  if (mode !== shownMode(state)) return felt(outcome, mode);
  const battery = outcome.state.status?.battery ?? 'untold';
  if (battery !== (state.status?.battery ?? 'untold') && WORSE.includes(battery)) {
    return felt(outcome, battery === 'empty' ? 'EMPTY' : 'WEAK');
  }
  const known = state.status?.thrusters_weak ?? [];
  const isWeaker = outcome.state.status?.thrusters_weak.some((words) => !known.includes(words));
  return isWeaker ? felt(outcome, 'WEAK') : outcome;
}

/**
 * @param {Outcome} outcome
 * @param {Signal} mode
 * @returns {Outcome}
 */
function felt({ state, effects }, mode) {
  return { state, effects: [...effects, { type: 'feel', mode }] };
}

/**
 * @param {State} state
 * @param {Event} event
 * @returns {Outcome}
 */
function transition(state, event) {
  switch (event.type) {
    case 'start':
      return to({ ...state, phase: 'starting', step: '', problem: null });
    case 'paired':
      return to({ ...state, known: true });
    case 'step':
      return to({ ...state, step: event.text });
    case 'problem':
      return blocked(state, event.problem);
    case 'started':
      return to({ ...state, phase: 'operating', step: '' });
    case 'welcomed':
      return to({ ...state, linked: true, standby: false, led: true, problem: null, you: event.you ?? state.you }, { type: 'touch' });
    case 'watching':
      return to({ ...state, you: event.you });
    case 'take_lead':
      return to({ ...state, freeMs: Infinity }, { type: 'ask_lead' });
    case 'disconnected':
      if (state.standby) return to(state, { type: 'stand_by' }); // it asks again by itself when it may
      return to({ ...state, linked: false, heard: false, held: false, nonce: 0n, calibration: null });
    case 'status':
      return heardFrom(state, event.status, event.now);
    case 'refused':
      return refused(state, event.refused, event.now);
    case 'notice':
      return to(noticed(state, event.text, event.now));
    case 'ping':
      return to({ ...state, nonce: event.nonce });
    case 'tick':
      return ticked(state, event.now);
    case 'press':
      return pressed(state);
    case 'release':
      return released(state);
    case 'visibility':
      return seen(state, event.visible);
    case 'stop':
      return stopped(state, event.now);
    case 'stop_answer':
      return answered(state, event.answer, event.now);
    case 'stop_tick':
      return insisted(state, event.now);
    case 'ask':
      return asked(state, event.what, event.now);
    case 'motion_silent':
      return to({ ...state, motionSilent: event.silent });
    case 'health':
      return to({ ...state, health: event.health });
    case 'calibration':
      return to({ ...state, calibration: event.calibration.phase === 'off' ? null : event.calibration });
    case 'calibrate':
      return to(state, { type: 'calibrate', what: event.what });
  }
}

/** @param {number} ageMs @returns {Effect[]} */
function stops(ageMs) {
  return [{ type: 'command', what: 'stop', ageMs }, { type: 'post_stop', ageMs }];
}

/**
 * @param {State} state
 * @param {number} now
 */
function stopped(state, now) {
  return to({ ...state, stopping: true, stopAtMs: now, stopAnswer: null, stopEnd: '', held: false }, ...stops(0), { type: 'touch' });
}

/**
 * STOP again until the robot has stopped, but never to somebody else's flight; what was given up is said until
 * the server has been heard again, and long enough to be read.
 * @param {State} state
 * @param {number} now
 * @returns {Outcome}
 */
function insisted(state, now) {
  const ageMs = now - state.stopAtMs;
  if (state.stopping && ageMs <= GIVE_UP_MS) return to(state, ...stops(ageMs));
  if (state.stopping) {
    const stopEnd = endOf(state.heard, state.stopAnswer);
    return to({ ...state, stopping: false, stopAtMs: now, stopEnd }, { type: 'feel', mode: 'STOP_LOST' });
  }
  if (state.stopEnd !== '' && state.heard && ageMs > STOP_END_MS) return to({ ...state, stopEnd: '' });
  return unanswered(state, now);
}

/**
 * What the server says beside the socket counts as much as a Status where none comes.
 * @param {State} state
 * @param {import('../wire/stop.js').StopAnswer} answer
 * @param {number} now
 */
function answered(state, answer, now) {
  if (!state.stopping) return to(state);
  if (hasStopped(answer) && !state.heard) return to({ ...state, stopping: false, stopAtMs: now, stopEnd: 'stopped' });
  return to({ ...state, stopAnswer: weigh(state.stopAnswer, answer) });
}

/**
 * Arm and disarm go out once: on a link that is away the server refuses them when they come too late.
 * @param {State} state
 * @param {'arm' | 'disarm'} what
 * @param {number} now
 */
function asked(state, what, now) {
  return to({ ...state, asked: { what, atMs: now, mode: shownMode(state) } }, { type: 'command', what, ageMs: 0 });
}

/**
 * @param {State} state
 * @param {number} now
 */
function unanswered(state, now) {
  const { asked, heard } = state;
  if (asked === null || now - asked.atMs <= GIVE_UP_MS) return to(state);
  const word = asked.what === 'arm' ? 'Arm' : 'Disarm';
  const rest = { ...state, asked: null };
  return to(heard ? rest : noticed(rest, `${word} did not reach the robot: there is no link. It is given up.`, now));
}

/**
 * @param {State} state
 * @param {...Effect} effects
 * @returns {Outcome}
 */
function to(state, ...effects) {
  return { state, effects };
}

/**
 * Back to the first screen, with what is to be mended.
 * @param {State} state
 * @param {Problem} problem
 */
function blocked(state, problem) {
  /** @type {State} */
  const back = { ...state, phase: 'welcome', step: '', problem, linked: false, standby: false, heard: false, held: false, calibration: null };
  return to(back, { type: 'close_link' });
}

/**
 * @param {State} state
 * @param {Status} status
 * @param {number} now
 */
function heardFrom(state, status, now) {
  const stopping = state.stopping && status.mode !== 'STOPPED';
  const stopEnd = status.mode === 'STOPPED' ? '' : state.stopEnd;
  const asked = state.asked?.mode === status.mode ? state.asked : null;
  const pressAtMode = state.status?.mode === status.mode ? state.pressAtMode : state.press;
  const leftOfMs = Math.max(status.until_ramp_ms ?? 0, status.until_ramp_ms === null ? 0 : state.leftOfMs);
  return to({ ...state, status, statusAtMs: now, heard: true, stopping, stopEnd, asked, pressAtMode, leftOfMs });
}

/**
 * @param {State} state
 * @param {Refused} refusal
 * @param {number} now
 */
function refused(state, refusal, now) {
  const words = `${refusal.field}: ${refusal.allowed}`;
  if (refusal.fatal && refusal.code === 'version') return blocked(state, new Problem('old_page', words));
  if (refusal.fatal && refusal.code === 'role') {
    return to({ ...state, linked: false, held: false, nonce: 0n, calibration: null, standby: true, freeMs: Infinity }, { type: 'stand_by' });
  }
  if (refusal.code === 'age' && state.stopping) return to(state); // it is said again
  if (refusal.code === 'age') return to(noticed(state, 'It came too late and was not done: press again.', now));
  if (refusal.code === 'calibration') return to(state); // each picture is; the status says it once
  return to(noticed(state, `Not taken: ${words}`, now));
}

/**
 * @param {State} state
 * @param {string} text
 * @param {number} now
 * @returns {State}
 */
function noticed(state, text, now) {
  return { ...state, notice: { text, untilMs: now + NOTICE_MS } };
}

/**
 * @param {State} state
 * @param {number} now
 */
function ticked(state, now) {
  const heard = state.heard && now - state.statusAtMs <= STATUS_LIFE_MS;
  const notice = state.notice !== null && now < state.notice.untilMs ? state.notice : null;
  const away = now - state.tickedMs;
  const free = state.standby && isFree({ ...state, heard });
  const freeMs = free ? Math.min(state.freeMs, now) : Infinity;
  const next = { ...state, heard, notice, tickedMs: state.visible ? now : Infinity, freeMs, led: state.led && !isLed({ ...state, heard }) };
  if (now - freeMs > (next.led ? AGAIN_MS : FREE_MS)) return to({ ...next, freeMs: now }, { type: 'ask_lead' });
  if (away > BUSY_MS && state.linked && FLYING.includes(shownMode(state)) && notice === null) {
    const text = `This phone was too busy for ${(away / 1000).toFixed(1)} s: close other apps, end power saving, let it cool down.`;
    return to(noticed(next, text, now), { type: 'touch' }, { type: 'tell', text });
  }
  return state.linked ? to(next, { type: 'touch' }) : to(next);
}

/** @param {State} state */
function pressed(state) {
  if (state.held || !state.visible || !state.linked) return to(state);
  return to({ ...state, held: true, press: (state.press + 1) >>> 0 }, { type: 'touch' });
}

/** @param {State} state */
function released(state) {
  return state.held ? to({ ...state, held: false }, { type: 'touch' }) : to(state);
}

/**
 * A page nobody sees is not held.
 * @param {State} state
 * @param {boolean} visible
 */
function seen(state, visible) {
  return to({ ...state, visible, held: state.held && visible, tickedMs: Infinity }, { type: 'touch' });
}

/**
 * The mode to show: that of the robot only while the server is heard.
 * @param {State} state
 * @returns {ShownMode}
 */
export function shownMode(state) {
  if (!state.linked && !state.standby) return 'NO_LINK';
  if (!state.heard || state.status === null) return 'NO_WORD';
  return state.status.mode;
}

/**
 * What is left until RAMP, if it counts down.
 * @param {State} state
 * @returns {{ seconds: number, share: number } | null} Whole seconds, and the share of what there was.
 */
export function untilRamp(state) {
  const ms = state.heard && state.linked ? state.status?.until_ramp_ms ?? null : null;
  if (ms === null) return null;
  return { seconds: Math.ceil(ms / 1000), share: state.leftOfMs > 0 ? Math.min(1, ms / state.leftOfMs) : 0 };
}

/**
 * Whether the robot follows again without another press. The server does not know yet of one that was just made.
 * @param {State} state
 */
export function goesOn(state) {
  return state.held && (state.status?.resumes === true || state.press !== state.pressAtMode);
}

/**
 * What the page says of its holder.
 * @param {State} state
 * @returns {Touch}
 */
export function touchOf(state) {
  return { held: state.held, visible: state.visible, press: state.press, nonce: state.nonce };
}

/**
 * What the button beside STOP does now, and whether it may.
 * @param {State} state
 * @returns {{ what: 'arm' | 'disarm', enabled: boolean }}
 */
export function requestOf(state) {
  const mode = shownMode(state);
  if (state.standby) return { what: 'arm', enabled: false };
  if (mode === 'ARMED' || mode === 'TRACK' || mode === 'COAST' || mode === 'HOLD') return { what: 'disarm', enabled: true };
  const ready = mode === 'DISARMED' && state.status?.ready === true;
  return { what: 'arm', enabled: ready && !state.held };
}
