/** What a phone shows while it becomes known: a place for a name, then the four letters that a supervisor compares. */

import { usualName } from '../wire/pairing.js';
import { say } from '../words/say.js';

const KEPT = 'lightleash-name';

export class PairingCard {
  /**
   * @param {Document} document
   * @param {{ userAgent: string }} navigator
   * @param {() => Storage} storage May throw where a browser keeps nothing.
   */
  constructor(document, navigator, storage) {
    /** @param {string} id */
    const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
    this.storage = storage;
    this.field = find('name-field');
    this.input = /** @type {HTMLInputElement} */ (find('name'));
    this.card = find('pairing');
    this.letters = find('match');
    this.usual = usualName(navigator.userAgent);
    this.input.placeholder = say(this.usual);
    this.input.value = this.kept();
  }

  /** Of the person, or of the device. */
  get name() {
    const typed = this.input.value.trim();
    try {
      this.storage().setItem(KEPT, typed);
    } catch {
      // It is asked for again.
    }
    return typed || this.usual;
  }

  /** @param {boolean} wanted */
  askName(wanted) {
    this.field.hidden = !wanted;
  }

  /** @param {string} code */
  show(code) {
    this.field.hidden = true;
    this.card.hidden = false;
    if (this.letters.textContent !== code) this.letters.textContent = code;
  }

  hide() {
    this.card.hidden = true;
  }

  kept() {
    try {
      return this.storage().getItem(KEPT) ?? '';
    } catch {
      return '';
    }
  }
}
