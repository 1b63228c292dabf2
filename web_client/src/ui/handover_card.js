/** The lead passes from phone to phone: who leads chooses another operator, and that one takes it. */

/** @import {Fetch} from '../wire/pairing.js' */
/** @import {State} from './session_types.js' */

import { isAtRest } from './mode_words.js';
import { ask } from '../wire/pairing.js';
import { shownMode } from './session.js';
import { leadOf } from './standby.js';
import { write } from '../words/say.js';

/** @typedef {{ id: string, name: string }} Other */
/** @typedef {{ phase: 'off' | 'choosing' | 'given' | 'offered', title: string, hint: string, names: Other[], go: string, mayGo: boolean, leave: string }} Card */

/** @type {Card} */
const OFF = Object.freeze({ phase: 'off', title: '', hint: '', names: [], go: '', mayGo: false, leave: '' });

export class HandoverCard {
  /**
   * @param {Document} document
   * @param {Fetch} fetch
   * @param {{ onTake: () => void, tell: (text: string) => void }} handlers
   */
  constructor(document, fetch, { onTake, tell }) {
    this.document = document;
    this.fetch = fetch;
    this.tell = tell;
    this.choosing = false;
    /** To whom this page has given the lead. */
    this.given = '';
    /** @type {State | null} */
    this.state = null;
    this.drawn = '';
    /** @param {string} id */
    this.find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
    this.find('handover-start').addEventListener('click', () => this.choose(true));
    this.find('handover-take').addEventListener('click', onTake);
    this.find('handover-leave').addEventListener('click', () => void this.leave());
  }

  /** @param {boolean} open */
  choose(open) {
    this.choosing = open;
    if (this.state !== null) this.render(this.state);
  }

  /** @param {Other} person */
  async give(person) {
    this.choose(false);
    this.given = person.id;
    await this.post('lead', person.id);
  }

  async leave() {
    if (this.state === null) return;
    const { heir } = leadOf(this.state);
    this.choose(false);
    if (heir !== null) await this.post('keep', heir.id);
  }

  /**
   * @param {'lead' | 'keep'} deed
   * @param {string} id
   */
  async post(deed, id) {
    const fault = await ask(this.fetch, 'POST', `api/people/${deed}`, { id });
    if (fault !== '') this.tell(`Not done: ${fault}`);
  }

  /** @param {State} state Of the page. */
  render(state) {
    this.state = state;
    const may = mayGive(state);
    if (!mayChoose(state)) this.choosing = false;
    const card = cardOf(state, this.choosing, this.given);
    const open = card.phase !== 'off';
    this.find('operate').classList.toggle('handing', open);
    this.find('handover-start').hidden = open || !may;
    for (const id of ['handover', 'handover-leave']) this.find(id).hidden = !open;
    this.find('handover-take').hidden = card.go === '';
    const drawn = JSON.stringify(card);
    if (drawn === this.drawn) return; // a button must not change under a finger
    this.drawn = drawn;
    write(this.find('handover-title'), card.title);
    write(this.find('handover-hint'), card.hint);
    write(this.find('handover-take-title'), card.go);
    /** @type {HTMLButtonElement} */ (this.find('handover-take')).disabled = !card.mayGo;
    write(this.find('handover-leave'), card.leave);
    this.find('handover-people').replaceChildren(...card.names.map((person) => {
      const button = this.document.createElement('button');
      button.textContent = person.name;
      button.className = 'calibrate';
      button.setAttribute('type', 'button');
      button.addEventListener('click', () => void this.give(person));
      return button;
    }));
  }
}

/** Operators whose pages are open. @param {State} state */
function others({ status, you }) {
  return (status?.people ?? []).filter(({ id, role, state, connected }) => id !== you && role === 'operator' && state === 'in' && connected)
    .map(({ id, name }) => ({ id, name })); // what else is known of them changes all the time
}

/** Whether this phone leads, and may hand over. @param {State} state */
export function mayGive(state) {
  return mayChoose(state) && isAtRest(shownMode(state)) && others(state).length > 0;
}

/** Whether a choice that was begun goes on: a moment without word of robot or others ends none. @param {State} state */
export function mayChoose(state) {
  const mode = shownMode(state);
  const free = state.calibration === null || state.calibration.phase === 'needed';
  return state.linked && free && (isAtRest(mode) || mode === 'NO_WORD' || mode === 'LOST');
}

/**
 * @param {State} state
 * @param {boolean} choosing
 * @param {string} given
 * @returns {Card}
 */
export function cardOf(state, choosing, given) {
  if (state.phase !== 'operating') return OFF;
  if (state.linked) {
    return choosing ? { ...OFF, phase: 'choosing', title: 'Hand over to…', leave: 'Cancel', names: others(state),
      hint: 'That phone has half a minute to take the lead. Until then nobody can arm; after it this phone asks for the lead again.' } : OFF;
  }
  const { leader, heir, isMine } = leadOf(state);
  if (!state.standby || !state.heard || heir === null) return OFF;
  if (isMine) {
    return { ...OFF, phase: 'offered', title: 'The lead is kept for you', go: 'Take the lead', mayGo: leader === null, leave: 'No, thanks',
      hint: leader === null ? 'Nobody leads now. Take the lead within half a minute, then arm.' : 'The robot comes down first.' };
  }
  return given === heir.id ? { ...OFF, phase: 'given', title: `Offered to ${heir.name}`, leave: 'Take it back',
    hint: 'Nobody leads until it is taken, and nobody can arm. Not taken within half a minute, this phone asks for the lead again.' } : OFF;
}
