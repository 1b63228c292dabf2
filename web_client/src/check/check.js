/** The check of a phone: listens for one minute or five, asks the server what it found, and says so. */

/** @import {Fetch} from '../wire/pairing.js' */
/** @import {LinkReport} from '../wire/protocol_types.js' */

import { refusalOf } from '../wire/pairing.js';

/** @typedef {LinkReport['grade']} Grade */

/**
 * One thing, as `server/diagnostics/phone_check/verdicts.py` judges it.
 * @typedef {object} Line
 * @property {string} what
 * @property {string} value
 * @property {Grade} grade
 * @property {string} advice
 */

/**
 * What `lightleash check --json` writes, too.
 * @typedef {object} Report
 * @property {Grade} grade
 * @property {string} title
 * @property {Line[]} lines
 * @property {{ device: string }} figures
 */

/**
 * What `api/check` answers.
 * @typedef {object} Answer
 * @property {Report} report
 * @property {string} page The same as HTML that stands by itself.
 * @property {number} heard_s So long this phone was there, of what was asked for.
 */

/**
 * @typedef {{ phase: 'ready' } | { phase: 'told', answer: Answer } | { phase: 'failed', why: string }
 *   | { phase: 'running', sinceMs: number, lengthMs: number, answer: Answer | null, why: string }} Check
 */

export const MINUTE_MS = 60_000;
export const LONG_MS = 300_000;
/** Of less nobody says anything. */
export const LEAST_MS = 5000;
export const ASK_MS = 2000;
/** A phone that was there for so much less than was asked for has come, or come anew, meanwhile. */
const SLACK_MS = 2000;
const PATIENCE_MS = 5000;
/** @type {Record<Grade, [mark: string, word: string]>} */
const GRADES = { good: ['✓', 'good'], fair: ['!', 'fair'], poor: ['✕', 'poor'], unknown: ['?', 'unknown'] };

export class PhoneCheck {
  /**
   * @param {Fetch} fetch
   * @param {() => number} now [ms]
   */
  constructor(fetch, now) {
    this.fetch = fetch;
    this.now = now;
    /** @type {Check} */
    this.check = { phase: 'ready' };
    this.askedMs = -Infinity;
    this.isAsking = false;
  }

  /** @param {number} lengthMs */
  begin(lengthMs) {
    this.check = { phase: 'running', sinceMs: this.now(), lengthMs, answer: null, why: '' };
    this.askedMs = this.now();
  }

  /** End it with what was found so far. */
  enough() {
    if (this.check.phase !== 'running') return;
    const { answer } = this.check;
    this.check = answer === null ? { phase: 'failed', why: this.check.why || 'Nothing was heard yet.' } : { phase: 'told', answer };
  }

  /** Asks, if it is time to: call it as often as you like. */
  async turn() {
    const run = this.check;
    if (run.phase !== 'running' || this.isAsking || this.now() - this.askedMs < ASK_MS) return;
    this.askedMs = this.now();
    const elapsedMs = Math.min(run.lengthMs, this.askedMs - run.sinceMs);
    this.isAsking = true;
    const said = await this.ask(elapsedMs / 1000);
    this.isAsking = false;
    if (this.check !== run) return;
    if (typeof said === 'string') {
      this.check = { ...run, why: said };
      return;
    }
    const heardMs = 1000 * said.heard_s;
    const isNew = heardMs < elapsedMs - SLACK_MS;
    if (heardMs >= run.lengthMs) this.check = { phase: 'told', answer: said };
    else this.check = { ...run, answer: said, why: '', sinceMs: isNew ? this.askedMs - heardMs : run.sinceMs };
  }

  /** @param {number} seconds @returns {Promise<Answer | string>} Or why there is none. */
  async ask(seconds) {
    try {
      const response = await this.fetch(`api/check?seconds=${seconds.toFixed(1)}`, {
        credentials: 'same-origin', cache: 'no-store', signal: AbortSignal.timeout(PATIENCE_MS),
      });
      return response.ok ? await response.json() : `Nothing is heard: ${await refusalOf(response)}`;
    } catch {
      return 'The server does not answer.';
    }
  }

  heardMs() {
    return this.check.phase === 'running' ? Math.max(0, this.now() - this.check.sinceMs) : 0;
  }
}

/**
 * What stands on the page.
 * @param {Check} check
 * @param {number} heardMs
 */
export function wordsOf(check, heardMs) {
  const none = {
    title: 'Ready', hint: 'Nothing is recorded, and no picture is kept.', share: 0, grade: '', answer: /** @type {Answer | null} */ (null), mayEnd: false,
  };
  switch (check.phase) {
    case 'running': {
      const left = Math.max(0, Math.ceil((check.lengthMs - heardMs) / 1000));
      const title = check.why === '' ? `Listening: ${left} s left` : 'Waiting for a phone';
      const hint = check.why || (check.answer === null ? 'One moment…' : deviceOf(check.answer));
      const share = Math.min(1, heardMs / check.lengthMs);
      return { ...none, title, hint, share, answer: check.answer, mayEnd: heardMs >= LEAST_MS && check.answer !== null };
    }
    case 'told': {
      const { grade, title } = check.answer.report;
      return { ...none, title: `${GRADES[grade][0]} ${title}`, hint: deviceOf(check.answer), grade, answer: check.answer };
    }
    case 'failed':
      return { ...none, title: '✕ Not checked', hint: check.why };
    default:
      return none;
  }
}

/** @param {Grade} grade A mark beside the word: colour alone tells nobody. */
export function gradeWords(grade) {
  return GRADES[grade].join(' ');
}

/** @param {Answer} answer */
function deviceOf({ report, heard_s: heardS }) {
  return `${report.figures.device}, ${Math.round(heardS)} s`;
}

/**
 * A name for what is kept: of the phone, as files may be called.
 * @param {Answer} answer
 * @param {string} ending
 */
export function fileName({ report }, ending) {
  const device = report.figures.device.toLowerCase().replace(/[^a-z0-9]+/g, '-').replace(/^-+|-+$/g, '').slice(0, 60);
  return `phone-check-${device || 'phone'}.${ending}`;
}
