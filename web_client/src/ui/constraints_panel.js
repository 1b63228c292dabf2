/** Watches over the camera's settings while operating: one line of advice, a button, no change in flight unasked. */

/** @import {Lens} from '../camera/constraints.js' */
/** @import {Platform} from '../wire/problems.js' */
/** @import {State} from './session_types.js' */
/** @import {Deed, LensWords} from '../camera/constraints_words.js' */

import { stepped } from '../camera/wanted_constraints.js';
import { lackWords, lensWords } from '../camera/constraints_words.js';
import { shownMode } from './session.js';
import { write } from '../words/say.js';

/** Between two changes that nobody tapped for: the server needs a second to judge the last one. */
export const PAUSE_MS = 3000;
/** Unasked changes after each opening of the camera. */
const MOST_STEPS = 12;
/** Focus is left alone: another focus is another focal length. */
const UNASKED = ['too_bright', 'too_dim', 'blurred'];

export class LensPanel {
  /**
   * @param {Document} document
   * @param {Platform} platform
   * @param {{ now(): number }} performance
   * @param {{ settings: Lens | null }} camera
   * @param {(text: string) => void} log
   */
  constructor(document, platform, performance, camera, log) {
    this.platform = platform;
    this.performance = performance;
    this.camera = camera;
    this.log = log;
    this.changedMs = -Infinity;
    this.steps = 0;
    this.busy = false;
    /** Somebody wanted the phone's own exposure. */
    this.automatic = false;
    this.calibrating = false;
    /** @type {Lens | null} */
    this.known = null;
    /** @type {State | null} */
    this.state = null;
    /** @type {Deed[]} */
    this.shown = [];
    /** @param {string} id */
    this.find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
    for (const i of [0, 1]) {
      this.find(`lens-${i}`).addEventListener('click', () => void this.tapped(i));
    }
  }

  /** @param {State} state */
  render(state) {
    this.state = state;
    const lens = this.camera.settings;
    if (lens !== this.known) {
      this.known = lens;
      this.steps = 0;
      this.automatic = false;
    }
    if (lens !== null) this.mind(lens, state);
    this.show(this.words(lens, state));
  }

  /**
   * @param {Lens | null} lens
   * @param {State} state
   */
  words(lens, state) {
    const mode = shownMode(state);
    if (state.calibration !== null || state.status === null || !state.heard) return null;
    const { camera, leds } = state.status;
    const hint = camera?.hint ?? '';
    return lensWords({
      camera,
      mode,
      leds,
      lacks: lens === null ? [] : lackWords(lens.lacks, this.platform),
      steps: lens !== null && stepped(hint, lens.able, lens.is, robotM(state)) !== null,
      manual: lens?.isManual === true,
    });
  }

  /**
   * Changes unasked: only while nothing can fly.
   * @param {Lens} lens
   * @param {State} state
   */
  mind(lens, state) {
    const mode = shownMode(state);
    if (mode !== 'DISARMED' || this.busy || !lens.steadied) return;
    const calibrating = state.calibration !== null && state.calibration.phase === 'filming';
    if (calibrating !== this.calibrating) {
      this.calibrating = calibrating; // screens flicker: a board wants a usual exposure
      if (!this.automatic) void this.change(() => lens.expose(calibrating));
      return;
    }
    const hint = state.status?.camera?.hint ?? '';
    const early = this.performance.now() - this.changedMs < PAUSE_MS;
    if (calibrating || early || this.automatic || this.steps >= MOST_STEPS || !UNASKED.includes(hint)) return;
    this.steps += 1;
    void this.change(() => lens.adjust(hint, null));
  }

  /** @param {number} i Which button. */
  async tapped(i) {
    const lens = this.camera.settings;
    const { state } = this;
    if (lens === null || state === null) return;
    if (this.shown[i] === 'automatic') {
      this.automatic = true;
      await this.change(() => lens.expose(true));
    } else {
      await this.change(() => lens.adjust(state.status?.camera?.hint ?? '', robotM(state)));
    }
  }

  /** @param {() => Promise<unknown>} deed */
  async change(deed) {
    this.busy = true;
    this.changedMs = this.performance.now();
    try {
      await deed();
    } catch (error) {
      this.log(`camera: ${error}`);
    }
    this.busy = false;
  }

  /** @param {LensWords | null} words */
  show(words) {
    const box = this.find('lens');
    box.hidden = words === null;
    if (words === null) return;
    box.dataset.tone = words.tone;
    write(this.find('lens-text'), words.text);
    this.shown = words.deeds.map(({ deed }) => deed);
    for (const i of [0, 1]) {
      const button = this.find(`lens-${i}`);
      button.hidden = words.deeds[i] === undefined;
      write(button, words.deeds[i]?.label ?? '');
    }
  }
}

/**
 * How far the robot is [m].
 * @param {State} state
 */
function robotM(state) {
  const ahead = state.status?.position_mm?.[0];
  return ahead === undefined ? null : 0.001 * ahead;
}
