/** The rear camera: opened, held to the wanted picture, and told to leave its lens alone. */

import { Problem } from './problems.js';

/**
 * @typedef {object} Wanted
 * @property {number} width Of the picture with the phone in its side [px].
 * @property {number} height
 * @property {number} frame_rate_hz
 */

/** Asked for before the server has said what it wants. */
export const USUAL = Object.freeze({ width: 1280, height: 720, frame_rate_hz: 30 });

/** Where a lens that stays still is set: sharp from arm's length to the far wall [m]. */
const FOCUS_M = 2;

/**
 * @param {Wanted} wanted
 * @param {'ideal' | 'exact'} firmness
 * @returns {MediaTrackConstraints}
 */
export function cameraConstraints(wanted, firmness) {
  return {
    facingMode: { ideal: 'environment' },
    width: { [firmness]: wanted.width },
    height: { [firmness]: wanted.height },
    frameRate: { ideal: wanted.frame_rate_hz, max: Math.max(60, wanted.frame_rate_hz) },
  };
}

/**
 * Opens the rear camera; asks for permission where needed.
 * @param {MediaDevices | undefined} mediaDevices
 * @returns {Promise<MediaStream>}
 */
export async function openCamera(mediaDevices) {
  if (mediaDevices?.getUserMedia === undefined) throw new Problem('camera_missing');
  try {
    return await mediaDevices.getUserMedia({ audio: false, video: cameraConstraints(USUAL, 'ideal') });
  } catch (error) {
    throw cameraProblem(error);
  }
}

/**
 * @param {unknown} error Of getUserMedia.
 * @returns {Problem}
 */
export function cameraProblem(error) {
  const name = error instanceof Error || error instanceof DOMException ? error.name : '';
  const detail = `${name} ${error instanceof Error ? error.message : ''}`.trim();
  if (name === 'NotAllowedError' || name === 'SecurityError') return new Problem('camera_denied', detail);
  if (name === 'NotFoundError' || name === 'OverconstrainedError') {
    return new Problem('camera_absent', detail);
  }
  return new Problem('camera_busy', detail);
}

/**
 * Holds an open camera to the picture the server wants, and its lens to one focus where the phone allows
 * that: a moving lens changes the focal length.
 * @param {MediaStreamTrack} track
 * @param {Wanted} wanted
 * @returns {Promise<string>} What the camera settled on, in words.
 */
export async function settleCamera(track, wanted) {
  try {
    await track.applyConstraints(cameraConstraints(wanted, 'exact'));
  } catch {
    await track.applyConstraints(cameraConstraints(wanted, 'ideal')).catch(() => {});
  }
  await fixFocus(track).catch(() => {}); // a wish: autofocus works, only less steadily
  return cameraWords(track);
}

/** @param {MediaStreamTrack} track */
async function fixFocus(track) {
  /** @type {Record<string, any>} */
  const able = track.getCapabilities?.() ?? {};
  const distance = able.focusDistance;
  if (!able.focusMode?.includes('manual') || !(distance?.max > distance?.min)) return;
  const focusDistance = Math.min(Math.max(FOCUS_M, distance.min), distance.max);
  const focus = /** @type {MediaTrackConstraintSet} */ ({ focusMode: 'manual', focusDistance });
  await track.applyConstraints({ ...track.getConstraints(), advanced: [focus] });
}

/**
 * @param {MediaStreamTrack} track
 * @returns {string}
 */
export function cameraWords(track) {
  /** @type {Record<string, any>} */
  const is = track.getSettings();
  const words = [`${is.width}x${is.height}`, `${Math.round(is.frameRate ?? 0)} fps`];
  if (is.facingMode) words.push(String(is.facingMode));
  if (is.focusMode) words.push(`focus ${is.focusMode}`);
  if (is.zoom && is.zoom !== 1) words.push(`zoom ${is.zoom}`);
  return words.join(', ');
}

/**
 * Names what has one calibration: the kind of phone and its lens.
 * @param {{ userAgent: string, userAgentData?: any }} navigator
 * @param {{ width: number, height: number }} screen
 * @param {number} pixelRatio
 * @param {string} lens Label of the camera's track.
 * @returns {Promise<string>} At most 200 characters.
 */
export async function deviceName(navigator, screen, pixelRatio, lens) {
  const size = [screen.width, screen.height].sort((a, b) => a - b).join('x');
  const model = (await modelOf(navigator)) || `${systemOf(navigator.userAgent)} ${size}@${pixelRatio}`;
  return `${model} / ${lens || 'camera'}`.slice(0, 200);
}

/** @param {{ userAgentData?: any }} navigator */
async function modelOf(navigator) {
  try {
    const values = await navigator.userAgentData?.getHighEntropyValues(['model']);
    return String(values?.model ?? '').trim();
  } catch {
    return '';
  }
}

/** @param {string} agent */
function systemOf(agent) {
  return /iPhone|iPad|Android|Macintosh|Windows|Linux/.exec(agent)?.[0] ?? 'device';
}
