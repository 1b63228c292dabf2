/** While a recording runs: what presses are for, and whether somebody should learn from the newest one. */

/** @import {Status} from '../wire/protocol_types.js' */

import { Elements } from './elements.js';

export class EpisodePanel extends Elements {
  /**
   * @param {Document} document
   * @param {(path: string, body: object) => void} post
   */
  constructor(document, post) {
    super(document);
    /** @type {Status['episode']} */
    this.episode = null;
    this.task = /** @type {HTMLInputElement} */ (this.find('task'));
    /** As the server knows it. */
    this.known = '';
    this.task.addEventListener('change', () => post('api/task', { text: this.task.value.trim() }));
    this.find('verdict').addEventListener('click', () => {
      if (this.episode !== null) post('api/episode', { press: this.episode.press, keep: !this.episode.keep });
    });
  }

  /** @param {Status | null} status */
  take(status) {
    this.show('episode', status !== null && status.recording !== '');
    if (status === null) return;
    this.episode = status.episode;
    const { task, episode } = status;
    if (task !== this.known) this.task.value = this.known = task; // somebody's typing is not written over
    this.text('press', episode === null ? 'no press yet' : episode.keep ? `press ${episode.press}` : `discarded ${episode.press}`);
    this.text('verdict', episode === null || episode.keep ? 'Discard' : 'Keep');
    /** @type {HTMLButtonElement} */ (this.find('verdict')).disabled = episode === null;
  }
}
