/** Draws the cards of all robots; one that stays is written anew in place, so that nothing loses the focus. */

/** @import {Card} from './fleet.js' */

import { say, write } from '../words/say.js';

export class FleetView {
  /** @param {Document} document */
  constructor(document) {
    this.document = document;
    /** By id. @type {Map<string, HTMLElement>} */
    this.cards = new Map();
  }

  /** @param {string} why What keeps this page from telling anything, or "". */
  say(why) {
    write(this.document.getElementById('why'), why);
  }

  /** @param {readonly Card[]} cards */
  render(cards) {
    const rows = cards.map((card) => this.row(card));
    const list = this.document.getElementById('servers');
    if (list && (list.children.length !== rows.length || rows.some((row, i) => row !== list.children[i]))) list.replaceChildren(...rows);
  }

  /** @param {Card} card */
  row(card) {
    let row = this.cards.get(card.id);
    if (row === undefined) {
      row = this.make('li', 'server', [
        this.make('h2', '', [this.make('span', ''), this.make('small', '')]),
        this.make('p', 'state', [this.make('strong', ''), this.make('span', '')]),
        this.make('dl', ''),
        this.make('a', ''),
      ]);
      this.cards.set(card.id, row);
    }
    const [name, robot, title, words] = row.querySelectorAll('h2 > *, .state > *');
    called(name, card.name);
    called(robot, card.robot === card.name ? '' : card.robot);
    write(title, card.title);
    write(words, card.words);
    /** @type {HTMLElement} */ (row.querySelector('.state')).dataset.mode = card.mode;
    this.figures(/** @type {HTMLElement} */ (row.querySelector('dl')), card.figures);
    const link = /** @type {HTMLAnchorElement} */ (row.querySelector('a'));
    link.hidden = card.href === '';
    if (link.getAttribute('href') !== card.href) link.href = card.href;
    called(link, say('Open the page of {}').replace('{}', () => card.name));
    return row;
  }

  /**
   * @param {HTMLElement} list
   * @param {[string, string][]} figures
   */
  figures(list, figures) {
    const texts = figures.flat();
    if (texts.length !== list.children.length) list.replaceChildren(...texts.map((_, i) => this.make(i % 2 ? 'dd' : 'dt', '')));
    texts.forEach((text, i) => write(list.children[i], text));
  }

  /**
   * @param {string} tag
   * @param {string} className
   * @param {HTMLElement[]} [children]
   */
  make(tag, className, children = []) {
    const element = this.document.createElement(tag);
    element.className = className;
    element.append(...children);
    return element;
  }
}

/**
 * What is a name in every language, or holds one: words of a page may be somebody's name.
 * @param {Element | undefined} element
 * @param {string} name
 */
function called(element, name) {
  if (element && element.textContent !== name) element.textContent = name;
}
