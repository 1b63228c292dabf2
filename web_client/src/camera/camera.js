/** The rear camera: opened, and held to the wanted picture. */

import { Problem } from '../wire/problems.js';

/**
 * @typedef {object} Wanted
 * @property {number} width Of the picture with the phone in its side [px].
 * @property {number} height
 * @property {number} frame_rate_hz
 * @property {number} [distance_m] From which the robot is filmed.
 */

/** Asked for before the server has said what it wants. */
export const USUAL = Object.freeze({ width: 1280, height: 720, frame_rate_hz: 30 });

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
 * Holds an open camera to the picture the server wants.
 * @param {MediaStreamTrack} track
 * @param {Wanted} wanted
 */
export async function settleCamera(track, wanted) {
  if (isSettled(track.getSettings(), wanted)) return; // asking again would undo what the lens was told
  try {
    await track.applyConstraints(cameraConstraints(wanted, 'exact'));
  } catch {
    await track.applyConstraints(cameraConstraints(wanted, 'ideal')).catch(() => {});
  }
}

/**
 * @param {MediaTrackSettings} is
 * @param {Wanted} wanted
 */
function isSettled(is, wanted) {
  const isSize = (is.width === wanted.width && is.height === wanted.height)
    || (is.width === wanted.height && is.height === wanted.width); // held upright
  return isSize && Math.abs((is.frameRate ?? 0) - wanted.frame_rate_hz) < 1;
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
