/** The phone page's DOM: shows a state, reports what fingers do. Nothing else touches the document. */

/** @import {Requests, State, ShownMode} from './session_types.js' */
/** @import {Advice} from '../wire/problems.js' */
/** @import {RequestedPath} from '../video/video_paths.js' */

import { gapWords, healthWords, isAtRest, limitWords, modeWords, rampWords } from './mode_words.js';
import { CalibrationView } from './calibration_view.js';
import { attachHold } from './hold_button.js';
import { leadWords } from './leading_choice.js';
import { standbyWords } from './standby.js';
import { endWords, stopWords } from '../wire/stop.js';
import { write } from '../words/say.js';
import { goesOn, requestOf, shownMode, untilRamp } from './session.js';

const REQUEST_WORDS = { arm: 'Arm', disarm: 'Disarm' };
const MOST_REFUSALS = 4;
const MOST_WARNINGS = 2;

export class View {
  /**
   * @param {Document} document
   * @param {Window} window
   * @param {Requests} requests
   */
  constructor(document, window, requests) {
    /** @param {string} id */
    const find = (id) => {
      const element = document.getElementById(id);
      if (element === null) throw new Error(`index.html has no #${id}`);
      return element;
    };
    this.find = find;
    this.document = document;
    this.start = /** @type {HTMLButtonElement} */ (find('start'));
    this.requestButton = /** @type {HTMLButtonElement} */ (find('wish'));
    this.video = /** @type {HTMLVideoElement} */ (find('preview'));
    this.start.addEventListener('click', requests.onStart);
    find('reload').addEventListener('click', requests.onReload);
    this.requestButton.addEventListener('click', requests.onRequest);
    this.requestButton.addEventListener('pointerup', ({ isPrimary }) => {
      if (!isPrimary && !this.requestButton.disabled) requests.onRequest(); // beside a finger that holds there is no click
    });
    find('sound').addEventListener('click', requests.onSound);
    for (const type of ['pointerdown', 'click']) {
      for (const id of ['stop', 'last-stop-button']) find(id).addEventListener(type, requests.onStop);
    }
    const path = /** @type {HTMLSelectElement} */ (find('path-wish'));
    path.addEventListener('change', () => requests.onPath(/** @type {RequestedPath} */ (path.value)));
    const { onFull } = requests;
    find('full').hidden = onFull === null;
    if (onFull !== null) find('full').addEventListener('click', onFull);
    attachHold(find('hold'), { window, document }, requests);
    this.text('host', window.location.host);
    this.calibration = new CalibrationView(document, find, window.location.origin, requests.onCalibrate);
  }

  /** @param {MediaStream} stream */
  preview(stream) {
    this.video.srcObject = stream;
    void this.video.play().catch(() => {}); // the attribute `autoplay` tries again
  }

  /** @param {boolean} on */
  sound(on) {
    this.find('sound').setAttribute('aria-pressed', String(on));
  }

  /** @param {RequestedPath} requested @param {string} by */
  path(requested, by) {
    /** @type {HTMLSelectElement} */ (this.find('path-wish')).value = requested;
    this.text('path-by', by === 'supervisor' ? 'By supervisor' : 'Path');
  }

  /**
   * @param {State} state
   * @param {Advice | null} advice On the state's problem.
   */
  render(state, advice) {
    const operating = state.phase === 'operating';
    this.show('welcome', !operating);
    this.show('operate', operating);
    if (operating) this.operating(state, advice);
    else this.welcome(state, advice);
  }

  /**
   * @param {State} state
   * @param {Advice | null} advice
   */
  welcome(state, advice) {
    const starting = state.phase === 'starting';
    for (const id of ['intro', 'art']) this.show(id, advice === null);
    this.show('problem', advice !== null);
    this.text('problem-title', advice?.title ?? '');
    this.list('problem-steps', advice?.steps ?? []);
    const old = state.problem?.code === 'old_page';
    this.show('reload', old);
    this.show('start', !old && (advice === null || advice.retry));
    this.start.disabled = starting;
    this.text('start', starting ? 'Starting…' : advice === null ? 'Start' : 'Try again');
    this.text('step', state.step);
    this.lastStop(state, advice);
  }

  /**
   * Whoever was let in keeps STOP, whatever has sent the page back.
   * @param {State} state
   * @param {Advice | null} advice
   */
  lastStop(state, advice) {
    this.show('last-stop', state.known && (advice !== null || state.status !== null));
    this.find('last-stop-button').classList.toggle('asked', state.stopping);
    const text = stopText(state);
    this.show('last-stop-words', text !== '');
    this.text('last-stop-words', text);
    this.data('last-stop-words', 'grave', String(isGrave(state)));
  }

  /**
   * @param {State} state
   * @param {Advice | null} advice
   */
  operating(state, advice) {
    const mode = shownMode(state);
    const [name, meaning] = modeWords(mode, state.status);
    this.data('status', 'mode', mode);
    this.text('mode', name);
    this.text('meaning', meaning);
    this.reasons(state, mode, advice);
    this.countdown(untilRamp(state));
    this.notice(state);
    this.health(state);
    const { what, enabled } = requestOf(state);
    this.text('wish', REQUEST_WORDS[what]);
    this.data('wish', 'what', what);
    this.requestButton.disabled = !enabled;
    this.find('stop').classList.toggle('asked', state.stopping);
    this.hold(state, mode);
    this.calibration.render(state.calibration, isAtRest(mode), Boolean(state.status?.camera?.complaint));
  }

  /**
   * @param {State} state
   * @param {ShownMode} mode
   * @param {Advice | null} advice
   */
  reasons(state, mode, advice) {
    const own = ownReason(state, mode);
    this.text('reason', advice?.title ?? own ?? state.status?.reason ?? '');
    const refusals = advice?.steps ?? (mode === 'DISARMED' && !state.standby ? state.status?.refusals ?? [] : []);
    this.list('refusals', refusals, MOST_REFUSALS);
    const calm = mode === 'DISARMED' || mode === 'ARMED';
    // a weak thruster is news in flight; on the ground it stands among the refusals
    const known = (calm ? state.status?.warnings : state.status?.thrusters_weak) ?? [];
    const doubted = state.status?.sensors_doubted ?? [];
    const told = [...healthWords(state.status), ...limitWords(state.status)];
    this.list('warnings', state.standby ? [] : [...told, ...known, ...doubted], MOST_WARNINGS);
  }

  /** @param {{ seconds: number, share: number } | null} left Until RAMP. */
  countdown(left) {
    this.show('left', left !== null);
    if (left === null) return;
    this.text('left-s', `${left.seconds} s`);
    this.find('left-arc').style.strokeDasharray = `${Math.round(100 * left.share)} 100`;
  }

  /** @param {State} state */
  notice(state) {
    const text = stopText(state) || (state.notice?.text ?? '');
    this.data('notice', 'grave', String(isGrave(state)));
    this.show('notice', text !== '');
    this.text('notice', text);
  }

  /** @param {State} state */
  health({ health, status, heard, linked }) {
    this.text('h-gaps', heard && status ? gapWords(status.gaps) : '–');
    this.text('h-leds', linked && heard && status ? String(status.leds) : '–');
    this.text('h-path', health.path);
    this.text('h-fps', `${Math.round(health.fps)} fps${health.eased && ` ${health.eased}`}`);
    this.data('h-fps', 'eased', health.eased);
    this.text('h-rtt', health.rttMs === null ? '–' : `${Math.round(health.rttMs)} ms`);
    this.text('h-imu', `${Math.round(health.imuHz)} Hz`);
    this.text('h-kbps', `${(health.kbps / 1000).toFixed(1)} Mb/s`);
  }

  /**
   * @param {State} state
   * @param {ShownMode} mode
   */
  hold(state, mode) {
    if (state.standby) {
      this.data('hold', 'look', 'idle');
      this.text('hold-title', 'This phone does not lead');
      this.text('hold-hint', '');
      return;
    }
    const ramps = rampWords(untilRamp(state)?.seconds ?? null, state.status);
    const { look, title, hint } = holdWords(state.held, mode, goesOn(state), ramps);
    this.data('hold', 'look', look);
    this.find('hold').setAttribute('aria-pressed', String(state.held));
    this.text('hold-title', title);
    const led = state.status?.leading;
    const words = !led ? '' : look === 'moving' ? leadWords(led.held_scale, led.held_axes) : leadWords(led.scale, led.axes);
    this.text('hold-hint', [words, hint].filter(Boolean).join(' · '));
  }

  /** @param {string} server Name of the server, or "": with several on a machine, whose robot this is. */
  named(server) {
    this.show('server', server !== '');
    this.text('server', server);
    if (server !== '') this.document.title = `${server} · Lightleash`;
  }

  /**
   * @param {string} id
   * @param {string} text
   */
  text(id, text) {
    write(this.find(id), text);
  }

  /**
   * @param {string} id
   * @param {boolean} visible
   */
  show(id, visible) {
    const element = this.find(id);
    if (element.hidden === visible) element.hidden = !visible;
  }

  /**
   * @param {string} id
   * @param {string} key
   * @param {string} value
   */
  data(id, key, value) {
    const { dataset } = this.find(id);
    if (dataset[key] !== value) dataset[key] = value;
  }

  /**
   * @param {string} id
   * @param {string[]} items
   * @param {number} most Longer lists end with a count of the others.
   */
  list(id, items, most = Infinity) {
    const shown = items.length > most ? items.slice(0, most - 1) : items;
    const rest = items.length - shown.length;
    const words = rest > 0 ? [...shown, `and ${rest} more`] : shown;
    const element = this.find(id);
    if (element.dataset.items === words.join('\n')) return;
    element.dataset.items = words.join('\n');
    element.replaceChildren(...words.map((text, i) => {
      const item = this.document.createElement('li');
      write(item, text);
      item.classList.toggle('more', rest > 0 && i === shown.length);
      return item;
    }));
  }
}

/** What became of STOP, or "". @param {State} state */
function stopText({ stopping, stopEnd, stopAnswer, heard }) {
  if (stopping) return stopWords(heard, stopAnswer);
  return stopEnd === '' ? '' : endWords(stopEnd, stopAnswer);
}

/** @param {State} state */
function isGrave({ stopping, stopEnd }) {
  return !stopping && stopEnd !== '' && stopEnd !== 'stopped';
}

/**
 * What the page knows better than the server.
 * @param {State} state
 * @param {ShownMode} mode
 */
function ownReason(state, mode) {
  if (state.standby) return standbyWords(state);
  const last = state.status === null ? '' : ` Last known: ${state.status.mode}.`;
  if (mode === 'NO_LINK') return `Without a link the robot stops by itself.${last}`;
  if (mode === 'NO_WORD') return `No word from the server: what the robot does is not known.${last}`;
  if (state.motionSilent && mode === 'DISARMED') return 'This phone’s motion sensors say nothing: it can’t lead the robot.';
  return null;
}

/**
 * @param {boolean} held
 * @param {ShownMode} mode
 * @param {boolean} goesOn It follows again without another press.
 * @param {string} ramps When RAMP comes, in words.
 * @returns {{ look: 'idle' | 'ready' | 'moving' | 'waiting' | 'again', title: string, hint: string }}
 */
export function holdWords(held, mode, goesOn = false, ramps = '') {
  if (held && mode === 'TRACK') return { look: 'moving', title: 'Moving', hint: 'Let go to keep still' };
  if (mode === 'COAST') return held ? { look: 'waiting', title: 'Keep holding', hint: 'It goes on by itself' }
    : { look: 'ready', title: 'Hold to move', hint: ramps };
  if (held && mode === 'HOLD' && goesOn) return { look: 'waiting', title: 'Keep holding', hint: 'It follows in a moment' };
  if (held && mode === 'HOLD') return { look: 'again', title: 'Let go and press again', hint: ramps };
  if (held && mode === 'RAMP') return { look: 'waiting', title: 'Let go', hint: 'Arm again after it' };
  if (held) return { look: 'waiting', title: 'Held', hint: 'The robot does not follow yet' };
  if (mode === 'ARMED' || mode === 'HOLD') return { look: 'ready', title: 'Hold to move', hint: ramps };
  if (mode === 'TRACK') return { look: 'ready', title: 'Hold to move', hint: 'Released' };
  const hint = mode === 'DISARMED' ? 'Arm first' : '';
  return { look: 'idle', title: 'Hold to move', hint };
}
