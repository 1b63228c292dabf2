import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { PairingCard } from '../../src/ui/pairing_card.js';
import { PeopleCard, since } from '../../src/dashboard/people_card.js';

/** @import {Person} from '../../src/wire/protocol_types.js' */

/** As much of an element as the cards use. */
class Element {
  /** @param {string} tag */
  constructor(tag) {
    this.tag = tag;
    this.textContent = '';
    this.hidden = false;
    this.className = this.title = this.value = this.placeholder = '';
    /** @type {any[]} */
    this.children = [];
    /** @type {Record<string, () => void>} */
    this.listeners = {};
    this.classList = { toggle: (/** @type {string} */ name, /** @type {boolean} */ on) => { if (on) this.className += ` ${name}`; } };
  }

  append(/** @type {any[]} */ ...children) { this.children.push(...children); }

  replaceChildren(/** @type {any[]} */ ...children) { this.children = children; }

  setAttribute() {}

  addEventListener(/** @type {string} */ type, /** @type {() => void} */ listener) { this.listeners[type] = listener; }

  /** @returns {string} */
  get words() {
    const inside = this.children.map((child) => (typeof child === 'string' ? child : child.words));
    return [this.textContent, ...inside].join(' ').replace(/ +/g, ' ').trim();
  }

  /** @returns {Element[]} */
  get buttons() {
    return this.children.flatMap((child) => (child.tag === 'button' ? [child] : child.buttons ?? []));
  }
}

/** @type {Record<string, Element>} */
let elements;
/** @type {string[]} */
let deeds;
let now = 0;
/** @type {PeopleCard} */
let card;
/** @type {Record<string, () => void>} */
const lifted = {};
const document = /** @type {any} */ ({
  addEventListener: (/** @type {string} */ type, /** @type {() => void} */ listener) => { lifted[type] = listener; },
  getElementById: (/** @type {string} */ id) => (elements[id] ??= new Element(id)),
  createElement: (/** @type {string} */ tag) => new Element(tag),
});

/** @param {Partial<Person>} parts @returns {Person} */
function person(parts) {
  return {
    id: 'a1', name: 'Anna', role: 'operator', state: 'in', code: '', address: '192.0.2.7', since_s: 5, connected: true,
    leads: false, offered: false, ...parts,
  };
}

beforeEach(() => {
  [elements, deeds, now] = [{}, [], 0];
  card = new PeopleCard(document, (deed, { id, code }) => deeds.push(`${deed} ${id} ${code}`.trim()), () => now);
});

/** @param {string} id @param {string} text */
function press(id, text) {
  const button = elements[id]?.buttons.find(({ textContent }) => textContent === text);
  assert.ok(button, `no ${text}`);
  button.listeners['click']?.();
}

test('who asks to lead is shown with the letters to compare, and let in with exactly these', () => {
  card.render([person({ state: 'waiting', code: 'KBWX' })], true);
  assert.equal(elements['asking']?.hidden, false);
  assert.match(elements['asking']?.words ?? '', /Anna \(192\.0\.2\.7\) asks to lead.*KBWX/);
  press('asking', 'Confirm');
  press('asking', 'Deny');
  assert.deepEqual(deeds, ['confirm a1 KBWX', 'deny a1 KBWX']);
  assert.equal(elements['people']?.children.length, 0);
});

test('what is under a finger is not replaced until it is lifted, or has been down for too long to be', () => {
  card.render([person({ connected: false })], true);
  const [button] = elements['people']?.buttons ?? [];
  const isThere = () => elements['people']?.buttons.includes(/** @type {Element} */ (button));
  elements['people']?.listeners['pointerdown']?.();
  card.render([person({ leads: true })], true);
  assert.ok(isThere(), 'a click on it would be lost');
  lifted['pointerup']?.();
  card.render([person({ leads: true })], true);
  assert.ok(!isThere());
  elements['people']?.listeners['pointerdown']?.();
  card.render([person({ connected: false })], true);
  assert.match(elements['people']?.words ?? '', /leads/);
  now = 2000;
  card.render([person({ connected: false })], true);
  assert.match(elements['people']?.words ?? '', /away/);
});

test('nobody is shut out by one tap', () => {
  const people = [person({})];
  card.render(people, true);
  press('people', 'Revoke');
  assert.deepEqual(deeds, []);
  card.render(people, true);
  press('people', 'Really?');
  assert.deepEqual(deeds, ['revoke a1']);
  card.render(people, true);
  press('people', 'Revoke');
  now += 5000;
  card.render(people, true);
  assert.ok(elements['people']?.buttons.some(({ textContent }) => textContent === 'Revoke'), 'it takes two taps again');
});

test('the lead is given to those who may have it and have it not', () => {
  card.render([
    person({ id: 'one', leads: true }), person({ id: 'two' }), person({ id: 'three', role: 'viewer' }),
    person({ id: 'local-operator', role: 'operator' }),
  ], true);
  const rows = elements['people']?.children.map((row) => row.buttons.map((/** @type {Element} */ one) => one.textContent));
  assert.deepEqual(rows, [['Revoke'], ['Give lead', 'Revoke'], ['Revoke'], ['Give lead']]);
  press('people', 'Give lead');
  assert.deepEqual(deeds, ['lead two']);
});

test('a page that only looks has no buttons', () => {
  card.render([person({ state: 'waiting', code: 'KBWX' }), person({ id: 'b' })], false);
  assert.equal(elements['asking']?.hidden, true);
  assert.deepEqual(elements['people']?.buttons, []);
});

test('a row is not made anew under a finger while only seconds pass', () => {
  card.render([person({ since_s: 5 })], true);
  const row = elements['people']?.children[0];
  card.render([person({ since_s: 6 })], true);
  assert.equal(elements['people']?.children[0], row);
  card.render([person({ since_s: 66 })], true);
  assert.notEqual(elements['people']?.children[0], row);
  assert.equal(since(7300), '2 h 1 min');
});

test('a phone asks for a name, remembers it, and has one of its own', () => {
  /** @type {Record<string, string>} */
  const kept = {};
  const storage = () => /** @type {any} */ ({
    getItem: (/** @type {string} */ key) => kept[key] ?? null,
    setItem: (/** @type {string} */ key, /** @type {string} */ value) => { kept[key] = value; },
  });
  const agent = { userAgent: 'Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) Version/18.0 Safari/604.1' };
  const first = new PairingCard(document, agent, storage);
  assert.equal(first.name, 'Safari on iPhone');
  /** @type {Element} */ (elements['name']).value = ' Anna ';
  assert.equal(first.name, 'Anna');
  elements = {};
  assert.equal(new PairingCard(document, agent, storage).name, 'Anna');
  const forgetful = () => { throw new Error('not allowed'); };
  elements = {};
  assert.equal(new PairingCard(document, agent, forgetful).name, 'Safari on iPhone');
});

test('the letters take the place of the field for the name, and go', () => {
  const one = new PairingCard(document, { userAgent: '' }, () => { throw new Error('not allowed'); });
  one.askName(true);
  one.show('KBWX');
  assert.deepEqual([elements['match']?.textContent, elements['pairing']?.hidden, elements['name-field']?.hidden], ['KBWX', false, true]);
  one.hide();
  assert.equal(elements['pairing']?.hidden, true);
});
