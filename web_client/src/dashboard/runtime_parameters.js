/** The virtual camera's knobs: what a slider's place means, and what is shown while a request is on its way. */

/** @import {RuntimeParameters, Tune, VirtualCameraStatus} from '../wire/protocol_types.js' */

import { Elements } from './elements.js';
import { number } from './format.js';
import { say } from '../words/say.js';

const SLOWEST_HZ = 0.03;
const DECADES = 2;
const HZ_STEPS = 200;
/** Beyond this place the slider of the speed limit says: none. */
const FASTEST_M_S = 5;
const LIMIT_STEP = 0.1;
/** Of a knob that is still being turned, only the last value is sent [ms]. */
const SETTLE_MS = 200;
/** A request that did not come true by then is forgotten, and what stands is shown again [ms]. */
export const PATIENCE_MS = 1500;

const NOTHING = { cutoff_hz: null, mode: null, adaptive_beta: null, max_speed_m_s: null, guard: null };

/**
 * Cut-off of a slider's place, three digits: equal steps are equal ratios.
 * @param {number} place
 */
export function hzOf(place) {
  return Number((SLOWEST_HZ * 10 ** ((DECADES * place) / HZ_STEPS)).toPrecision(3));
}

/** @param {number} hz */
export function placeOfHz(hz) {
  return Math.round((HZ_STEPS * Math.log10(hz / SLOWEST_HZ)) / DECADES);
}

/**
 * Speed limit of a slider's place: to the right it is looser, at the end there is none (0 on the wire).
 * @param {number} place
 */
export function limitOf(place) {
  const limit = Number((place * LIMIT_STEP).toFixed(1));
  return limit > FASTEST_M_S ? 0 : limit;
}

/** @param {number} limit [m/s] */
export function placeOfLimit(limit) {
  return Math.round((limit === 0 ? FASTEST_M_S + LIMIT_STEP : limit) / LIMIT_STEP);
}

/**
 * What a person reads beside each knob.
 * @param {RuntimeParameters} knobs
 */
export function words(knobs) {
  const { cutoff_hz, adaptive_beta, max_speed_m_s } = knobs;
  return {
    cutoff: `${number(cutoff_hz, cutoff_hz < 0.1 ? 3 : 2)} Hz`,
    adaptive: adaptive_beta === 0 ? 'off' : `+${number(adaptive_beta, 1)} Hz/(rad/s)`,
    limit: max_speed_m_s === 0 ? 'no limit' : `${number(max_speed_m_s, 1)} m/s`,
  };
}

/** Requests under way: shown in place of what stands, until they stand or patience ends. */
export class PendingTunes {
  constructor() {
    /** @type {Map<string, { value: unknown, atMs: number, sent: boolean }>} */
    this.pending = new Map();
  }

  /**
   * @param {Partial<RuntimeParameters>} change
   * @param {number} now [ms]
   */
  turn(change, now) {
    for (const [name, value] of Object.entries(change)) this.pending.set(name, { value, atMs: now, sent: false });
  }

  /**
   * What to send now, or null.
   * @param {number} now [ms]
   * @returns {Tune | null}
   */
  due(now) {
    const settled = [...this.pending].filter(([, tune]) => !tune.sent && now - tune.atMs >= SETTLE_MS);
    if (settled.length === 0) return null;
    for (const [, tune] of settled) Object.assign(tune, { sent: true, atMs: now });
    return { ...NOTHING, ...Object.fromEntries(settled.map(([name, { value }]) => [name, value])), type: 'tune' };
  }

  /**
   * The knobs to show, and those requests forgotten that came true or never will.
   * @param {RuntimeParameters} standing
   * @param {number} now [ms]
   * @returns {RuntimeParameters}
   */
  over(standing, now) {
    const shown = /** @type {Record<string, unknown>} */ ({ ...standing });
    for (const [name, { value, atMs, sent }] of this.pending) {
      const done = sent && (shown[name] === value || now - atMs > PATIENCE_MS);
      if (done) this.pending.delete(name);
      else shown[name] = value;
    }
    return /** @type {RuntimeParameters} */ (/** @type {unknown} */ (shown));
  }
}

export class KnobPanel extends Elements {
  /**
   * @param {Document} document
   * @param {(tune: Tune) => void} send
   * @param {() => number} now [ms]
   */
  constructor(document, send, now) {
    super(document);
    this.send = send;
    this.now = now;
    this.tunes = new PendingTunes();
    /** @type {RuntimeParameters | null} */
    this.standing = null;
    this.listen('knob-mode', (input) => ({ mode: /** @type {RuntimeParameters['mode']} */ (input.value) }));
    this.listen('knob-cutoff', (input) => ({ cutoff_hz: hzOf(Number(input.value)) }));
    this.listen('knob-adaptive', (input) => ({ adaptive_beta: Number(input.value) }));
    this.listen('knob-limit', (input) => ({ max_speed_m_s: limitOf(Number(input.value)) }));
    this.listen('knob-guard', (input) => ({ guard: input.checked }));
  }

  /**
   * @param {string} id
   * @param {(input: HTMLInputElement) => Partial<RuntimeParameters>} changeOf
   */
  listen(id, changeOf) {
    this.input(id).addEventListener('input', () => {
      this.tunes.turn(changeOf(this.input(id)), this.now());
      this.render();
    });
  }

  /** @param {string} id */
  input(id) {
    return /** @type {HTMLInputElement} */ (this.find(id));
  }

  /** @param {VirtualCameraStatus | null} camera What control says of it; null: nothing. */
  take(camera) {
    this.standing = camera?.knobs ?? null;
    const lag = `lag ${number(camera?.lag_deg, 1)}°`;
    this.text('knob-state', camera !== null && camera.guarding > 0.05 ? `${lag} · hurrying` : lag);
    this.render();
  }

  /** Sends what has settled; call it now and then. */
  tick() {
    const tune = this.tunes.due(this.now());
    if (tune !== null) this.send(tune);
  }

  render() {
    /** @type {HTMLFieldSetElement} */ (this.find('knobs')).disabled = this.standing === null;
    if (this.standing === null) return;
    const knobs = this.tunes.over(this.standing, this.now());
    const { cutoff, adaptive, limit } = words(knobs);
    this.place('knob-mode', knobs.mode);
    this.place('knob-cutoff', String(placeOfHz(knobs.cutoff_hz)), cutoff);
    this.place('knob-adaptive', String(knobs.adaptive_beta), adaptive);
    this.place('knob-limit', String(placeOfLimit(knobs.max_speed_m_s)), limit);
    this.input('knob-guard').checked = knobs.guard;
    this.text('cutoff', cutoff);
    this.text('adaptive', adaptive);
    this.text('limit', limit);
    this.input('knob-cutoff').disabled = this.input('knob-adaptive').disabled = knobs.mode === 'off';
  }

  /**
   * @param {string} id
   * @param {string} value
   * @param {string} words What is read out.
   */
  place(id, value, words = '') {
    const input = this.input(id);
    const said = say(words);
    if (input.value !== value) input.value = value;
    if (said !== '' && input.getAttribute('aria-valuetext') !== said) input.setAttribute('aria-valuetext', said);
  }
}
