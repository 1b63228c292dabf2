/** "Check this link": listens for a minute, or less, and asks the server what it will be like to fly with it. */

/** @import {Fetch} from '../wire/pairing.js' */
/** @import {LinkReport} from '../wire/protocol_types.js' */
/** @import {State} from './session_types.js' */

import { isAtRest } from './mode_words.js';
import { refusalOf } from '../wire/pairing.js';
import { shownMode } from './session.js';
import { write } from '../words/say.js';

export const LISTEN_MS = 60_000;
/** Of less the server says nothing. */
export const LEAST_MS = 5000;
const PATIENCE_MS = 5000;
const GRADES = { good: '✓ ', fair: '! ', poor: '✕ ', unknown: '' };

/**
 * @typedef {{ phase: 'off' } | { phase: 'listening', sinceMs: number } | { phase: 'asking' }
 *   | { phase: 'told', report: LinkReport } | { phase: 'failed', why: string }} Check
 */

export class LinkCheck {
  /**
   * @param {Document} document
   * @param {{ now(): number }} performance
   * @param {Fetch} fetch
   */
  constructor(document, performance, fetch) {
    this.document = document;
    this.performance = performance;
    this.fetch = fetch;
    /** @type {Check} */
    this.check = { phase: 'off' };
    /** @type {State | null} */
    this.state = null;
    this.drawn = '';
    /** @param {string} id */
    this.find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
    this.find('link-check-start').addEventListener('click', () => this.begin());
    this.find('link-check-go').addEventListener('click', () => this.go());
    this.find('link-check-leave').addEventListener('click', () => this.end());
  }

  begin() {
    this.check = { phase: 'listening', sinceMs: this.performance.now() };
    this.draw();
  }

  end() {
    this.check = { phase: 'off' };
    this.draw();
  }

  /** The larger button: ends the listening, or begins it again. */
  go() {
    if (this.check.phase === 'listening') void this.ask(this.listenedMs());
    else this.begin();
  }

  /** @param {State} state Of the page; also twice a second while nothing happens. */
  render(state) {
    this.state = state;
    const { check } = this;
    const mode = shownMode(state);
    if (check.phase !== 'off' && (mode === 'NO_LINK' || !state.visible) && check.phase !== 'told') {
      this.check = { phase: 'failed', why: state.visible ? 'The link was lost.' : 'The page was hidden.' };
    } else if (check.phase !== 'off' && !this.mayBegin(state) && mode !== 'NO_LINK' && mode !== 'NO_WORD') {
      this.check = { phase: 'off' }; // somebody armed
    } else if (check.phase === 'listening' && this.listenedMs() >= LISTEN_MS) {
      void this.ask(LISTEN_MS);
    }
    this.draw();
  }

  listenedMs() {
    return this.check.phase === 'listening' ? this.performance.now() - this.check.sinceMs : 0;
  }

  /** @param {State} state */
  mayBegin(state) {
    const mode = shownMode(state);
    return state.linked && (isAtRest(mode) || mode === 'LOST')
      && (state.calibration === null || state.calibration.phase === 'needed');
  }

  /** @param {number} ms */
  async ask(ms) {
    /** @type {Check} */
    const asking = { phase: 'asking' };
    this.check = asking;
    this.draw();
    const check = await this.answer(ms);
    if (this.check !== asking) return;
    this.check = check;
    this.draw();
  }

  /** @param {number} ms @returns {Promise<Check>} */
  async answer(ms) {
    try {
      const seconds = Math.min(LISTEN_MS, ms) / 1000;
      const response = await this.fetch(`api/link?seconds=${seconds}`, {
        credentials: 'same-origin', cache: 'no-store', signal: AbortSignal.timeout(PATIENCE_MS),
      });
      if (!response.ok) return { phase: 'failed', why: await refusalOf(response) };
      return { phase: 'told', report: await response.json() };
    } catch {
      return { phase: 'failed', why: 'The server does not answer.' };
    }
  }

  draw() {
    const { check, state } = this;
    const open = check.phase !== 'off';
    this.find('operate').classList.toggle('checking', open);
    this.find('link-check-start').hidden = open || state === null || !this.mayBegin(state);
    for (const id of ['link-check', 'link-check-go', 'link-check-leave']) this.find(id).hidden = !open;
    const words = wordsOf(check, this.listenedMs());
    const text = JSON.stringify(words);
    if (!open || text === this.drawn) return;
    this.drawn = text;
    this.find('link-check').dataset.grade = check.phase === 'told' ? check.report.grade : '';
    write(this.find('link-check-title'), words.title);
    write(this.find('link-check-hint'), words.hint);
    this.find('link-check-bar').hidden = check.phase !== 'listening';
    /** @type {HTMLProgressElement} */ (this.find('link-check-bar')).value = words.share;
    /** @type {HTMLButtonElement} */ (this.find('link-check-go')).disabled = !words.mayGo;
    write(this.find('link-check-go-title'), words.go);
    write(this.find('link-check-leave'), check.phase === 'told' || check.phase === 'failed' ? 'Close' : 'Cancel');
    this.list('link-check-lines', words.lines);
    this.list('link-check-advice', words.advice);
  }

  /** @param {string} id @param {string[]} lines */
  list(id, lines) {
    this.find(id).replaceChildren(...lines.map((text) => {
      const item = this.document.createElement('li');
      write(item, text);
      return item;
    }));
  }
}

/**
 * @param {Check} check
 * @param {number} listenedMs
 */
export function wordsOf(check, listenedMs) {
  const none = { title: '', hint: '', share: 0, lines: /** @type {string[]} */ ([]), advice: /** @type {string[]} */ ([]) };
  switch (check.phase) {
    case 'listening': {
      const left = Math.max(0, Math.ceil((LISTEN_MS - listenedMs) / 1000));
      const hint = 'Hold the phone as you will in flight, where you will stand.';
      const title = `Listening: ${left} s left`;
      const share = Math.round(100 * listenedMs / LISTEN_MS) / 100;
      return { ...none, title, hint, share, go: 'Enough', mayGo: listenedMs >= LEAST_MS };
    }
    case 'told': {
      const { grade, title, lines, advice, seconds } = check.report;
      const hint = `In the last ${Math.round(seconds)} s:`;
      return { ...none, title: GRADES[grade] + title, hint, lines, advice, go: 'Check again', mayGo: true };
    }
    case 'failed':
      return { ...none, title: '✕ Not checked', hint: check.why, go: 'Check again', mayGo: true };
    default:
      return { ...none, title: 'Listening', hint: 'One moment…', go: 'Check again', mayGo: false };
  }
}
