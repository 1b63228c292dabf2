/** From sentences with places for numbers and names, as they stand in the sources, to those of another language. */

const PLACE = '{}';
/** What parts sentences; no initial is before. */
const SENTENCES = [/(?<=\S\S[.!?…]) /, / · /];
/** What parts what is in one, the largest first. */
const CLAUSES = [/; /, /: /, /, /];
const WORDS = /\p{L}/u;
/** So many of something. */
const COUNTED = /^([+-]?\d[\d.]*) (.*\D.*)$/;
/** A pattern of fewer letters, as "{} by {}", is in many sentences: it counts where all its places are understood. */
const TELLING = 7;
/** No sentence of ours has more of one kind; what does comes from outside, and can be long. */
const MOST_PARTS = 8;
/** So many texts are remembered: those with numbers in them change all the time. */
const MOST_KNOWN = 400;

/** @typedef {{ like: RegExp, words: string, isTelling: boolean }} Pattern */

/**
 * @param {string} sentence
 * @returns {RegExp}
 */
function like(sentence) {
  const plain = sentence.split(PLACE).map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, '\\$&'));
  return new RegExp(`^${plain.join('([^]*?)')}$`);
}

/** What is in no place. @param {string} sentence */
function told(sentence) {
  return sentence.replaceAll(PLACE, '').length;
}

/**
 * A function that says a text in the dictionary's language; what it does not know it leaves.
 * @param {Record<string, string>} dictionary By the English sentence; places are in the same order in both.
 * @param {(words: string) => string} numbers Writes a number as the language does.
 * @returns {(text: string) => string}
 */
export function translatorOf(dictionary, numbers) {
  const exact = new Map(Object.entries(dictionary));
  /** The most telling first. @type {Pattern[]} */
  const patterns = [...exact.keys()].filter((sentence) => sentence.includes(PLACE)).sort((a, b) => told(b) - told(a))
    .map((sentence) => ({ like: like(sentence), words: exact.get(sentence) ?? '', isTelling: told(sentence) >= TELLING }));
  /** @type {Map<string, string>} */
  const known = new Map();

  /** @param {string} text @param {boolean} telling @returns {string | null} */
  function fitted(text, telling) {
    for (const { like, words, isTelling } of patterns) {
      const found = isTelling === telling ? like.exec(text) : null;
      if (found === null) continue;
      const places = found.slice(1).map((part) => say(part));
      if (!telling && places.some((part, i) => / /.test(part) && part === found[i + 1])) continue;
      let place = -1;
      return words.replaceAll(PLACE, () => places[place += 1] ?? '');
    }
    return null;
  }

  /** @param {string} text @param {RegExp[]} borders @returns {string | null} Null: nothing of it is known. */
  function parted(text, borders) {
    for (const between of borders) {
      const at = between.exec(text);
      if (at === null) continue;
      // at the first one alone: what follows may be known with a border inside
      const every = text.split(between);
      const parts = every.length > MOST_PARTS ? every : [every[0] ?? '', text.slice(at.index + at[0].length)];
      const said = parts.map(say);
      if (said.some((part, i) => part !== parts[i])) return said.join(numbers(at[0].replace(/^[:;]/, ' $&')));
    }
    return null;
  }

  /** @param {string} text @returns {string | null} */
  function sentence(text) {
    return exact.get(text) ?? fitted(text, true);
  }

  /** @param {string} text */
  function found(text) {
    if (!WORDS.test(text)) return numbers(text);
    const bare = text.endsWith('.') ? sentence(text.slice(0, -1)) : null;
    return sentence(text) ?? (bare === null ? null : `${bare}.`) ?? parted(text, SENTENCES) ?? fitted(text, false) ?? parted(text, CLAUSES)
      ?? numbers(text.replace(COUNTED, (_, count, what) => `${count} ${say(what)}`));
  }

  /** @param {string} text @returns {string} */
  function say(text) {
    const [, before = '', words = '', after = ''] = /^(\s*)([^]*?)(\s*)$/.exec(text) ?? [];
    if (words === '') return text;
    const has = known.get(words);
    if (has !== undefined) return before + has + after;
    const said = found(words);
    if (known.size >= MOST_KNOWN) known.clear();
    known.set(words, said);
    return before + said + after;
  }

  return say;
}

const ATTRIBUTES = ['alt', 'aria-label', 'title', 'placeholder'];

/**
 * Says what stands in a page already.
 * @param {Document} document
 * @param {(text: string) => string} say
 */
export function translatePage(document, say) {
  document.title = say(document.title);
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = texts.nextNode(); node !== null; node = texts.nextNode()) {
    node.nodeValue = say((node.nodeValue ?? '').replace(/\s+/g, ' '));
  }
  for (const name of ATTRIBUTES) {
    for (const element of document.querySelectorAll(`[${name}]`)) element.setAttribute(name, say(element.getAttribute(name) ?? ''));
  }
}
