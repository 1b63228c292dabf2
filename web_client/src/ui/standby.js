/** A phone that does not lead: what it knows of who does, and the link by which it watches meanwhile. */

/** @import {Command, Person, Welcome} from '../wire/protocol_types.js' */
/** @import {Surroundings} from '../wire/link.js' */
/** @import {Event, State} from './session_types.js' */

import { Link, socketUrl } from '../wire/link.js';
import { VERSION } from '../wire/protocol.js';

/** Nobody has led for so long: who lost his link for a moment has it back before somebody asks [ms]. */
export const FREE_MS = 2500;
/** Who led last asks sooner: nobody else snatches a lead that was offered and not taken [ms]. */
export const AGAIN_MS = 500;

/**
 * Who leads, and for whom the lead is kept, as this phone's page sees it.
 * @param {State} state
 * @returns {{ leader: Person | null, heir: Person | null, isMine: boolean }}
 */
export function leadOf({ status, you }) {
  const people = status?.people ?? [];
  const heir = people.find(({ offered }) => offered) ?? null;
  return { leader: people.find(({ leads }) => leads) ?? null, heir, isMine: heir !== null && heir.id === you };
}

/** Whether this phone may ask for the lead unbidden. @param {State} state */
export function isFree(state) {
  const { leader, heir } = leadOf(state);
  return state.heard && heir === null && (leader === null || leader.id === state.you);
}

/** Whether somebody else leads. @param {State} state */
export function isLed(state) {
  const { leader } = leadOf(state);
  return state.heard && leader !== null && leader.id !== state.you;
}

/** Why this phone does not lead. @param {State} state */
export function standbyWords(state) {
  const { leader, heir, isMine } = leadOf(state);
  if (!state.heard) return 'This phone does not lead: it waits for word from the server.';
  if (isMine) return 'The lead is kept for you.';
  if (heir !== null) return `The lead is kept for ${heir.name}.`;
  if (leader === null) return 'Nobody leads: this phone asks for it.';
  if (leader.id === state.you) return 'Another page of this browser leads. This one asks for the lead when that one is closed.';
  return `${leader.name} leads. This phone asks for the lead when ${leader.name} has left.`;
}

export class Watch {
  /**
   * @param {object} parts
   * @param {string} parts.base Address of the page.
   * @param {Surroundings} parts.links
   * @param {{ now(): number }} parts.clock
   * @param {{ heard(timeMs: number): void }} parts.serverTime
   * @param {(event: Event) => void} parts.dispatch
   * @param {() => void} parts.onUnwelcome
   */
  constructor({ base, links, clock, serverTime, dispatch, onUnwelcome }) {
    this.isOpen = false;
    this.link = new Link(socketUrl('ws/supervisor', base), {
      onOpen: () => {
        this.link.sendMessage({
          type: 'hello', version: VERSION, role: 'supervisor', device: '', session: '', sensors: '', video: '',
        });
      },
      onMessage: (message) => {
        if (message.type === 'welcome') dispatch({ type: 'watching', you: message.you });
        if (message.type !== 'status') return;
        serverTime.heard(message.time_ms);
        dispatch({ type: 'status', status: message, now: clock.now() });
      },
      onRecord: () => {},
      onClose: (wasWelcome) => {
        if (!wasWelcome) onUnwelcome();
      },
    }, links);
  }

  open() {
    if (this.isOpen) return;
    this.isOpen = true;
    this.link.open();
  }

  close() {
    this.isOpen = false;
    this.link.close();
  }

  /** @param {Command} command */
  send(command) {
    if (this.isOpen) this.link.sendMessage(command);
  }
}
