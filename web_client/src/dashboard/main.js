/** The supervisor page: joins link, board and buttons. The only module here that acts by itself. */

/** @import {ToPage} from '../wire/protocol_types.js' */
/** @import {Received} from '../wire/protocol.js' */
/** @import {Event} from './model.js' */
/** @import {Invite} from './phone_card.js' */
/** @import {Role} from '../wire/pairing.js' */

import { Alarm } from './alarm.js';
import { browserOf } from '../app/browser.js';
import { BoardView } from './view.js';
import { ChoiceCard } from '../ui/choice_card.js';
import { EpisodePanel } from './episode.js';
import { EstimatePanel } from './estimate.js';
import { EMPTY, reduce, shownMode } from './model.js';
import { Feedback } from '../ui/feedback.js';
import { KnobPanel } from './runtime_parameters.js';
import { LeadingChoice } from '../ui/leading_choice.js';
import { isAtRest, modeWords, runsEmpty } from '../ui/mode_words.js';
import { ServerTime, WakefulClock, commandOf } from '../wire/command.js';
import { Link, socketUrl } from '../wire/link.js';
import { PathSelect } from './path_select.js';
import { PeopleCard } from './people_card.js';
import { PhoneCard } from './phone_card.js';
import { Kind, VERSION } from '../wire/protocol.js';
import { Problem, adviceFor, problemOf } from '../wire/problems.js';
import { StopPost } from '../wire/stop.js';
import { speak } from '../words/say.js';
import { OWN_HEADERS, ask, becomeKnown, exclusion, usualName } from '../wire/pairing.js';

const TICK_MS = 100;
const STOP_TICK_MS = 50;

await speak(document, navigator.languages, () => window.localStorage);
const { fetchHere, later, links, platform } = browserOf(window);
const clock = new WakefulClock(performance, Date);
const serverTime = new ServerTime(clock);
const stopPost = new StopPost(fetchHere, (answer) => dispatch({ type: 'stop_answer', answer }));
let board = EMPTY;
let shown = false;
let virtual = false;
/** @type {Role} */
let role = 'viewer';

const link = new Link(socketUrl('ws/supervisor', document.baseURI), {
  onOpen: () => {
    link.sendMessage({
      type: 'hello', version: VERSION, role: 'supervisor', device: '', session: '', sensors: '', video: '',
    });
  },
  onMessage: take,
  onRecord: record,
  onClose: (wasWelcome) => {
    serverTime.forget();
    dispatch({ type: 'disconnected' });
    if (!wasWelcome) void checkPairing();
  },
}, links);

const view = new BoardView(document, {
  onRequest: (what) => void link.sendMessage(commandOf(what, 0, serverTime)),
  onStop: () => {
    dispatch({ type: 'stop', now: clock.now() });
    sendStop();
  },
  onVirtual: () => void toggleVirtual(),
  onRecord: () => void request(board.status?.recording ? 'DELETE' : 'POST', 'api/recording'),
  onCode: () => card.toggle(),
  onReload: () => window.location.reload(),
});
const knobs = new KnobPanel(document, (tune) => void link.sendMessage(tune), () => performance.now());
const leading = new LeadingChoice(document, (lead) => void link.sendMessage(lead), () => performance.now());
const path = new PathSelect(document, (choice) => void link.sendMessage(choice), () => performance.now());
const estimate = new EstimatePanel(document);
const episode = new EpisodePanel(document, (path, body) => void request('POST', path, body));
const choice = new ChoiceCard(document);
const feedback = new Feedback(window.navigator, window.AudioContext, true);
const alarm = new Alarm(document, (mode) => feedback.signal(mode));
const card = new PhoneCard(document, URL, fetchInvite);
const people = new PeopleCard(document, (deed, { id, code }) => void request('POST', `api/people/${deed}`, { id, code }), () => performance.now());


/** @param {Event} event */
function dispatch(event) {
  board = reduce(board, event);
  if (shown) return;
  shown = true;
  requestAnimationFrame(() => {
    shown = false;
    const { problem } = board;
    const mode = shownMode(board);
    const flies = board.status !== null && !isAtRest(board.status.mode);
    alarm.take(mode, modeWords(mode, board.status)[0], flies, performance.now(), runsEmpty(mode, board.status));
    view.render(board, problem === null ? null : adviceFor(problem, platform, window.location.port));
    estimate.render(board);
    episode.take(board.heard ? board.status : null);
    knobs.take(board.heard ? board.status?.virtual_camera ?? null : null);
    path.take(board.heard ? board.status?.path_choice ?? null : null);
    leading.take(board.heard ? board.status?.leading ?? null : null, role !== 'supervisor');
    people.render(board.status?.people ?? [], role === 'supervisor');
    view.text('virtual', isVirtual() ? 'Stop virtual phone' : 'Start virtual phone');
  });
}

/** @param {ToPage} message */
function take(message) {
  const now = clock.now();
  if (message.type === 'welcome') {
    view.screen(message.screen_height_m);
    view.server = alarm.server = message.name;
    dispatch({ type: 'welcomed' });
  }
  if (message.type === 'status') {
    serverTime.heard(message.time_ms);
    dispatch({ type: 'status', status: message, now });
    card.paired(message.people.length);
  }
  if (message.type !== 'refused') return;
  dispatch({ type: 'refused', refused: message, now });
  if (message.fatal) link.close();
}

/** @param {Received} received */
function record(received) {
  if (received.kind === Kind.PICTURE) card.take(received.data, performance.now());
}

function sendStop() {
  const stop = commandOf('stop', clock.now() - board.stopAtMs, serverTime);
  link.sendMessage(stop);
  stopPost.send(stop);
}

/**
 * @param {'POST' | 'DELETE'} method
 * @param {string} path
 * @param {object} [body]
 */
async function request(method, path, body) {
  const fault = await ask(fetchHere, method, path, body);
  if (fault !== '') dispatch({ type: 'notice', text: `Not done: ${fault}`, now: clock.now() });
  return fault === '';
}

function isVirtual() {
  return virtual || /virtual/i.test(board.status?.operator ?? '');
}

async function toggleVirtual() {
  const stop = isVirtual();
  if (await request(stop ? 'DELETE' : 'POST', 'api/virtual-phone')) virtual = !stop;
}

/** @returns {Promise<Invite | null>} */
async function fetchInvite() {
  if (role !== 'supervisor') return null;
  try {
    const response = await fetchHere('api/invite', {
      method: 'POST', headers: OWN_HEADERS, credentials: 'same-origin', body: '{"role":"operator"}',
    });
    return response.ok ? await response.json() : null;
  } catch {
    return null;
  }
}

/** The server hung up before welcoming us: perhaps it does not know this page any more. */
async function checkPairing() {
  const problem = await exclusion(fetchHere);
  if (problem === null) return;
  link.close();
  dispatch({ type: 'problem', problem: problem.code === 'not_paired' ? new Problem('not_supervisor') : problem });
}

async function arrive() {
  try {
    const known = await becomeKnown({
      fetch: fetchHere,
      window,
      name: usualName(navigator.userAgent),
      onWaiting: ({ code }) => dispatch({ type: 'problem', problem: new Problem('waiting', code) }),
      onLess: (less) => choice.ask(less),
      later,
    });
    if (known === null) throw new Problem('not_supervisor');
    role = known;
    dispatch({ type: 'paired' });
    document.body.dataset.role = known;
    /** @type {HTMLIFrameElement} */ (view.find('scene')).src = 'view/';
    link.open();
  } catch (error) {
    dispatch({ type: 'problem', problem: problemOf(error) });
  }
}

dispatch({ type: 'tick', now: clock.now() }); // the page is whole: what it says at once is true, server or none
window.addEventListener('pointerdown', () => feedback.unlock());
void arrive().then(() => {
  window.setInterval(() => {
    if (board.linked) {
      card.tick(performance.now());
      knobs.tick();
    }
    dispatch({ type: 'tick', now: clock.now() });
  }, TICK_MS);
  window.setInterval(() => {
    if (!board.stopping) return;
    dispatch({ type: 'stop_tick', now: clock.now() });
    if (board.stopping) sendStop();
  }, STOP_TICK_MS);
});
