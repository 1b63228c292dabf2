/** French, for who prefers it. Others never load it. */

import { PAGE } from './french_page.js';
import { SERVER } from './french_server.js';
import { translatePage, translatorOf } from './translator.js';

const UNITS = 's|ms|mm|cm|m|px|V|Hz|GHz|i/s|Mbit/s|MB';

/**
 * Spaces that must not break, and a decimal comma.
 * @param {string} words
 */
export function typeset(words) {
  return words.replace(/^(-?\d+)\.(\d+)(?=$|[ \u00a0])/, '$1,$2').replace(/ (?=[:;?!»%×])/g, '\u00a0').replace(/« /g, '«\u00a0')
    .replace(new RegExp(`(?<=[\\d}]) (?=(?:${UNITS})(?![\\wé]))`, 'g'), '\u00a0');
}

const DICTIONARY = Object.fromEntries(Object.entries({ ...SERVER, ...PAGE }).map(([english, french]) => [english, typeset(french)]));

/** @type {(text: string) => string} */
export const french = translatorOf(DICTIONARY, typeset);

/** @param {Document} document */
export function speakFrench(document) {
  translatePage(document, french);
  document.documentElement.lang = 'fr';
  document.getElementById('language')?.setAttribute('lang', 'en'); // it names the other one
}
