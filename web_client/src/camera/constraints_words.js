/** What the page says of its camera's settings. */

/** @import {CameraHealth} from '../wire/protocol_types.js' */
/** @import {Lack, Settings} from './wanted_constraints.js' */
/** @import {Platform} from '../wire/problems.js' */
/** @import {ShownMode} from '../ui/session_types.js' */

import { isAtRest } from '../ui/mode_words.js';

/** @typedef {'adjust' | 'automatic'} Deed */
/** @typedef {{ tone: 'fault' | 'hint' | 'note', text: string, deeds: { deed: Deed, label: string }[] }} LensWords */

/**
 * What the holder can do about what can't be set.
 * @param {Lack[]} lacks
 * @param {Platform} platform
 * @returns {string[]}
 */
export function lackWords(lacks, platform) {
  return [...new Set(lacks)].map((lack) => LACKS[lack](platform));
}

/** @type {Record<Lack, (platform: Platform) => string>} */
const LACKS = {
  exposure: (platform) => ({
    ios: 'Safari can’t fix the exposure: light the room well, so that pictures are exposed shortly.',
    'firefox-android': 'Firefox can’t fix the exposure: use Chrome, or light the room well.',
    android: 'This phone can’t fix the exposure: light the room well, so that pictures are exposed shortly.',
    desktop: 'This browser can’t fix the exposure: light the room well.',
  })[platform],
  focus: (platform) => ({
    ios: 'Safari can’t fix the focus: keep the robot between 1 and 4 m away, as when calibrating.',
    'firefox-android': 'Firefox can’t fix the focus: use Chrome, or keep the robot 1 to 4 m away.',
    android: 'This phone can’t fix the focus: keep the robot between 1 and 4 m away.',
    desktop: 'This browser can’t fix the focus.',
  })[platform],
  zoom: () => 'The camera is zoomed: choose 1× or another lens.',
  torch: () => 'The phone’s light is on: switch it off.',
};

/** @type {Record<Exclude<CameraHealth['hint'], ''>, string>} */
const ADJUST = { too_bright: 'Darker', too_dim: 'Brighter', blurred: 'Shorter', out_of_focus: 'Focus on robot' };

/** What a person can do where the page can’t set it, or has no step left. */
const BY_HAND = {
  too_bright: 'The LEDs are too bright, and the page can’t expose shorter: dim them, or light the room so that the phone does.',
  too_dim: 'The LEDs are dim, and the page can’t expose longer: come nearer, or brighten them.',
  blurred: 'The picture smears when the phone moves, and the page can’t expose shorter: light the room, and move more slowly.',
  out_of_focus: 'The LEDs are out of focus, and the page can’t set it: hold the robot in the middle until the phone has focused, 1 to 4 m away.',
};

/**
 * The one thing to say of the camera; null: nothing.
 * @param {{ camera: CameraHealth | null, mode: ShownMode, lacks: string[], steps: boolean, manual: boolean, leds: number }} seen
 * @returns {LensWords | null}
 */
export function lensWords({ camera, mode, lacks, steps, manual, leds }) {
  const waiting = isAtRest(mode);
  if (camera?.complaint && !waiting) return { tone: 'fault', text: camera.complaint, deeds: [] };
  if (camera !== null && camera.hint !== '') {
    /** @type {{ deed: Deed, label: string }[]} */
    const deeds = steps ? [{ deed: 'adjust', label: ADJUST[camera.hint] }] : [];
    if (manual && camera.hint === 'too_dim' && !steps) deeds.push({ deed: 'automatic', label: 'Automatic exposure' });
    return { tone: 'hint', text: steps ? camera.advice : BY_HAND[camera.hint], deeds };
  }
  if (waiting && manual && leds === 0) {
    const text = 'No LED found. Is the picture too dark? The page has set a short exposure.';
    return { tone: 'note', text, deeds: [{ deed: 'automatic', label: 'Automatic exposure' }] };
  }
  return waiting && lacks.length > 0 ? { tone: 'note', text: lacks.join(' '), deeds: [] } : null;
}

/**
 * What was really set, in words.
 * @param {Settings} is
 * @returns {string}
 */
export function settingsWords(is) {
  const words = [`${is.width}x${is.height}`, `${Math.round(is.frameRate ?? 0)} fps`];
  if (is.facingMode) words.push(String(is.facingMode));
  if (is.exposureMode) words.push(exposureWords(is));
  if (is.focusMode) words.push(`focus ${is.focusMode}${is.focusDistance > 0 ? ` ${round(is.focusDistance)} m` : ''}`);
  if (is.zoom && is.zoom !== 1) words.push(`zoom ${is.zoom}`);
  if (is.torch) words.push('torch on');
  return words.join(', ');
}

/** @param {Settings} is */
function exposureWords(is) {
  const time = is.exposureTime > 0 ? ` ${round(0.1 * is.exposureTime)} ms` : '';
  return `exposure ${is.exposureMode}${time}${is.iso > 0 ? ` ISO ${Math.round(is.iso)}` : ''}`;
}

/** @param {number} value */
function round(value) {
  return Math.round(10 * value) / 10;
}
