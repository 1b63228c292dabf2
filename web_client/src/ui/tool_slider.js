/** The robot's tool: a slider that counts while the big button is held. Loaded with a robot that has one. */

/** @import {ToolStatus, UseTool} from '../wire/protocol_types.js' */

import { write } from '../words/say.js';

/** What is asked is said again so often: until a touch tells of the press, the server takes none of it. */
export const AGAIN_MS = 100;
const SHEET = 'tool.css';

export class ToolSlider {
  /**
   * @param {Document} document
   * @param {(use: UseTool) => void} send
   * @param {() => number} now [ms]
   */
  constructor(document, send, now) {
    this.send = send;
    this.now = now;
    this.asked = false;
    this.sentMs = -Infinity;
    /** The press that is held. @type {number | null} */
    this.press = null;
    this.panel = document.createElement('label');
    this.panel.className = 'tool-slider';
    this.name = document.createElement('b');
    this.slider = document.createElement('input');
    Object.assign(this.slider, { type: 'range', min: '0', max: '100', value: '0' });
    this.slider.addEventListener('input', () => { this.asked = true; });
    this.panel.append(this.name, this.slider);
    const sheet = document.createElement('link');
    Object.assign(sheet, { rel: 'stylesheet', href: SHEET });
    document.head.append(sheet);
    document.querySelector('.controls')?.before(this.panel);
  }

  /**
   * @param {ToolStatus | null} tool As control has it; null: there is none, or nobody knows.
   * @param {number | null} press The one that is held.
   */
  take(tool, press) {
    this.panel.hidden = tool === null;
    if (press !== this.press) this.asked = false;
    this.press = press;
    this.slider.disabled = press === null;
    if (tool === null) return;
    write(this.name, tool.name);
    if (!this.asked || press === null) {
      if (tool.opening !== null) this.slider.value = String(Math.round(100 * tool.opening));
    } else if (this.now() - this.sentMs >= AGAIN_MS) {
      this.sentMs = this.now();
      this.send({ type: 'tool', opening: Number(this.slider.value) / 100, press });
    }
  }
}
