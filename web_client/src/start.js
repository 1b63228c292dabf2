/** From an opened page to a phone that is known, allowed its sensors, and connected. */

/** @import {CameraFeed} from './camera_feed.js' */
/** @import {Feedback} from './feedback.js' */
/** @import {Imu} from './imu.js' */
/** @import {Fetch} from './pairing.js' */
/** @import {Phone} from './phone.js' */
/** @import {Event} from './session_types.js' */
/** @import {VideoSender} from './video.js' */

import { USUAL, deviceName } from './camera.js';
import { stayAwake } from './display.js';
import { requestMotionPermission } from './imu.js';
import { becomeKnown, isStranger, tokenOf } from './pairing.js';
import { Problem, problemOf } from './problems.js';

/**
 * @typedef {object} Surroundings
 * @property {Window} window
 * @property {{ now(): number }} performance
 * @property {Fetch} fetchHere
 * @property {(event: Event) => void} dispatch
 * @property {{ device: string, sensors: string, video: string }} identity What the phone says of itself; filled in here.
 * @property {Feedback} feedback
 * @property {CameraFeed} camera
 * @property {VideoSender} video
 * @property {Imu} imu
 * @property {Phone} phone
 */

export class Start {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    /** When the motion sensors were begun; not yet: Infinity [ms]. */
    this.startedAtMs = Infinity;
  }

  /** The page is open: what would be in the way of a tap is told at once. */
  async arrive() {
    const { window } = this.surroundings;
    if (!window.isSecureContext) this.refuse('insecure');
    else if (tokenOf(window.location.hash) !== '' || !(await this.checkPairing())) this.step('');
  }

  /** Everything a tap starts; what fails is told with the way to mend it. */
  async begin() {
    const { window, fetchHere, dispatch, identity, feedback, camera } = this.surroundings;
    const motionAllowed = requestMotionPermission(window); // must come first: it needs the tap itself
    motionAllowed.catch(() => {}); // awaited below
    feedback.unlock();
    dispatch({ type: 'start' });
    try {
      this.step('Pairing with the server…');
      if ((await becomeKnown(fetchHere, window)) === null) throw new Problem('not_paired');
      this.step('Waiting for your permission: motion sensors…');
      await motionAllowed;
      this.step('Waiting for your permission: camera…');
      if (!camera.isLive) await camera.open();
      const { navigator, screen, devicePixelRatio } = window;
      identity.device = await deviceName(navigator, screen, devicePixelRatio, camera.lens);
      await this.connect();
    } catch (error) {
      dispatch({ type: 'problem', problem: problemOf(error) });
    }
  }

  async connect() {
    const { window, performance, dispatch, identity, video, imu, phone } = this.surroundings;
    identity.video = await video.prepare({ ...USUAL, bitrate_bps: 4e6 });
    if (video.encoder === null) throw new Problem('encoder_missing');
    imu.stop();
    imu.start();
    this.startedAtMs = performance.now();
    identity.sensors = imu.source;
    void stayAwake(window.navigator);
    dispatch({ type: 'started' });
    phone.open();
  }

  /** Tells, and gives true, if the server does not know this phone, or not any more. */
  async checkPairing() {
    const { fetchHere } = this.surroundings;
    const isUnknown = await isStranger(fetchHere);
    if (isUnknown) this.refuse('not_paired');
    return isUnknown;
  }

  /** @param {'insecure' | 'not_paired'} code */
  refuse(code) {
    this.surroundings.dispatch({ type: 'problem', problem: new Problem(code) });
  }

  /** @param {string} text */
  step(text) {
    this.surroundings.dispatch({ type: 'step', text });
  }
}
