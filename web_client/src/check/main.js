/** The page of the phone check: asks its own server, shows what it says, keeps it as a file; it can do nothing else. */

/** @import {Answer, Line} from './check.js' */

import { browserOf } from '../app/browser.js';
import { Elements } from '../dashboard/elements.js';
import { speak, write } from '../words/say.js';
import { LONG_MS, MINUTE_MS, PhoneCheck, fileName, gradeWords, wordsOf } from './check.js';

const TURN_MS = 250;
/** What is saved is kept for: an iPhone first asks its owner where to. */
const SAVED_MS = 60_000;

await speak(document, navigator.languages, () => window.localStorage);
const { fetchHere, later } = browserOf(window);
const elements = new Elements(document);
const check = new PhoneCheck(fetchHere, () => performance.now());
/** @type {Answer | null} */
let shown = null;

/** @param {string} id @param {() => void} act */
function onClick(id, act) {
  elements.find(id).addEventListener('click', () => {
    act();
    draw();
  });
}

function draw() {
  const words = wordsOf(check.check, check.heardMs());
  const { phase } = check.check;
  elements.find('title').ariaLive = phase === 'running' ? 'off' : 'polite'; // nobody wants each second read out
  write(elements.find('title'), words.title);
  write(elements.find('hint'), words.hint);
  elements.find('run').dataset.grade = words.grade;
  elements.find('bar').hidden = phase !== 'running';
  /** @type {HTMLProgressElement} */ (elements.find('bar')).value = words.share;
  for (const id of ['minute', 'long']) elements.find(id).hidden = phase === 'running';
  elements.find('enough').hidden = phase !== 'running';
  /** @type {HTMLButtonElement} */ (elements.find('enough')).disabled = !words.mayEnd;
  for (const id of ['save-page', 'save-json']) elements.find(id).hidden = phase !== 'told';
  if (words.answer === shown) return;
  shown = words.answer;
  elements.find('lines').replaceChildren(...(shown?.report.lines ?? []).map(lineOf));
}

/** @param {Line} line */
function lineOf({ what, value, grade, advice }) {
  const row = document.createElement('li');
  row.className = 'line';
  row.dataset.grade = grade;
  row.append(part('h3', 'what', what), part('span', 'grade', gradeWords(grade)), part('p', 'value', value), part('p', 'advice', advice));
  return row;
}

/** @param {string} tag @param {string} className @param {string} words */
function part(tag, className, words) {
  const element = document.createElement(tag);
  element.className = className;
  write(element, words);
  return element;
}

/** @param {string} text @param {string} type @param {string} name */
function save(text, type, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  later(() => URL.revokeObjectURL(link.href), SAVED_MS);
}

function turn() {
  void check.turn();
  draw();
  later(turn, TURN_MS);
}

onClick('minute', () => check.begin(MINUTE_MS));
onClick('long', () => check.begin(LONG_MS));
onClick('enough', () => check.enough());
onClick('save-page', () => {
  if (shown !== null) save(shown.page, 'text/html', fileName(shown, 'html'));
});
onClick('save-json', () => {
  if (shown !== null) save(JSON.stringify(shown.report, null, 1), 'application/json', fileName(shown, 'json'));
});
turn();
