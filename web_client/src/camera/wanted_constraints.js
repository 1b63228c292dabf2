/** What an LED wants of a camera's settings: exposed shortly, focused once, not zoomed. */

/** @import {CameraHealth} from '../wire/protocol_types.js' */

/** @typedef {CameraHealth['hint']} Hint */
/** @typedef {{ min: number, max: number, step?: number }} Range */
/** @typedef {Record<string, any>} Settings What `getCapabilities` and `getSettings` say beyond the types. */
/** @typedef {'exposure' | 'focus' | 'zoom' | 'torch'} Lack What the browser or the phone doesn't let us set. */

/** Short enough for 60°/s, long enough for LEDs; `exposureTime` counts 100 µs. */
export const SHORT = 30;
/** Longer is not short any more. */
const LONGEST = 80;
const SHORTEST = 3;
/** A lens that stays still, where nobody said from how far: sharp from arm's length to the far wall [m]. */
const FOCUS_M = 2;
/** How much brighter or darker a step makes. */
const STEP = 1.6;
/** What is read back may differ so much from what was asked for. */
const ALIKE = 0.25;

/**
 * @param {any} range
 * @returns {range is Range}
 */
function isRange(range) {
  return typeof range?.min === 'number' && range.max > range.min;
}

/**
 * The nearest value the camera has.
 * @param {Range} range
 * @param {number} value
 */
export function within({ min, max, step }, value) {
  const stepped = step !== undefined && step > 0 ? min + Math.round((value - min) / step) * step : value;
  return Math.min(Math.max(stepped, min), max);
}

/** @param {Settings} able */
export function canExpose(able) {
  return Boolean(able.exposureMode?.includes('manual')) && isRange(able.exposureTime)
    && able.exposureTime.min <= LONGEST;
}

/**
 * The settings an LED wants, as far as this camera has them.
 * @param {Settings} able
 * @param {Settings} is
 * @param {number} [robotM] From which the robot is filmed: one on a screen is far nearer than one that hangs.
 * @returns {{ wish: Settings, lacks: Lack[] }}
 */
export function wished(able, is, robotM = FOCUS_M) {
  /** @type {Lack[]} */
  const lacks = [];
  /** @type {Settings} */
  const wish = {};
  if (canExpose(able)) Object.assign(wish, shortly(able, is));
  else lacks.push('exposure');
  if (!canExpose(able) && isRange(able.exposureCompensation)) {
    wish.exposureCompensation = within(able.exposureCompensation, -1);
  }
  if (able.focusMode?.includes('manual') && isRange(able.focusDistance)) {
    wish.focusMode = 'manual';
    wish.focusDistance = within(able.focusDistance, robotM);
  } else if (!(able.focusMode?.length === 1 && able.focusMode[0] === 'fixed')) {
    lacks.push('focus');
  }
  if (isRange(able.zoom) && is.zoom !== 1) wish.zoom = within(able.zoom, 1);
  if (is.torch === true) wish.torch = false;
  return { wish, lacks };
}

/**
 * A short exposure, as sensitive as the camera was before.
 * @param {Settings} able
 * @param {Settings} is
 * @returns {Settings}
 */
export function shortly(able, is) {
  /** @type {Settings} */
  const wish = { exposureMode: 'manual', exposureTime: within(able.exposureTime, SHORT) };
  if (isRange(able.iso)) wish.iso = within(able.iso, is.iso > 0 ? is.iso : 4 * able.iso.min);
  return wish;
}

/**
 * One step towards what a hint asks for; null if there is none left.
 * @param {Hint} hint
 * @param {Settings} able
 * @param {Settings} is
 * @param {number | null} robotM How far the robot is.
 * @returns {Settings | null}
 */
export function stepped(hint, able, is, robotM) {
  if (hint === 'out_of_focus') {
    if (!able.focusMode?.includes('manual') || !isRange(able.focusDistance) || robotM === null) return null;
    const focusDistance = within(able.focusDistance, robotM);
    return close(focusDistance, is.focusDistance) ? null : { focusMode: 'manual', focusDistance };
  }
  if (!canExpose(able) || hint === '') return null;
  const time = within(able.exposureTime, is.exposureTime ?? SHORT);
  const iso = isRange(able.iso) ? within(able.iso, is.iso ?? able.iso.min) : null;
  const next = hint === 'too_dim' ? brighter(able, time, iso) : darker(able, time, iso, hint === 'blurred');
  const same = close(next.exposureTime, is.exposureTime) && (next.iso === undefined || close(next.iso, is.iso));
  return same && is.exposureMode === 'manual' ? null : { exposureMode: 'manual', ...next };
}

/**
 * More sensitive first: that smears nothing.
 * @param {Settings} able
 * @param {number} time
 * @param {number | null} iso
 * @returns {{ exposureTime: number, iso?: number }}
 */
function brighter(able, time, iso) {
  if (iso !== null && iso < able.iso.max) {
    return { exposureTime: time, iso: within(able.iso, Math.max(iso + 1, iso * STEP)) };
  }
  const exposureTime = within(able.exposureTime, Math.min(time * STEP, LONGEST));
  return iso === null ? { exposureTime } : { exposureTime, iso };
}

/**
 * Shorter first: that smears less.
 * @param {Settings} able
 * @param {number} time
 * @param {number | null} iso
 * @param {boolean} keeps As bright as before.
 * @returns {{ exposureTime: number, iso?: number }}
 */
function darker(able, time, iso, keeps) {
  const shortest = Math.max(able.exposureTime.min, SHORTEST);
  const exposureTime = within(able.exposureTime, Math.max(time / STEP, shortest));
  if (iso === null) return { exposureTime };
  if (keeps) return { exposureTime, iso: within(able.iso, iso * (time / exposureTime)) };
  return { exposureTime, iso: exposureTime < time ? iso : within(able.iso, iso / STEP) };
}

/**
 * @param {number} a
 * @param {number | undefined} b
 */
function close(a, b) {
  return b !== undefined && Math.abs(a - b) <= 0.02 * Math.abs(a);
}

/**
 * What was asked for and isn't so.
 * @param {Settings} wish
 * @param {Settings} is
 * @returns {Lack[]}
 */
export function refusedOf(wish, is) {
  /** @type {Lack[]} */
  const refused = [];
  /** @param {string} key */
  const differs = (key) => is[key] !== undefined && Math.abs(is[key] - wish[key]) > ALIKE * Math.abs(wish[key]);
  if (wish.exposureMode !== undefined && (is.exposureMode !== 'manual' || differs('exposureTime'))) {
    refused.push('exposure');
  }
  if (wish.focusMode !== undefined && is.focusMode !== 'manual') refused.push('focus');
  if (wish.zoom !== undefined && differs('zoom')) refused.push('zoom');
  if (wish.torch === false && is.torch === true) refused.push('torch');
  return refused;
}
