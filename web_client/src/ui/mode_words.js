/** What the modes are called and what they mean to a person. */

/** @import {Status} from '../wire/protocol_types.js' */
/** @import {ShownMode} from './session_types.js' */

/** @type {Record<ShownMode, [string, string]>} */
const MODE_WORDS = {
  DISARMED: ['DISARMED', 'Thrusters are off'],
  ARMED: ['ARMED', 'Ready to move'],
  TRACK: ['TRACK', 'The robot follows you'],
  COAST: ['COAST', 'Keeping still for a moment'],
  HOLD: ['HOLD', 'The robot keeps still'],
  RAMP: ['RAMP', 'Thrust fades to zero'],
  STOPPED: ['STOPPED', 'Thrust is off'],
  LOST: ['LOST', 'The control is silent'],
  NO_LINK: ['NO LINK', 'Connecting…'],
  NO_WORD: ['NO WORD', 'The server is silent'],
};

/** Of a robot that follows a velocity by itself: its drives stay on. @type {Partial<Record<ShownMode, string>>} */
const TWIST_MEANINGS = { DISARMED: 'Told to stand still', RAMP: 'It comes to rest', STOPPED: 'Told to stand still' };

/**
 * Whether a robot in this mode rests, as far as is known: it is neither flown nor armed.
 * @param {ShownMode} mode
 */
export function isAtRest(mode) {
  return mode === 'DISARMED' || mode === 'STOPPED';
}

/**
 * What a mode is called, and what it means for the robot that there is.
 * @param {ShownMode} mode
 * @param {Status | null} status
 * @returns {[string, string]}
 */
export function modeWords(mode, status) {
  const [name, meaning] = MODE_WORDS[mode];
  return [name, (status?.takes === 'twist' && TWIST_MEANINGS[mode]) || meaning];
}

/**
 * What comes when a gap lasts too long.
 * @param {number | null} seconds
 * @param {Status | null} status
 */
export function rampWords(seconds, status) {
  if (seconds === null) return '';
  return `${status?.takes === 'twist' ? 'Disarms' : 'Thrust fades'} in ${seconds} s`;
}

/**
 * What is said of a robot that is led to where it can't go.
 * @param {Status | null} status
 */
export function limitWords(status) {
  return status?.at_limit && status.mode === 'TRACK' ? ['At the end of its reach: lead it back.'] : [];
}

/**
 * What a robot tells of itself that people must know, beside what keeps it from being armed.
 * @param {Status | null} status
 */
export function healthWords(status) {
  return (status?.health ?? []).filter((words) => !status?.refusals.includes(words));
}

/**
 * Whether the robot is in the air with an empty battery.
 * @param {ShownMode} mode
 * @param {Status | null} status
 */
export function runsEmpty(mode, status) {
  return status?.battery === 'empty' && ['TRACK', 'COAST', 'HOLD', 'RAMP'].includes(mode);
}

/**
 * The robot's name, and what its battery has.
 * @param {Status | null} status
 */
export function robotWords(status) {
  if (status === null) return '–';
  const { robot, battery, battery_v: volts } = status;
  if (battery === 'untold') return robot;
  return `${robot} · battery ${volts === null ? 'not known' : `${volts.toFixed(1)} V`}`;
}

/** On whose side a silence was. @type {Record<string, string>} */
export const SIDES = { phone: 'phone', robot: 'robot', server: 'computer' };

/**
 * How many gaps there were in the last minute, and on whose side most of them.
 * @param {Status['gaps']} gaps
 */
export function gapWords(gaps) {
  const sides = Object.entries(gaps).sort(([, a], [, b]) => b.count - a.count);
  const total = sides.reduce((sum, [, { count }]) => sum + count, 0);
  const [most] = sides;
  return most === undefined || total === 0 ? '0' : `${total} ${SIDES[most[0]] ?? most[0]}`;
}
