/** The page of a screen that shows a robot of light: its size by a bank card, then fullscreen and nothing else. */

/** @import {ScreenLights, ToPage} from '../wire/protocol_types.js' */

import { browserOf } from '../app/browser.js';
import { stayAwake } from '../ui/display.js';
import { Link, socketUrl } from '../wire/link.js';
import { becomeKnown, usualName } from '../wire/pairing.js';
import { adviceFor, problemOf } from '../wire/problems.js';
import { VERSION } from '../wire/protocol.js';
import { speak, write } from '../words/say.js';
import {
  CARD_HIGH_MM, CARD_MM, FramePeriod, LEAST_DOT_PX, OLD_MS, ServerClock, lightCells, lightsAt, mmPerPixel, sizeKey,
  slowness,
} from './glass.js';

const ASK_MS = 200;
/** Dim, or the fiducials would outshine the lights. */
const GREY = '#4d4d4d';

await speak(document, navigator.languages, () => window.localStorage);
const { fetchHere, later, links, platform } = browserOf(window);
const canvas = /** @type {HTMLCanvasElement} */ (find('glass'));
const card = find('card');
const slider = /** @type {HTMLInputElement} */ (find('size'));
const drawing = canvas.getContext('2d', { alpha: false });
const clock = new ServerClock();
const period = new FramePeriod();
const key = sizeKey(window.screen, window.devicePixelRatio);
let mm = mmPerPixel(remembered(), window.devicePixelRatio);
/** @type {{ lights: ScreenLights, atMs: number } | null} */
let newest = null;
let shows = false;

const link = new Link(socketUrl('ws/screen', document.baseURI), {
  onOpen: () => void link.sendMessage({
    type: 'hello', version: VERSION, role: 'screen', device: '', session: '', sensors: '', video: '',
  }),
  onMessage: take,
  onRecord: () => {},
  onClose: () => {
    newest = null;
    say('The server is away: waiting for it.');
  },
}, links);

/** @param {string} id */
function find(id) {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`screen.html has no #${id}`);
  return element;
}

function remembered() {
  try {
    return window.localStorage.getItem(key);
  } catch {
    return null;
  }
}

/** @param {string} words */
function say(words) {
  write(find('why'), words);
}

/** @param {ToPage} message */
function take(message) {
  const now = performance.now();
  if (message.type === 'welcome') tellSize();
  if (message.type === 'clock_answer') clock.heard(message.page_ms, message.server_ms, now);
  if (message.type === 'lights') {
    newest = { lights: message, atMs: now };
    say(message.why || slowness(period.ms));
  }
  if (message.type !== 'refused') return;
  say(`This screen is not taken: ${message.allowed}.`);
  if (message.fatal) link.close();
}

function tellSize() {
  canvas.width = Math.round(window.innerWidth * window.devicePixelRatio);
  canvas.height = Math.round(window.innerHeight * window.devicePixelRatio);
  newest = null;
  link.sendMessage({ type: 'glass', width_mm: window.innerWidth * mm, height_mm: window.innerHeight * mm });
}

/** @param {number} frameMs */
function draw(frameMs) {
  requestAnimationFrame(draw);
  period.tick(frameMs);
  if (!shows || drawing === null) return;
  const { width, height } = canvas;
  drawing.fillStyle = '#000';
  drawing.fillRect(0, 0, width, height);
  drawing.fillStyle = GREY;
  for (const [x, y, side] of lightCells(width, height)) drawing.fillRect(x, y, side + 0.5, side + 0.5);
  const t = clock.at(frameMs);
  if (newest === null || t === null || performance.now() - newest.atMs > OLD_MS) return;
  const perMm = window.devicePixelRatio / mm;
  const radius = 0.5 * Math.max(newest.lights.dot_mm * perMm, LEAST_DOT_PX);
  drawing.fillStyle = '#fff';
  for (const [right, up] of lightsAt(newest.lights, t, height / perMm, period.ms)) {
    drawing.beginPath();
    drawing.arc(width / 2 + right * perMm, height / 2 - up * perMm, radius, 0, 2 * Math.PI);
    drawing.fill();
  }
}

function showCard() {
  card.style.width = `${CARD_MM / mm}px`;
  card.style.height = `${CARD_HIGH_MM / mm}px`;
  slider.value = String(CARD_MM / mm);
}

/** @param {boolean} now */
function show(now) {
  shows = now;
  document.body.dataset.shows = String(now);
  find('setup').hidden = now;
}

async function start() {
  show(true);
  try {
    await document.documentElement.requestFullscreen();
  } catch {
    // some tablets can't: the page fills what it has
  }
  void stayAwake(window.navigator);
  try {
    const role = await becomeKnown({
      fetch: fetchHere,
      window,
      name: usualName(navigator.userAgent),
      onWaiting: ({ code }) => say(`Waiting to be let in: ${code}.`),
      onLess: async () => false, // a screen wants little: it keeps what this browser may already
      later,
    });
    if (role === null) {
      say('This browser is not let in yet: open a link of “lightleash invite --role viewer” in it first.');
      return;
    }
    if (shows) link.open(); // else somebody has left it meanwhile
  } catch (error) {
    const problem = problemOf(error);
    say(problem.detail || adviceFor(problem, platform, window.location.port).title);
  }
}

slider.addEventListener('input', () => {
  mm = CARD_MM / Number(slider.value);
  try {
    window.localStorage.setItem(key, String(mm));
  } catch {
    // not remembered, then
  }
  showCard();
});
find('start').addEventListener('click', () => void start());
window.addEventListener('resize', () => {
  if (link.isOpen) tellSize();
});
document.addEventListener('fullscreenchange', () => {
  if (document.fullscreenElement !== null) return;
  link.close();
  newest = null;
  show(false);
});
document.addEventListener('visibilitychange', () => {
  if (document.visibilityState === 'visible' && shows) void stayAwake(window.navigator);
});
window.setInterval(() => {
  link.sendMessage({ type: 'clock_ask', page_ms: performance.now() });
}, ASK_MS);
showCard();
say('');
requestAnimationFrame(draw);
