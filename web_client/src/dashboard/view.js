/** The supervisor page's DOM. Elements are made once; a new Status only changes their text and width. */

/** @import {Board} from './model.js' */
/** @import {Advice} from '../wire/problems.js' */
/** @import {Status} from '../wire/protocol_types.js' */

import { Elements } from './elements.js';
import { healthWords, limitWords, modeWords, rampWords, robotWords } from '../ui/mode_words.js';
import { age, alarm, gapLine, metres, number, scaleEnd, screenWords, streamName, timeOfDay } from './format.js';
import { stopWords } from '../wire/stop.js';
import { drawLines } from './sparkline.js';
import { REMEMBERED, beforeArming, requests, shownMode } from './model.js';
import { say, write } from '../words/say.js';

/** @typedef {{ onRequest: (what: 'arm' | 'disarm' | 'reset') => void, onStop: () => void, onVirtual: () => void,
 *   onRecord: () => void, onCode: () => void, onReload: () => void }} Requests */

const ERROR_COLOUR = '#7cc4ff';
const SIGMA_COLOUR = '#fbbf24';
/** Of the limit: what is more, is at it. */
const FULL = 0.99;

export class BoardView extends Elements {
  /**
   * @param {Document} document
   * @param {Requests} handlers
   */
  constructor(document, handlers) {
    super(document);
    this.shownEvents = '';
    /** Its name, or "". */
    this.server = '';
    for (const what of /** @type {const} */ (['arm', 'disarm', 'reset'])) {
      this.find(what).addEventListener('click', () => handlers.onRequest(what));
    }
    for (const type of ['pointerdown', 'click']) {
      for (const id of ['stop', 'last-stop-button']) this.find(id).addEventListener(type, handlers.onStop);
    }
    this.find('virtual').addEventListener('click', handlers.onVirtual);
    this.find('record').addEventListener('click', handlers.onRecord);
    this.find('code').addEventListener('click', handlers.onCode);
    this.find('reload').addEventListener('click', handlers.onReload);
  }

  /**
   * @param {Board} board
   * @param {Advice | null} advice
   */
  render(board, advice) {
    this.show('blocked', advice !== null);
    this.show('board', advice === null);
    this.text('problem-title', advice?.title ?? '');
    this.list('problem-steps', advice?.steps ?? []);
    this.head(board);
    const { status } = board;
    if (status === null) return;
    this.arming(status);
    this.phone(status);
    for (const [name, stream] of Object.entries(status.streams)) this.stream(name, stream);
    this.tracking(status, board);
    this.latency(status.latency_ms);
    this.told(status);
    this.control(status);
    this.events(status.events);
    this.text('gaps', gapLine(status.gaps));
  }

  /** @param {Status['events']} events */
  events(events) {
    const key = JSON.stringify(events);
    if (key === this.shownEvents) return;
    this.shownEvents = key;
    this.find('events').replaceChildren(...events.map(({ text, times, unix_ms: at }) => {
      const line = this.make('li', '');
      line.append(this.make('time', timeOfDay(at)), this.make('span', text));
      if (times > 1) line.append(this.make('small', `× ${times}`));
      return line;
    }));
  }

  /** @param {Board} board */
  head(board) {
    const mode = shownMode(board);
    const [name, meaning] = modeWords(mode, board.status);
    this.find('status').dataset.mode = mode;
    this.text('mode', name);
    this.text('meaning', meaning);
    const left = board.heard ? board.status?.until_ramp_ms ?? null : null;
    this.text('left', rampWords(left === null ? null : Math.ceil(left / 1000), board.status));
    this.text('reason', board.heard ? board.status?.reason ?? '' : '');
    this.text('robot', [this.server, robotWords(board.status)].filter(Boolean).join(' · '));
    for (const [what, can] of Object.entries(requests(board))) {
      /** @type {HTMLButtonElement} */ (this.find(what)).disabled = !can;
    }
    this.show('last-stop', board.known);
    const text = board.stopping ? stopWords(board.heard, board.stopAnswer) : board.notice?.text ?? '';
    for (const id of ['stop', 'last-stop-button']) this.find(id).classList.toggle('asked', board.stopping);
    for (const id of ['notice', 'last-stop-words']) {
      this.show(id, text !== '');
      this.text(id, text);
    }
  }

  /** @param {number | null} heightM Of the smallest screen that can show the robot. */
  screen(heightM) {
    this.show('screen', heightM !== null);
    if (heightM === null) return;
    this.text('screen', screenWords(heightM));
    this.find('screen').title = say('A phone that films the screen leads the simulated robot');
  }

  /** @param {Status} status */
  arming(status) {
    const { title, badge, tone, lines, fine } = beforeArming(status);
    this.text('arming-title', title);
    this.text('ready', badge);
    this.find('ready').className = `badge ${tone}`;
    this.list('refusals', lines);
    this.find('refusals').firstElementChild?.classList.toggle('fine', fine);
    const { mode, sensors_doubted: doubted, thrusters_weak: weak, warnings } = status;
    const told = [...healthWords(status), ...limitWords(status)];
    this.list('warnings', [...told, ...(mode === 'DISARMED' ? [] : weak), ...doubted, ...warnings]);
  }

  /** @param {Status} status */
  phone({ operator, phones, supervisors, recording, video_path: path, path_choice: choice }) {
    const words = path && `video by ${path}${choice?.by ? `, ${choice.by}’s choice` : ''}`;
    this.text('video-path', words);
    this.find('video-path').title = say(words);
    this.text('operator', operator || 'none');
    this.find('operator').title = operator;
    this.text('crowd', `phones ${phones} · supervisors ${supervisors}`);
    this.text('recording', recording);
    this.text('record', recording ? 'Stop recording' : 'Record');
    this.find('record').classList.toggle('on', recording !== '');
  }

  /**
   * @param {string} name
   * @param {Status['streams'][string]} stream
   */
  stream(name, stream) {
    const row = this.row('streams', name, 'tr', () => {
      const cells = [streamName(name), '', '', '', ''].map((text) => this.make('td', text));
      const gauge = this.make('div', '');
      gauge.className = 'gauge';
      gauge.append(this.make('i', ''));
      cells[2]?.append(gauge);
      return cells;
    });
    const [, ageCell, gaugeCell, rateCell, droppedCell] = row.children;
    write(ageCell, age(stream.age_ms));
    write(rateCell, `${number(stream.rate_hz)} Hz`);
    write(droppedCell, String(stream.dropped));
    const bar = /** @type {HTMLElement} */ (gaugeCell?.firstElementChild?.firstElementChild);
    bar.className = alarm(stream.age_ms);
    bar.style.width = `${Math.min(100, ((stream.age_ms ?? 200) / 200) * 100)}%`;
  }

  /**
   * @param {Status} status
   * @param {Board} board
   */
  tracking(status, { history }) {
    this.figure('figures', 'Error', number(status.error_mm, 1), 'mm');
    this.figure('figures', 'Turned', number(status.error_deg, 2), '°');
    this.figure('figures', 'σ', number(status.sigma_mm, 1), 'mm');
    this.figure('figures', 'Distance', number(metres(status.position_mm), 2), 'm');
    this.figure('figures', 'Lights', String(status.leds), '');
    this.figure('figures', 'Misfit', number(status.reprojection_px, 2), 'px');
    this.graph('graph-mm', [
      { values: history.map((sample) => sample.sigmaMm), colour: SIGMA_COLOUR },
      { values: history.map((sample) => sample.errorMm), colour: ERROR_COLOUR },
    ]);
    this.graph('graph-deg', [{ values: history.map((sample) => sample.errorDeg), colour: ERROR_COLOUR }]);
  }

  /**
   * @param {string} id
   * @param {import('./sparkline.js').Line[]} lines
   */
  graph(id, lines) {
    const ratio = this.document.defaultView?.devicePixelRatio ?? 1;
    drawLines(/** @type {HTMLCanvasElement} */ (this.find(id)), lines, REMEMBERED, ratio);
  }

  /** @param {Status['latency_ms']} stages */
  latency(stages) {
    const total = Object.values(stages).reduce((sum, ms) => sum + ms, 0);
    const end = scaleEnd(total);
    this.text('total', total > 0 ? `${Math.round(total)} ms light to command` : 'no picture yet');
    this.text('scale', `${Math.round(end)} ms`);
    Object.entries(stages).forEach(([name, ms], i) => {
      const part = this.row('stack', name, 'i', () => []);
      part.className = `tone-${i % 8}`;
      part.title = say(name);
      part.style.width = `${(ms / end) * 100}%`;
      const row = this.row('stages', name, 'div', () => [this.make('dt', name), this.make('dd', '')]);
      row.className = `tone-${i % 8}`;
      write(row.lastElementChild, number(ms, 1));
    });
  }

  /** @param {Status} status */
  told({ takes, saturated, thrusts_n: thrusts, thrust_limit_n: limit, told_mm_s: speed, told_deg_s: rate, tool }) {
    this.show('saturated', saturated);
    this.text('told', takes === 'twist' ? 'Twist' : 'Thrusts');
    thrusts.forEach((thrust, i) => {
      const row = this.row('thrusts', String(i + 1), 'div', () => [
        this.make('dt', String(i + 1)), this.make('dd', ''),
      ]);
      row.style.setProperty('--share', `${(thrust / limit) * 100}%`);
      row.classList.toggle('full', thrust >= FULL * limit);
      write(row.lastElementChild, `${number(thrust, 2)} N`);
    });
    if (takes === 'twist') {
      this.figure('twist', 'Told to move', number(speed, 0), 'mm/s');
      this.figure('twist', 'Told to turn', number(rate, 1), '°/s');
    }
    if (tool === null) return;
    const opening = tool.opening === null ? null : 100 * tool.opening;
    this.figure('twist', tool.name, opening === null ? 'stays' : number(opening, 0), opening === null ? '' : '% open');
  }

  /** @param {Status} status */
  control({ realtime, control, server }) {
    this.text('realtime', realtime || '–');
    this.figure('control', 'p50', number(control.p50_ms, 2), 'ms');
    this.figure('control', 'p99', number(control.p99_ms, 2), 'ms');
    this.figure('control', 'p99.9', number(control.p999_ms, 2), 'ms');
    this.figure('control', 'Missed', number(control.missed), '');
    this.figure('control', 'Server pause', number(server.stall_ms, 0), 'ms');
  }
}
