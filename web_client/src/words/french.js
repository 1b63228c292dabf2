/** French, for who prefers it. Others never load it. */

import { PAGE } from './french_page.js';
import { SERVER } from './french_server.js';
import { translatePage, translatorOf } from './translator.js';

/**
 * What a page says that the phone's does not, and the server on it, by the page's class.
 * @type {Record<string, () => Promise<{ PAGE: Record<string, string>, SERVER?: Record<string, string> }>>}
 */
const OWN = {
  board: () => import('./french_board.js'),
  check: () => import('./french_check.js'),
  fleet: () => import('./french_fleet.js'),
  supervisor: () => import('./french_supervisor.js'),
};
const UNITS = 's|ms|min|mm|cm|m|px|V|N|Hz|GHz|i/s|kbit/s|Mbit/s|MB|ppm';

/**
 * Spaces that must not break, and a decimal comma.
 * @param {string} words
 */
export function typeset(words) {
  return words.replace(/^([+−-]?\d+)\.(\d+)(?=$|[ \u00a0])/, '$1,$2').replace(/ (?=[:;?!»%×])/g, '\u00a0').replace(/« /g, '«\u00a0')
    .replace(new RegExp(`(?<=[\\d}]) (?=(?:${UNITS})(?![\\wé]))`, 'g'), '\u00a0');
}

/**
 * What holds no word may hold several numbers; no address is one.
 * @param {string} words
 */
function numbers(words) {
  const isBare = !/\p{L}/u.test(words);
  return typeset(isBare ? words.replace(/(?<=\d), (?=\d)/g, ' ; ').replace(/(?<![\d.])(\d+)\.(\d+)(?![\d.])/g, '$1,$2') : words);
}

/**
 * A function that says a page's text in French.
 * @param {Record<string, string>} own What its dictionary has beside the phone's.
 * @returns {(text: string) => string}
 */
export function frenchOf(own = {}) {
  const words = Object.entries({ ...SERVER, ...PAGE, ...own });
  return translatorOf(Object.fromEntries(words.map(([english, french]) => [english, typeset(french)])), numbers);
}

/**
 * Says a page in French; gives what says the rest.
 * @param {Document} document
 */
export async function speakFrench(document) {
  const own = await OWN[document.documentElement.className]?.();
  const say = frenchOf({ ...own?.SERVER, ...own?.PAGE });
  translatePage(document, say);
  document.documentElement.lang = 'fr';
  document.getElementById('language')?.setAttribute('lang', 'en'); // it names the other one
  return say;
}
