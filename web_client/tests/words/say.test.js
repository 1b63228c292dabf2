import assert from 'node:assert/strict';
import { test } from 'node:test';

import { chooseOther, say, speak, write } from '../../src/words/say.js';

/** An element that counts how often it is written to: what is written again is read out again. */
function counted() {
  let text = '';
  return {
    writes: 0,
    get textContent() { return text; },
    set textContent(value) {
      text = value;
      this.writes += 1;
    },
  };
}

/** As much of a page as is asked for. */
function page() {
  const walker = { nextNode: () => null };
  return {
    title: '', documentElement: { lang: 'en' }, body: {}, location: { reloads: 0, reload() { this.reloads += 1; } },
    createTreeWalker: () => walker, querySelectorAll: () => [], getElementById: () => null,
  };
}

/** @param {Record<string, string>} kept @returns {any} */
const storage = (kept) => () => ({
  /** @param {string} key */
  getItem: (key) => kept[key] ?? null,
  /** @param {string} key @param {string} value */
  setItem: (key, value) => { kept[key] = value; },
});
const forgetful = () => { throw new Error('this browser keeps nothing'); };
const KEY = 'lightleash-language';

test('who prefers English, or neither, is spoken to in English', async () => {
  for (const languages of [[], ['en-GB', 'fr'], ['de-DE', 'ja'], ['frr']]) {
    await speak(/** @type {any} */ (page()), languages, storage({}));
    assert.equal(say('Arm'), 'Arm');
  }
  await speak(/** @type {any} */ (page()), ['fr-FR'], storage({ [KEY]: 'en' }));
  assert.equal(say('Arm'), 'Arm');
  await speak(/** @type {any} */ (page()), ['en'], forgetful);
  assert.equal(say('Arm'), 'Arm');
});

test('the other language is remembered, and the page begins anew', () => {
  const [document, kept] = [page(), /** @type {Record<string, string>} */ ({})];
  chooseOther(/** @type {any} */ (document), storage(kept));
  assert.equal(kept[KEY], 'fr');
  document.documentElement.lang = 'fr';
  chooseOther(/** @type {any} */ (document), storage(kept));
  assert.deepEqual([kept[KEY], document.location.reloads], ['en', 2]);
});

test('who prefers French, or has chosen it, is spoken to in French, and hears nothing twice', async () => {
  /** @type {any} */ (globalThis).NodeFilter = { SHOW_TEXT: 4 };
  const document = page();
  await speak(/** @type {any} */ (document), ['de', 'fr-CH', 'en'], forgetful);
  assert.equal(document.documentElement.lang, 'fr');
  assert.equal(say('Arm'), 'Armer');
  const element = counted();
  for (let k = 0; k < 3; k += 1) write(/** @type {any} */ (element), 'Thrust fades in 12 s');
  assert.deepEqual([element.textContent, element.writes], ['Rampe dans 12\u00a0s', 1]);
});
