/** What a person asks for, and how long ago: a link that was away must not carry out an old request. */

/** @import {Command} from './protocol_types.js' */

/** An unanswered request is given up: whoever flies later is somebody else [ms]. */
export const GIVE_UP_MS = 3000;
/** A device that sleeps stops the page's clock; the wall's goes on [ms]. */
const SLEPT_MS = 1000;

/** The page's clock, but that it goes on while the device sleeps. */
export class WakefulClock {
  /**
   * @param {{ now(): number }} performance
   * @param {{ now(): number }} wall
   */
  constructor(performance, wall) {
    this.performance = performance;
    this.wall = wall;
    this.offsetMs = 0;
    this.apartMs = wall.now() - performance.now();
  }

  /** Never goes back [ms]. */
  now() {
    const ms = this.performance.now();
    const apartMs = this.wall.now() - ms;
    if (apartMs - this.apartMs > SLEPT_MS) this.offsetMs += apartMs - this.apartMs;
    this.apartMs = apartMs;
    return ms + this.offsetMs;
  }
}

/**
 * What time it is at the server, as that Status tells which was least late: late by the way of that one, never
 * early. A later one that a slow link held back must not make a STOP look older than it is.
 */
export class ServerTime {
  /** @param {WakefulClock} clock */
  constructor(clock) {
    this.clock = clock;
    /** @type {number | null} */
    this.aheadMs = null;
    this.offsetMs = clock.offsetMs;
  }

  /** @param {number} timeMs Of a Status that has just come. */
  heard(timeMs) {
    const aheadMs = timeMs - this.here();
    this.aheadMs = Math.max(this.aheadMs ?? -Infinity, aheadMs);
  }

  forget() {
    this.aheadMs = null;
  }

  /** [ms], or null while nothing was heard. */
  now() {
    const ms = this.here();
    return this.aheadMs === null ? null : Math.max(0, Math.floor(ms + this.aheadMs));
  }

  /** The page's time; what was known does not outlive a sleep, which is measured by the wall's clock alone. */
  here() {
    const ms = this.clock.now();
    if (this.clock.offsetMs !== this.offsetMs) this.forget();
    this.offsetMs = this.clock.offsetMs;
    return ms;
  }
}

/**
 * @param {Command['what']} what
 * @param {number} ageMs Since the person asked.
 * @param {ServerTime} server
 * @returns {Command}
 */
export function commandOf(what, ageMs, server) {
  return { type: 'command', what, age_ms: Math.max(0, Math.round(ageMs)), server_ms: server.now() };
}
