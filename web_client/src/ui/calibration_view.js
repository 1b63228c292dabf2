/** The camera's calibration on the phone's screen: what is covered, what to do, what came of it. */

/** @import {Calibrate, Calibration} from '../wire/protocol_types.js' */

import { say, write } from '../words/say.js';

const SVG = 'http://www.w3.org/2000/svg';

/** @type {Record<Calibration['phase'], string>} */
const TITLES = {
  needed: '',
  off: '',
  filming: 'Film the board',
  solving: 'Computing…',
  done: 'The camera is calibrated',
  refused: 'Not good enough yet',
};

export class CalibrationView {
  /**
   * @param {Document} document
   * @param {(id: string) => HTMLElement} find
   * @param {string} origin Of the page's address.
   * @param {(what: Calibrate['what']) => void} onCalibrate
   */
  constructor(document, find, origin, onCalibrate) {
    this.document = document;
    this.find = find;
    /** @type {Calibration | null} */
    this.shown = null;
    this.allowed = false;
    this.doubted = false;
    this.map = find('calibration-map');
    find('board-url').textContent = `${origin}/board`;
    find('calibrate').addEventListener('click', () => onCalibrate('start'));
    find('calibration-leave').addEventListener('click', () => {
      onCalibrate(this.shown?.phase === 'done' ? 'start' : 'stop');
    });
    find('calibration-go').addEventListener('click', () => {
      onCalibrate(this.shown?.phase === 'refused' ? 'start' : 'stop');
    });
  }

  /**
   * @param {Calibration | null} calibration
   * @param {boolean} allowed Whether the robot is disarmed.
   * @param {boolean} doubted Whether it is not the camera that was calibrated.
   */
  render(calibration, allowed, doubted) {
    if (calibration === this.shown && allowed === this.allowed && doubted === this.doubted) return;
    Object.assign(this, { shown: calibration, allowed, doubted });
    const phase = calibration?.phase ?? 'off';
    const open = phase !== 'off' && phase !== 'needed';
    const over = phase === 'done' || phase === 'refused';
    this.find('operate').classList.toggle('calibrating', open);
    this.find('calibrate').hidden = open || !allowed || (phase === 'off' && !doubted);
    this.find('calibration').hidden = !open;
    this.map.toggleAttribute('hidden', phase !== 'filming');
    const good = phase === 'done' && calibration?.verdict === 'good';
    this.find('calibration-leave').hidden = !open || good;
    write(this.find('calibration-leave'), phase === 'done' ? 'Film again' : 'Cancel');
    this.find('calibration-go').hidden = !over;
    if (calibration !== null && open) this.open(calibration);
  }

  /** @param {Calibration} calibration */
  open(calibration) {
    const { phase, hint, verdict } = calibration;
    const filming = phase === 'filming';
    this.find('calibration').dataset.verdict = verdict;
    this.find('calibration').classList.toggle('busy', phase === 'solving');
    write(this.find('calibration-title'), TITLES[phase]);
    write(this.find('calibration-hint'), phase === 'done' ? verdictWords(verdict) : hint);
    this.find('calibration-hint').classList.toggle('warning', calibration.blurred);
    this.find('calibration-board').hidden = !filming || calibration.progress > 0;
    write(this.find('calibration-go-title'), phase === 'refused' ? 'Film again' : 'Go on');
    this.tasks(filming ? calibration.tasks : {});
    this.lines(calibration);
    if (filming) this.draw(calibration);
  }

  /** @param {Record<string, number>} tasks */
  tasks(tasks) {
    this.find('calibration-tasks').replaceChildren(...Object.entries(tasks).map(([name, share]) => {
      const row = this.document.createElement('div');
      const term = this.document.createElement('dt');
      const value = this.document.createElement('dd');
      const bar = this.document.createElement('progress');
      write(term, name);
      bar.value = share;
      bar.setAttribute('aria-label', say(name));
      row.classList.toggle('full', share >= 1);
      value.append(bar);
      row.append(term, value);
      return row;
    }));
  }

  /** @param {Calibration} calibration */
  lines({ figures, reasons, advice }) {
    const kinds = { figure: figures, reason: reasons, advice };
    const items = Object.entries(kinds).flatMap(([kind, texts]) => texts.map((text) => {
      const item = this.document.createElement('li');
      item.className = kind;
      write(item, text);
      return item;
    }));
    this.find('calibration-lines').replaceChildren(...items);
  }

  /**
   * Cells and outline lie on the preview, which shows the whole picture.
   * @param {Calibration} calibration
   */
  draw({ width, height, columns, cells, outline, blurred }) {
    const rows = Math.ceil(cells.length / Math.max(columns, 1));
    this.map.setAttribute('viewBox', `0 0 ${width} ${height}`);
    const shapes = cells.map((count, k) => this.shape('rect', {
      x: ((k % columns) * width) / columns,
      y: (Math.floor(k / columns) * height) / rows,
      width: width / columns,
      height: height / rows,
      class: `seen${count}`,
    }));
    if (outline.length >= 6) {
      const points = outline.map((share, k) => share * (k % 2 === 0 ? width : height)).join(' ');
      shapes.push(this.shape('polygon', { points, class: blurred ? 'outline blurred' : 'outline' }));
    }
    this.map.replaceChildren(...shapes);
  }

  /**
   * @param {string} name
   * @param {Record<string, string | number>} attributes
   * @returns {Element}
   */
  shape(name, attributes) {
    const shape = this.document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) shape.setAttribute(key, String(value));
    return shape;
  }
}

/** @param {Calibration['verdict']} verdict */
function verdictWords(verdict) {
  return verdict === 'good' ? 'Good. The profile is stored for this phone and lens.' : 'Usable, and stored. It could be better:';
}
