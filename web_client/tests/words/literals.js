/** What stands between quotes in a module: each literal as one text, with {} for what is put in. */

const QUOTES = ['\'', '"', '`'];
/** What may stand before a regular expression; after a value a slash divides. */
const BEFORE_REGEX = /(?:^|[(,=:[!&|?{};]|return)\s*$/;

/**
 * @param {string} source Of a module.
 * @returns {string[]} Those joined by + as one.
 */
export function literals(source) {
  /** @type {{ text: string, end: number, begin: number }[]} */
  const found = [];
  for (let at = 0; at < source.length;) {
    const [one = '', two = ''] = [source[at], source[at + 1]];
    if (one === '/' && two === '/') at = end(source, '\n', at);
    else if (one === '/' && two === '*') at = end(source, '*/', at + 2);
    else if (QUOTES.includes(one)) {
      const { text, end: after, inside } = literal(source, at);
      found.push({ text, begin: at, end: after });
      found.push(...inside.flatMap((code) => literals(code)).map((words) => ({ text: words, begin: -1, end: -1 })));
      at = after;
    } else if (one === '/' && BEFORE_REGEX.test(source.slice(Math.max(0, at - 20), at))) at = regexEnd(source, at);
    else at += 1;
  }
  return joined(source, found);
}

/** @param {string} source @param {string} what @param {number} from */
function end(source, what, from) {
  const at = source.indexOf(what, from);
  return at < 0 ? source.length : at + what.length;
}

/** @param {string} source @param {number} at */
function regexEnd(source, at) {
  for (let i = at + 1, inClass = false; i < source.length; i += 1) {
    if (source[i] === '\\') i += 1;
    else if (source[i] === '[') inClass = true;
    else if (source[i] === ']') inClass = false;
    else if (source[i] === '/' && !inClass) return i + 1;
  }
  return source.length;
}

/** @param {string} source @param {number} at @returns {{ text: string, end: number, inside: string[] }} */
function literal(source, at) {
  const quote = source[at];
  let text = '';
  /** @type {string[]} */
  const inside = [];
  let i = at + 1;
  while (i < source.length && source[i] !== quote) {
    if (source[i] === '\\') {
      text += source[i + 1] === 'n' ? '\n' : source[i + 1];
      i += 2;
    } else if (quote === '`' && source.startsWith('${', i)) {
      const after = braceEnd(source, i + 2);
      inside.push(source.slice(i + 2, after));
      text += '{}';
      i = after + 1;
    } else {
      text += source[i];
      i += 1;
    }
  }
  return { text, end: i + 1, inside };
}

/** Where the brace closes that was opened before `at`. @param {string} source @param {number} at */
function braceEnd(source, at) {
  for (let i = at, depth = 0; i < source.length; i += 1) {
    const one = source[i] ?? '';
    if (QUOTES.includes(one)) i = literal(source, i).end - 1;
    else if (one === '{') depth += 1;
    else if (one === '}' && depth === 0) return i;
    else if (one === '}') depth -= 1;
  }
  return source.length;
}

/** @param {string} source @param {{ text: string, begin: number, end: number }[]} found */
function joined(source, found) {
  /** @type {string[]} */
  const texts = [];
  let before = -1;
  for (const { text, begin, end: after } of found) {
    const between = before < 0 || begin < 0 ? '' : source.slice(before, begin);
    if (/^\s*\+\s*$/.test(between)) texts.push((texts.pop() ?? '') + text);
    else texts.push(text);
    if (begin >= 0) before = after;
  }
  return texts;
}
