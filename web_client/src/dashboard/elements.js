/** Elements of a page by name, written only where something is new. */

import { say, write } from '../words/say.js';

export class Elements {
  /** @param {Document} document */
  constructor(document) {
    this.document = document;
    /** Rows made so far, by name. @type {Map<string, HTMLElement>} */
    this.rows = new Map();
  }

  /** @param {string} id */
  find(id) {
    const element = this.document.getElementById(id);
    if (element === null) throw new Error(`the page has no #${id}`);
    return element;
  }

  /**
   * The element of that name in a list, made at its first use.
   * @param {string} list
   * @param {string} name
   * @param {string} tag
   * @param {() => HTMLElement[]} children
   */
  row(list, name, tag, children) {
    const key = `${list} ${name}`;
    const known = this.rows.get(key);
    if (known !== undefined) return known;
    const row = this.make(tag, '');
    row.append(...children());
    this.find(list).append(row);
    this.rows.set(key, row);
    return row;
  }

  /**
   * A number with its name and unit.
   * @param {string} list
   * @param {string} name
   * @param {string} value
   * @param {string} unit
   */
  figure(list, name, value, unit) {
    const row = this.row(list, name, 'div', () => {
      const figure = this.make('dd', '');
      figure.append(this.make('span', ''), this.make('small', unit));
      return [this.make('dt', name), figure];
    });
    write(row.lastElementChild?.firstElementChild, value);
    return row;
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

  /**
   * @param {string} id
   * @param {string} text
   */
  text(id, text) {
    write(this.find(id), text);
  }

  /**
   * @param {string} id
   * @param {boolean} visible
   */
  show(id, visible) {
    this.find(id).hidden = !visible;
  }

  /**
   * @param {string} id
   * @param {string[]} items
   */
  list(id, items) {
    const element = this.find(id);
    const old = [...element.children].map((child) => child.textContent);
    if (old.length === items.length && old.every((text, i) => text === say(items[i] ?? ''))) return;
    element.replaceChildren(...items.map((text) => this.make('li', text)));
  }
}
