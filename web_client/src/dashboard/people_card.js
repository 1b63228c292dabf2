/** Everybody who is paired: who asks to come in, who leads, and what a supervisor can do about it. */

/** @import {Person} from '../wire/protocol_types.js' */

import { say, write } from '../words/say.js';

/** @typedef {'confirm' | 'deny' | 'revoke' | 'lead'} Deed */

const ROLES = { viewer: 'watches', operator: 'may lead', supervisor: 'supervises' };
/** Between the two taps that shut somebody out [ms]. */
const SURE_MS = 4000;
/** A finger that is down for longer was lifted elsewhere [ms]. */
const PRESS_MS = 2000;

export class PeopleCard {
  /**
   * @param {Document} document
   * @param {(deed: Deed, person: Person) => void} onDeed
   * @param {() => number} now [ms]
   */
  constructor(document, onDeed, now) {
    /** @param {string} id */
    const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
    this.document = document;
    this.onDeed = onDeed;
    this.now = now;
    this.asking = find('asking');
    this.people = find('people');
    this.count = find('people-count');
    this.may = false;
    this.shown = '';
    /** Whom the next tap would shut out, and until when. */
    this.doomed = { id: '', untilMs: -Infinity };
    /** A finger is on the card, until then at most. */
    this.pressedUntilMs = -Infinity;
    for (const list of [this.asking, this.people]) {
      list.addEventListener('pointerdown', () => { this.pressedUntilMs = now() + PRESS_MS; });
    }
    // the click comes after it, before anything else does
    for (const lifted of ['pointerup', 'pointercancel']) {
      document.addEventListener(lifted, () => { this.pressedUntilMs = -Infinity; });
    }
  }

  /**
   * @param {readonly Person[]} people
   * @param {boolean} may Whether this page may decide.
   */
  render(people, may) {
    // who is pressed while he is replaced is not clicked: what is new is shown once the finger is off
    if (this.now() < this.pressedUntilMs) return;
    const doomed = this.now() < this.doomed.untilMs ? this.doomed.id : '';
    const rows = people.map(({ since_s: sinceS, ...rest }) => ({ ...rest, minutes: Math.floor(sinceS / 60) }));
    const shown = JSON.stringify([rows, may, doomed]);
    if (shown === this.shown) return; // a button must not change under a finger
    this.shown = shown;
    this.may = may;
    const waiting = people.filter(({ state }) => state === 'waiting');
    const present = people.filter(({ state }) => state === 'in');
    this.asking.hidden = waiting.length === 0 || !may;
    this.asking.replaceChildren(...waiting.map((person) => this.request(person)));
    this.people.replaceChildren(...present.map((person) => this.row(person, doomed === person.id)));
    write(this.count, `${present.filter(({ connected }) => connected).length} connected`);
  }

  /** @param {Person} person */
  request(person) {
    const row = this.make('li', '');
    const words = this.make('span', '');
    words.append(this.name(person), say(` (${person.address}) asks to lead. Do these letters stand on that phone? `));
    const letters = this.make('strong', '');
    letters.textContent = person.code;
    letters.className = 'match';
    row.append(words, letters, this.button('Confirm', 'confirm', person), this.button('Deny', 'deny', person));
    return row;
  }

  /**
   * @param {Person} person
   * @param {boolean} doomed
   */
  row(person, doomed) {
    const row = this.make('li', '');
    row.classList.toggle('away', !person.connected);
    const name = this.name(person);
    name.className = 'clip';
    const what = person.leads ? 'leads' : person.offered ? 'has the lead offered' : person.connected ? ROLES[person.role] : 'away';
    const words = this.make('span', `${what} · ${since(person.since_s)}`);
    words.className = person.leads ? 'badge good' : 'quiet';
    row.title = `${person.name}, ${say(person.role)}, ${person.address || say('on this computer')}`;
    row.append(name, words);
    if (this.may && person.role === 'operator' && !person.leads) row.append(this.button('Give lead', 'lead', person));
    if (this.may && !person.id.startsWith('local-')) {
      row.append(this.button(doomed ? 'Really?' : 'Revoke', 'revoke', person));
    }
    return row;
  }

  /**
   * @param {string} text
   * @param {Deed} deed
   * @param {Person} person
   */
  button(text, deed, person) {
    const button = this.make('button', text);
    button.className = `button slim ${deed}`;
    button.setAttribute('type', 'button');
    button.setAttribute('aria-label', `${say(text)}: ${person.name}`);
    button.addEventListener('click', () => this.press(deed, person));
    return button;
  }

  /**
   * @param {Deed} deed
   * @param {Person} person
   */
  press(deed, person) {
    const now = this.now();
    const sure = deed !== 'revoke' || (this.doomed.id === person.id && now < this.doomed.untilMs);
    this.doomed = sure ? { id: '', untilMs: -Infinity } : { id: person.id, untilMs: now + SURE_MS };
    if (sure) this.onDeed(deed, person);
  }

  /**
   * @param {string} tag
   * @param {string} text
   */
  make(tag, text) {
    const element = this.document.createElement(tag);
    write(element, text);
    return element;
  }

  /** @param {Person} person Called alike in every language. */
  name(person) {
    const element = this.make('b', '');
    element.textContent = person.name;
    return element;
  }
}

/** @param {number} seconds */
export function since(seconds) {
  if (seconds < 60) return 'now';
  const minutes = Math.floor(seconds / 60);
  return minutes < 60 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}
