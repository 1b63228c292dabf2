/** Numbers for people: of one width, with a dash for what is not known. */

import { SIDES } from '../ui/mode_words.js';

/**
 * @param {number | null | undefined} value
 * @param {number} decimals
 */
export function number(value, decimals = 0) {
  return value === null || value === undefined || !Number.isFinite(value) ? '–' : value.toFixed(decimals);
}

/**
 * A number that may be on either side of zero, with a sign as wide as the other.
 * @param {number | null | undefined} value
 * @param {number} decimals
 */
export function signed(value, decimals = 0) {
  const text = number(value, decimals);
  if (text === '–') return text;
  return text.startsWith('-') ? text.replace('-', '−') : `+${text}`;
}

/**
 * A span of time in the unit that reads best.
 * @param {number | null} ms
 */
export function age(ms) {
  if (ms === null) return '–';
  return ms < 10_000 ? `${Math.round(ms)} ms` : `${Math.round(ms / 1000)} s`;
}

/**
 * As the clock on the wall shows it.
 * @param {number} unixMs
 */
export function timeOfDay(unixMs) {
  return new Date(unixMs).toLocaleTimeString([], { hour: '2-digit', minute: '2-digit', second: '2-digit', hour12: false });
}

/**
 * How worrying an age is, by the timers of the failsafe machine.
 * @param {number | null} ms
 * @returns {'' | 'warn' | 'bad'}
 */
export function alarm(ms) {
  if (ms === null || ms >= 150) return 'bad';
  return ms >= 60 ? 'warn' : '';
}

/**
 * Length of a vector given in mm [m].
 * @param {number[] | null} mm
 */
export function metres(mm) {
  return mm === null ? null : Math.hypot(...mm) / 1000;
}

/**
 * The end of a scale for a total: one of a few, so that bars don't breathe.
 * @param {number} totalMs
 */
export function scaleEnd(totalMs) {
  return [100, 200, 400, 800, 1600, 3200].find((end) => totalMs <= end) ?? totalMs;
}

/**
 * Gaps of the last minute by side, the longest of each behind it.
 * @param {import('../wire/protocol_types.js').Status['gaps']} gaps
 */
export function gapLine(gaps) {
  const sides = Object.entries(gaps).map(([side, { count, longest_ms: longest }]) => {
    const most = count > 0 ? ` (${(longest / 1000).toFixed(2)} s)` : '';
    return `${SIDES[side] ?? side} ${count}${most}`;
  });
  return sides.length > 0 ? `Gaps in the last minute: ${sides.join(' · ')}` : '';
}

/** @type {Record<string, string>} */
const STREAMS = {
  operator: 'Operator', phone_imu: 'Phone motion', video: 'Video', pose: 'Pose', body_imu: 'Robot motion',
  control: 'Control',
};

/** @param {string} name Of a stream on the wire. */
export function streamName(name) {
  return STREAMS[name] ?? name;
}

/** What a monitor of 27 inches has [m]. */
const USUAL_SCREEN_M = 0.34;

/**
 * The way to show the robot on a screen, and how large that must be where a usual one is too small.
 * @param {number} heightM Of the smallest one.
 */
export function screenWords(heightM) {
  return heightM > USUAL_SCREEN_M ? `Robot on a screen ${Math.ceil(100 * heightM)} cm high` : 'Robot on a screen';
}
