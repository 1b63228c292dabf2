/** How far the robot goes for the hand's way, and along which axes: chosen here, from the next press on. */

/** @import {Lead, LeadingStatus} from '../wire/protocol_types.js' */

import { write } from '../words/say.js';

/** So long a choice is shown that the server has not confirmed. */
export const CHOICE_MS = 1500;
/** What a robot that hangs from nothing can't be led by. */
const PLACED = ['turn', 'level'];

/** @type {Record<Lead['axes'], string>} */
const AXES_WORDS = { all: '', shift: 'turns don’t count', turn: 'turns only', level: 'height kept' };

/**
 * What is not as ever, or "".
 * @param {number} scale
 * @param {Lead['axes']} axes
 */
export function leadWords(scale, axes) {
  return [scale === 1 || axes === 'turn' ? '' : `${scale} × your way`, AXES_WORDS[axes]].filter(Boolean).join(', ');
}

export class LeadingChoice {
  /**
   * @param {Document} document
   * @param {(lead: Lead) => void} send
   * @param {() => number} now [ms]
   */
  constructor(document, send, now) {
    /** @param {string} id */
    const find = (id) => /** @type {HTMLSelectElement} */ (document.getElementById(id));
    this.panel = /** @type {HTMLElement} */ (find('lead'));
    this.scale = find('lead-scale');
    this.axes = find('lead-axes');
    this.document = document;
    this.now = now;
    this.chosenMs = -Infinity;
    for (const select of [this.scale, this.axes]) {
      select.addEventListener('change', () => {
        this.chosenMs = now();
        send({ type: 'lead', scale: Number(this.scale.value), axes: /** @type {Lead['axes']} */ (this.axes.value) });
      });
    }
  }

  /** Where the choice itself is not seen, in short. @param {HTMLSelectElement} select */
  sign(select) {
    const sign = this.document.getElementById(`${select.id}-sign`);
    const words = select === this.axes ? select.value : select.selectedOptions[0]?.text ?? '';
    if (sign !== null) write(sign, words);
  }

  /**
   * @param {LeadingStatus | null} leading As control has it; null: nobody can choose.
   * @param {boolean} locked The button is held: what is chosen now would count only later.
   */
  take(leading, locked) {
    this.panel.hidden = leading === null;
    if (leading === null) return;
    this.scale.disabled = locked || !leading.any;
    this.axes.disabled = locked;
    for (const option of this.axes.options) option.disabled = PLACED.includes(option.value) && !leading.any;
    const is = leading.scale === Number(this.scale.value) && leading.axes === this.axes.value;
    if (is) this.chosenMs = -Infinity;
    else if (this.now() - this.chosenMs > CHOICE_MS) {
      put(this.scale, String(leading.scale));
      put(this.axes, leading.axes);
    }
    for (const select of [this.scale, this.axes]) this.sign(select);
    this.panel.dataset['odd'] = String(this.scale.value !== '1' || this.axes.value !== 'all');
  }
}

/** Show a value, also one that only others offer. @param {HTMLSelectElement} select @param {string} value */
function put(select, value) {
  select.value = value;
  if (select.value === value) return;
  const option = select.ownerDocument.createElement('option');
  option.value = value;
  option.textContent = `× ${value}`;
  select.append(option);
  select.value = value;
}
