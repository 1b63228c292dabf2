/** From an opened page to a phone that is known, allowed its sensors, and connected. */

/** @import {StartSurroundings} from './phone_types.js' */

import { USUAL, deviceName } from '../camera/camera.js';
import { stayAwake } from '../ui/display.js';
import { requestMotionPermission } from '../motion/imu.js';
import { becomeKnown, exclusion, tokenOf } from '../wire/pairing.js';
import { Problem, problemOf } from '../wire/problems.js';

export class Start {
  /** @param {StartSurroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    /** When the motion sensors were begun; not yet: Infinity [ms]. */
    this.startedAtMs = Infinity;
  }

  /** The page is open: what would be in the way of a tap is told at once. */
  async arrive() {
    const { window } = this.surroundings;
    const hasLink = tokenOf(window.location.hash) !== '';
    this.surroundings.pairing.askName(hasLink);
    if (!window.isSecureContext) this.refuse(new Problem('insecure'));
    else if (hasLink || !(await this.checkPairing())) this.step('');
  }

  /** Everything a tap starts; what fails is told with the way to mend it. */
  async begin() {
    const { window, dispatch, identity, feedback, camera } = this.surroundings;
    const motionAllowed = requestMotionPermission(window); // must come first: it needs the tap itself
    motionAllowed.catch(() => {}); // awaited below
    feedback.unlock();
    dispatch({ type: 'start' });
    try {
      this.step('Pairing with the server…');
      await this.pair();
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

  /** Comes back when this phone may lead. */
  async pair() {
    const { window, fetchHere, pairing, choice } = this.surroundings;
    try {
      const role = await becomeKnown({
        fetch: fetchHere,
        window,
        name: pairing.name,
        onWaiting: ({ code }) => {
          pairing.show(code);
          this.step('Waiting for a supervisor to confirm…');
        },
        onLess: (less) => choice.ask(less),
        later: (callback, ms) => window.setTimeout(callback, ms),
      });
      if (role === null) throw new Problem('not_paired');
      this.surroundings.dispatch({ type: 'paired' });
      if (role === 'viewer') throw new Problem('wrong_role');
    } finally {
      pairing.hide();
    }
  }

  /** Tells, and gives true, if the server does not know this phone, or not any more. */
  async checkPairing() {
    const problem = await exclusion(this.surroundings.fetchHere);
    if (problem !== null) this.refuse(problem);
    return problem !== null;
  }

  /** @param {Problem} problem */
  refuse(problem) {
    this.surroundings.dispatch({ type: 'problem', problem });
  }

  /** @param {string} text */
  step(text) {
    this.surroundings.dispatch({ type: 'step', text });
  }
}
