/** What a page and its server tell each other of who is paired. */

/** @import {Fetch, Role} from './pairing.js' */

/**
 * How the server sees this browser.
 * @typedef {object} Standing
 * @property {Role} role
 * @property {'waiting' | 'in' | 'denied' | 'revoked' | 'expired'} state
 * @property {string} name
 * @property {string} code Four letters while a supervisor has to confirm.
 * @property {string} why Why the pairing has ended.
 */

/**
 * What a link would take from this browser; it stays good until it is taken.
 * @typedef {object} Less
 * @property {Role} held What the browser is paired as.
 * @property {Role} offered What the link makes it.
 * @property {boolean} waits Until a supervisor has confirmed it.
 */

/**
 * @typedef {object} Arrival
 * @property {Fetch} fetch
 * @property {{ location: Location, history: History }} window
 * @property {string} name Of the person.
 * @property {(standing: Standing) => void} onWaiting A supervisor has to confirm; called again and again.
 * @property {(less: Less) => Promise<boolean>} onLess Whether to take a link that gives less than this browser has.
 * @property {(callback: () => void, ms: number) => unknown} later
 */

export {};
