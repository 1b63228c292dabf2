/** What the estimator and the phone's camera say of themselves: numbers, and in words what should worry. */

/** @import {CameraHealth, Estimate} from '../wire/protocol_types.js' */
/** @import {Board, Sample} from './model.js' */

import { Elements } from './elements.js';
import { number, signed } from './format.js';

/** NIS per degree of freedom beyond which the estimate is surer, or less sure, than it should be. */
const HONEST = { least: 0.5, most: 2 };
/** Samples of the history over which rejected LEDs are counted: two seconds. */
const LATELY = 20;
/** So many of them lately are more than chance: of good ones, the gate refuses one in a thousand. */
const RISING = 5;

/** @typedef {'camera' | 'nis' | 'rejected' | 'complaint'} Worry */

/**
 * LEDs rejected lately; 0 if the count began anew.
 * @param {readonly Sample[]} history
 */
export function rejectedLately(history) {
  const counts = history.slice(-LATELY - 1).map((sample) => sample.rejected);
  return Math.max(0, (counts.at(-1) ?? 0) - (counts.find((count) => count !== null) ?? 0));
}

/**
 * What should worry, in words, the worst first.
 * @param {Estimate} estimate
 * @param {readonly Sample[]} history
 * @param {CameraHealth | null} camera
 * @returns {Map<Worry, string>}
 */
export function worries({ complaint, nis }, history, camera = null) {
  /** @type {Map<Worry, string>} */
  const found = new Map();
  if (camera?.complaint) found.set('camera', camera.complaint);
  else if (camera?.advice) found.set('camera', camera.advice);
  if (complaint !== '') found.set('complaint', complaint);
  if (nis !== null && nis > HONEST.most) found.set('nis', 'Pictures surprise it: it knows less than it says.');
  if (nis !== null && nis < HONEST.least) found.set('nis', 'Pictures fit too well: it knows more than it says.');
  const rejected = rejectedLately(history);
  if (rejected >= RISING) found.set('rejected', `${rejected} lights rejected in 2 s.`);
  return found;
}

export class EstimatePanel extends Elements {
  /** @param {Board} board */
  render({ heard, status, history }) {
    const estimate = heard ? status?.estimate ?? null : null;
    const worry = estimate === null ? new Map() : worries(estimate, history, status?.camera ?? null);
    this.text('estimator', estimate?.name ?? '–');
    this.text('worry', estimate === null ? '' : [...worry.values()].join(' ') || 'All as expected.');
    this.find('worry').className = worry.size > 0 ? 'worry' : 'worry fine';
    this.put('NIS / dof', number(estimate?.nis, 2), '', worry.has('nis'));
    this.put('Age', number(estimate?.age_ms), 'ms');
    this.put('Rejected', number(estimate?.leds_rejected), '', worry.has('rejected'));
    this.put('Fused', number(estimate?.fused), '');
    this.put('Dropped', number(estimate?.dropped), '');
    this.put('Late', number(estimate?.late), '');
    this.put('Offset', signed(estimate?.time_offset_ms, 1), 'ms', worry.has('complaint'));
    this.put('σ offset', number(estimate?.time_offset_sigma_ms, 2), 'ms');
    this.put('σ pos.', number(estimate && status?.sigma_mm, 1), 'mm');
    this.put('σ att.', number(estimate?.sigma_deg, 2), '°');
    this.camera(heard ? status?.camera ?? null : null);
    this.bias('Robot gyro [°/s]', estimate?.bias_body_deg_s);
    this.bias('Robot accel [m/s²]', estimate?.bias_body_m_s2);
    this.bias('Phone gyro [°/s]', estimate?.bias_phone_deg_s);
    this.bias('Phone accel [m/s²]', estimate?.bias_phone_m_s2);
  }

  /** @param {CameraHealth | null} camera */
  camera(camera) {
    const worry = camera !== null && camera.complaint !== '';
    this.put('Readout', number(camera?.readout_ms, 1), 'ms');
    this.put('σ readout', number(camera?.readout_sigma_ms, 1), 'ms');
    this.put('Larger', signed(camera?.larger_percent, 1), '%', worry);
    this.put('Held', signed(camera?.held_percent, 0), '%', worry);
    this.put('Exposed', number(camera?.exposure_ms, 1), 'ms', camera?.hint === 'blurred');
  }

  /**
   * @param {string} name
   * @param {string} value
   * @param {string} unit
   * @param {boolean} worrying
   */
  put(name, value, unit, worrying = false) {
    this.figure('estimate', name, value, unit).classList.toggle('worrying', worrying);
  }

  /**
   * @param {string} name
   * @param {number[] | null | undefined} xyz
   */
  bias(name, xyz) {
    this.figure('biases', name, xyz ? xyz.map((value) => signed(value, 2)).join(' ') : '–', '');
  }
}
