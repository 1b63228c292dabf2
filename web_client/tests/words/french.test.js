import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

import { literals } from './literals.js';
import { gradeWords } from '../../src/check/check.js';
import { modeWords, SIDES } from '../../src/ui/mode_words.js';
import { wayOf } from '../../src/ui/sight_overlay.js';
import { PAGE } from '../../src/words/french_page.js';
import { SERVER } from '../../src/words/french_server.js';
import * as board from '../../src/words/french_board.js';
import * as check from '../../src/words/french_check.js';
import * as fleet from '../../src/words/french_fleet.js';
import * as supervisor from '../../src/words/french_supervisor.js';
import { frenchOf } from '../../src/words/french.js';

/** @import {ShownMode} from '../../src/ui/session_types.js' */

const ROOT = fileURLToPath(new URL('../..', import.meta.url));

/**
 * @typedef {object} Book
 * @property {Record<string, string>} words What a page's own dictionary has.
 * @property {string[]} files
 * @property {string[]} modules
 * @property {string[]} short Words that go into sentences, or stand for themselves.
 */

/** @param {string} path */
const read = (path) => readFileSync(join(ROOT, path), 'utf8');

/** @param {string[]} rooms */
const modulesOf = (...rooms) => rooms.flatMap((room) => readdirSync(join(ROOT, 'src', room)).map((name) => `${room}/${name}`));

const MODES = /** @type {ShownMode[]} */ (['DISARMED', 'ARMED', 'TRACK', 'COAST', 'HOLD', 'RAMP', 'STOPPED', 'LOST', 'NO_LINK', 'NO_WORD']);
const GRADES = /** @type {const} */ (['good', 'fair', 'poor', 'unknown']);
const AXES = [...read('index.html').matchAll(/<option value="([a-z]+)"/g)].map(([, value]) => value ?? '').filter((value) => value !== 'auto');
const WAYS = Array.from({ length: 8 }, (_, k) => wayOf((k * Math.PI) / 4));
/** Of a picture on its way, as the server calls them. */
const STAGES = ['capture to arrival', 'waiting', 'decode', 'detect', 'identify', 'pose', 'to control', 'control'];
/** Of other pages. */
const ELSEWHERE = ['app/board.js', 'app/board_size.js', 'wire/protocol_types.js'];
/** By whom: the phone's page with the screen that it films, and each other page. @type {Record<string, Book>} */
const BOOKS = {
  phone: {
    words: PAGE,
    files: ['index.html', 'screen.html'],
    modules: modulesOf('app', 'camera', 'motion', 'screen', 'ui', 'video', 'wire').filter((name) => !ELSEWHERE.includes(name)),
    short: [...MODES.flatMap((mode) => modeWords(mode, null)), ...Object.values(SIDES), ...AXES, ...WAYS, 'viewer', 'operator', 'supervisor', 'supervises'],
  },
  board: { words: board.PAGE, files: ['board.html'], modules: ['app/board.js'], short: [] },
  check: { words: check.PAGE, files: ['check.html'], modules: modulesOf('check'), short: GRADES.map((grade) => gradeWords(grade).slice(2)) },
  fleet: { words: fleet.PAGE, files: ['fleet.html'], modules: modulesOf('fleet'), short: ['STARTING', 'GONE', 'ENDED', 'nobody'] },
  supervisor: {
    words: supervisor.PAGE,
    files: ['supervisor.html'],
    modules: modulesOf('dashboard'),
    short: [...MODES.map((mode) => mode.toLowerCase()).filter((mode) => !/disarmed|no_/.test(mode)), 'leads', 'away', 'watches', 'now', 'off', 'ready', 'none', 'stays', ...STAGES],
  },
};
/** What is a name in every language. */
const NAMES = ['Lightleash', 'STOP', 'WebRTC', 'WebSocket', 'JPEG', 'Android', 'Edg', 'Edge', 'Mac', '{} · Lightleash', '{} min', '{} h {} min', 'σ [mm]'];
/** For the supervisor's log, for who reads the code, or for the browser: not for who holds the phone. */
const UNSEEN = [
  'camera: {}', 'camera again: {}', 'page: {}', 'whoami: {}', 'the connection has ended', 'the connection has {}', 'the server has hung up', 'no connection within the time allowed',
  'index.html has no #{}', 'screen.html has no #{}', 'board.html has no #{}', '--square-mm {}', 'h2 > *, .state > *',
  'the page has no #{}', 'worry fine', 'badge good', 'badge {}', 'button slim {}', '{}px system-ui, sans-serif', 'lightleash-mm {}x{}@{}', 'outline blurred', 'translate({} {}) rotate({}) scale({})', 'Content-Type', 'Linux; Android', 'Enter',
  'NotAllowedError', 'SecurityError', 'NotFoundError', 'OverconstrainedError', 'DeviceMotion', 'DeviceMotionEvent', 'DeviceOrientationEvent', 'Generic Sensor',
  'no camera', '{}, through the {}', 'track processor', 'track processor in a worker', 'video element', '{} fps', 'focus {}{}', 'zoom {}', 'torch on', '{} ms', 'exposure {}{}{}',
  'not a Lightleash record', 'record version {}, this page speaks {}', 'record of unknown kind {}', 'payload of {} bytes, expected {}', 'message without a type',
  'its worker did not start', 'the offer has no place for pictures', 'no picture', 'pictures are {} ms old', 'holds pictures back', '{} encoder: {}',
  'no WebRTC with records in this browser: pictures go by websocket', 'pictures go by WebRTC', 'no WebRTC: {}', 'WebRTC: {}; pictures go by websocket', '{} takes {} ms a picture: JPEG',
];
/** Words that are put together from what is no literal of their own: units, marks before a link's grade, a member's name. */
const JOINED = ['fps', 'Mb/s', '✓ {}', '! {}', '✕ {}', '? {}', '{} {} ({} s)', 'phone {}', 'computer {}', 'computer {} ({} s)', 'local program ({})'];

/** Whether it is for people. @param {string} text */
const isSaid = (text) => /[a-z]{2}/.test(text) && (/\S \S/.test(text) || /^\W*[A-Z][a-z]/.test(text));

/** Sentences without what only joins them to others. @param {string} text */
const sentences = (text) => text.split(/(?<=[.!?…]) (?=[^a-z])/).map((one) => one.replace(/^(?:\{\} )+(?=[A-Z])|(?<=[.:]) ?(?:\{\})+$/g, '').trim())
  .map((one, _, all) => (all.length === 1 && text.trim().endsWith(': {}') ? text.trim() : one)).filter((one) => isSaid(one));

/** What a page's modules say. @param {Book} book */
function ofModules({ modules }) {
  return modules.flatMap((name) => literals(read(`src/${name}`))).filter((text) => !UNSEEN.includes(text.trim())).flatMap(sentences);
}

/** What stands in the pages themselves; what scripts take away stands there in both languages. @param {Book} book */
function ofPage({ files }) {
  const page = files.map(read).join('').replace(/<noscript>[^]*?<\/noscript>|<span class="late">[^]*?<\/span>/g, '');
  const names = [...page.matchAll(/(?:aria-label|alt|title|placeholder)="([^"]*)"/g)].map(([, name]) => name ?? '');
  return [...page.replace(/<[^>]*>/g, '\0').split('\0'), ...names].map((text) => text.replace(/\s+/g, ' ').trim()).filter((text) => /[A-Za-z]{2}/.test(text))
    .map((text) => text.replace(/^Lightleash · | · Lightleash$/, ''));
}

/** @param {Book} book */
const said = (book) => [...new Set([...ofModules(book), ...ofPage(book), ...book.short])].filter((text) => !NAMES.includes(text));

/** Whether a page has French for it, with or without its full stop. @param {Book} book @param {string} text */
const isKnown = ({ words }, text) => [text, text.replace(/\.$/, '')].some((one) => one in words || one in PAGE || one in SERVER);

const french = frenchOf(Object.assign({}, check.PAGE, check.SERVER));
const frenchAtDesk = frenchOf(Object.assign({}, supervisor.PAGE, supervisor.SERVER));
const ALL = [...Object.values(BOOKS).map(({ words }) => words), SERVER, check.SERVER, supervisor.SERVER];

for (const [name, book] of Object.entries(BOOKS)) {
  test(`whatever the page says in English, it can say in French: ${name}`, () => {
    assert.ok(said(book).length > (name === 'phone' ? 200 : 5), `${said(book).length} found`);
    assert.deepEqual(said(book).filter((text) => !isKnown(book, text)), []);
  });

  test(`no French is kept for what the page does not say: ${name}`, () => {
    const known = said(book).flatMap((text) => [text, text.replace(/\.$/, '')]);
    assert.deepEqual(Object.keys(book.words).filter((text) => !known.includes(text) && !JOINED.includes(text)), []);
  });
}

test('words reach the page by `write` alone, but for names and numbers', () => {
  const past = Object.values(BOOKS).flatMap(({ modules }) => modules)
    .flatMap((name) => read(`src/${name}`).match(/(?:textContent|innerText|nodeValue|placeholder|ariaLabel)\s=\s[^;]*|'(?:aria-label|title)', [^;]*/g) ?? []);
  assert.deepEqual([...new Set(past)], ['textContent = `${origin}/board`', '\'aria-label\', say(name))', 'textContent = person.name', 'textContent = `× ${value}`',
    'placeholder = say(this.usual)', 'textContent = code', 'textContent = name', 'textContent = person.code',
    '\'aria-label\', `${say(text)}: ${person.name}`)', 'textContent = invite.url']);
});

test('a sentence has as many places for numbers and names in both languages', () => {
  for (const [english, words] of ALL.flatMap(Object.entries)) {
    assert.equal(words.split('{}').length, english.split('{}').length, english);
    assert.notEqual(words.trim(), '', english);
  }
});

test('numbers, names and sentences find their places', () => {
  for (const [english, words] of [
    ['Arm', 'Armer'],
    ['Thrust fades in 12 s', 'Rampe dans 12 s'],
    ['The robot\'s battery is low (14.2 V): bring it to rest soon.', 'La batterie du robot est faible (14,2 V) : immobilisez-le bientôt.'],
    ['The robot\'s battery was empty when last told of (11.9 V): charge it before arming.', 'La batterie du robot était vide aux dernières nouvelles (11,9 V) : chargez-la avant d’armer.'],
    ['Let go of the button before a reset.', 'Relâchez le bouton avant de réinitialiser.'],
    ['Without a link the robot stops by itself. Last known: TRACK.', 'Sans liaison, le robot s’arrête de lui-même. Dernier état connu : SUIVI.'],
    ['J. Roux leads. This phone asks for the lead when J. Roux has left.', 'J. Roux guide. Ce téléphone demandera la main au départ de J. Roux.'],
    ['The camera has lost the robot. 2 of 5 LEDs seen: 3 are needed.', 'La caméra a perdu le robot. 2 LED sur 5 vues : il en faut 3.'],
    ['Not taken: calibrate.what: while the robot is disarmed', 'Refusé : calibrate.what : tant que le robot est désarmé'],
    ['0.5 × your way, height kept · Let go to keep still', '0,5 × votre trajet, hauteur gardée · Relâcher pour immobiliser'],
    ['The server\'s computer is too busy. chromium takes the most of it: close what is not needed; a laptop wants its charger.',
      'L’ordinateur du serveur est trop occupé. chromium en prend le plus : fermez ce qui est inutile ; un portable veut son chargeur.'],
    ['LOST: The control process is starting: some seconds; the robot stops by its own watchdog.',
      'PERDU : Le processus de commande démarre : quelques secondes ; le robot s’arrête par son propre chien de garde.'],
    ['12 computer', '12 ordinateur'],
    ['3.1 Mb/s', '3,1 Mbit/s'],
    ['ames', 'ames'],
    ['', ''],
  ]) assert.equal(french(english ?? '').replaceAll('\u00a0', ' '), words);
});

test('numbers and names find their places on the supervisor\'s page', () => {
  for (const [english, words] of [
    ['Gaps in the last minute: phone 3 (0.42 s) · computer 1 (0.14 s)', 'Coupures en une minute : téléphone 3 (0,42 s) · ordinateur 1 (0,14 s)'],
    ['local program (operator) leads: Android.', 'programme local (opérateur) guide : Android.'],
  ]) assert.equal(frenchAtDesk(english ?? '').replaceAll('\u00a0', ' '), words);
});

test('what comes from outside can be long and strange', () => {
  const strange = `${'(.*) $& {} \\'.repeat(2000)}: {}`;
  assert.equal(french(`${strange} leads.`).includes('$&'), true);
  for (const border of [', ', ': ', '; ', ' · ', '. ']) assert.equal(french(`someone${border}`.repeat(20_000)).includes('someone'), true);
  for (let k = 0; k < 1000; k += 1) assert.equal(french(`${k} s`), `${k}\u00a0s`);
});

test('a French sign of two parts never begins a line', () => {
  for (const english of ALL.flatMap(Object.keys)) assert.doesNotMatch(french(english), / [:;?!»]|« /, english);
});
