/** A choice of the way that the phone's pictures come by. */

/** @import {PathChoice} from '../wire/protocol_types.js' */

import { Elements } from './elements.js';
import { PATIENCE_MS } from './runtime_parameters.js';

export class PathSelect extends Elements {
  /**
   * @param {Document} document
   * @param {(choice: PathChoice) => void} send
   * @param {() => number} now [ms]
   */
  constructor(document, send, now) {
    super(document);
    this.now = now;
    this.requestedMs = -Infinity;
    this.select = /** @type {HTMLSelectElement} */ (this.find('path-wish'));
    this.select.addEventListener('change', () => {
      this.requestedMs = now();
      send({ type: 'path', wish: /** @type {PathChoice['wish']} */ (this.select.value), by: 'supervisor' });
    });
  }

  /** @param {PathChoice | null} choice As the phone says, which soon obeys; null: it lets nobody choose. */
  take(choice) {
    const { select } = this;
    select.disabled = choice === null;
    const requested = choice?.wish ?? 'auto';
    if (requested === select.value) this.requestedMs = -Infinity;
    else if (choice === null || this.now() - this.requestedMs > PATIENCE_MS) select.value = requested;
  }
}
