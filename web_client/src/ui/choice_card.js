/** A link that lets this browser do less than it may already: what is given up is asked before, not told after. */

/** @import {Less} from '../wire/pairing_types.js' */

import { write } from '../words/say.js';

const MAY = { viewer: 'watches and may STOP', operator: 'may lead with a phone', supervisor: 'supervises' };

export class ChoiceCard {
  /** @param {Document} document */
  constructor(document) {
    /** @param {string} id */
    const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
    this.find = find;
    this.dialog = /** @type {HTMLDialogElement} */ (find('choice'));
    for (const answer of ['keep', 'take']) find(`choice-${answer}`).addEventListener('click', () => this.dialog.close(answer));
  }

  /**
   * Whether to take the link; who closes the question keeps what he has.
   * @param {Less} less
   * @returns {Promise<boolean>}
   */
  ask({ held, offered, waits }) {
    const condition = waits ? ', once a supervisor has confirmed it' : '';
    write(this.find('choice-title'), `This browser is paired already: it ${MAY[held]}`);
    write(this.find('choice-text'), `With the link that you opened it only ${MAY[offered]}${condition}. `
      + 'One browser has one pairing: if you take the link, the other one ends, and a robot that it leads comes down.');
    write(this.find('choice-keep'), `Keep mine: ${held}`);
    write(this.find('choice-take'), `Take the link: ${offered}`);
    this.dialog.returnValue = 'keep';
    this.dialog.showModal();
    return new Promise((resolve) => {
      this.dialog.addEventListener('close', () => resolve(this.dialog.returnValue === 'take'), { once: true });
    });
  }
}
