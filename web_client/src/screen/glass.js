/** What a screen draws, without drawing: fiducials, lights at the time of a frame, the server's time, its own size. */

/** @import {ScreenLights} from '../wire/protocol_types.js' */

/** Four cells of each marker's code a row, 1 is light; top left, top right, bottom right, bottom left. */
export const CODES = Object.freeze([
  ['0110', '0101', '0010', '0010'],
  ['0110', '1101', '1100', '1011'],
  ['0110', '0111', '1000', '1101'],
  ['0110', '1101', '0011', '0001'],
]);
/** Cells across a marker with its dark border and its quiet zone. */
export const CELLS = 8;
/** Side of a marker with its quiet zone, of the glass's height. */
export const TILE_SHARE = 0.2;
/** Width of a bank card [mm], ISO 7810. */
export const CARD_MM = 85.6;
export const CARD_HIGH_MM = 53.98;
/** What is older is drawn no more: the robot's light is lost, as if it had gone. */
export const OLD_MS = 150;
/** A light is no smaller on the glass [px]. */
export const LEAST_DOT_PX = 10;
const ANSWERS = 50;
/** With frames that stay longer, lights lag by up to twice as much as on average, and nobody leads well by them. */
const SLOW_MS = 36;

/**
 * Squares [x, y, side] of the light cells, in pixels from top left.
 * @param {number} width
 * @param {number} height
 * @returns {[number, number, number][]}
 */
export function lightCells(width, height) {
  const cell = (TILE_SHARE * height) / CELLS;
  const [right, low] = [width - CELLS * cell, height - CELLS * cell];
  /** @type {[number, number][]} */
  const starts = [[0, 0], [right, 0], [right, low], [0, low]];
  /** @type {[number, number, number][]} */
  const squares = [];
  starts.forEach(([x, y], k) => {
    for (let row = 0; row < CELLS; row += 1) {
      for (let column = 0; column < CELLS; column += 1) {
        const isQuiet = [row, column].some((at) => at === 0 || at === CELLS - 1);
        if (isQuiet || CODES[k]?.[row - 2]?.[column - 2] === '1') squares.push([x + column * cell, y + row * cell, cell]);
      }
    }
  });
  return squares;
}

/** The server's clock, by the answer that came back fastest lately. */
export class ServerClock {
  /** @type {{ tripMs: number, aheadMs: number }[]} */
  answers = [];

  /**
   * @param {number} pageMs When it was asked, on the page's clock.
   * @param {number} serverMs
   * @param {number} nowMs When the answer came, on the page's clock.
   */
  heard(pageMs, serverMs, nowMs) {
    this.answers.push({ tripMs: nowMs - pageMs, aheadMs: serverMs - (pageMs + nowMs) / 2 });
    this.answers.splice(0, this.answers.length - ANSWERS);
  }

  /**
   * @param {number} pageMs
   * @returns {number | null} [ms]; null before the first answer.
   */
  at(pageMs) {
    const [first, ...others] = this.answers;
    if (first === undefined) return null;
    const best = others.reduce((least, one) => (one.tripMs < least.tripMs ? one : least), first);
    return pageMs + best.aheadMs;
  }
}

/**
 * Lights of a frame [x, y] in mm right and up of the middle.
 * @param {ScreenLights} lights
 * @param {number} frameMs The frame's time on the server's clock.
 * @param {number} heightMm Of the glass, whose upper rows shine first ...
 * @param {number} scanMs ... and the last so much later.
 * @returns {[number, number][]}
 */
export function lightsAt(lights, frameMs, heightMm, scanMs) {
  if (lights.phase === 'sweep') return [[lights.sweep_mm * Math.sin((2 * Math.PI * frameMs) / 1000), 0]];
  if (lights.phase === 'search' || lights.lag_ms === null) return [];
  /** @type {[number, number][]} */
  const shown = [];
  const middleMs = frameMs + lights.lag_ms;
  for (let led = 0; led < (lights.places_mm[0]?.length ?? 0) / 2; led += 1) {
    const near = placeAt(lights, led, middleMs);
    const place = near && placeAt(lights, led, middleMs - (near[1] / heightMm) * scanMs);
    if (place !== null) shown.push(place);
  }
  return shown;
}

/**
 * @param {ScreenLights} lights
 * @param {number} led
 * @param {number} tMs Of its light.
 * @returns {[number, number] | null}
 */
function placeAt({ places_mm: rows, t_ms, step_ms }, led, tMs) {
  const at = Math.min(Math.max((tMs - t_ms) / step_ms, 0), rows.length - 1);
  const before = Math.min(Math.floor(at), rows.length - 2);
  const [x, y] = [0, 1].map((axis) => {
    const from = rows[before]?.[2 * led + axis] ?? NaN;
    return from + (at - before) * ((rows[before + 1]?.[2 * led + axis] ?? NaN) - from);
  });
  return x !== undefined && y !== undefined && Number.isFinite(x + y) ? [x, y] : null;
}

/** Median time from frame to frame. */
export class FramePeriod {
  /** @type {number[]} */
  gaps = [];
  last = NaN;

  /** @param {number} frameMs */
  tick(frameMs) {
    if (frameMs > this.last) this.gaps.push(frameMs - this.last);
    this.gaps.splice(0, this.gaps.length - ANSWERS);
    this.last = frameMs;
  }

  /** [ms]; 60 Hz before it is known. */
  get ms() {
    const sorted = [...this.gaps].sort((a, b) => a - b);
    return sorted[Math.floor(sorted.length / 2)] ?? 1000 / 60;
  }
}

/**
 * How wide a CSS pixel is, as somebody set it for a screen of this kind; else as usual there.
 * @param {string | null} stored
 * @param {number} density Device pixels of a CSS pixel.
 */
export function mmPerPixel(stored, density) {
  const mm = Number(stored);
  if (mm > 0.03 && mm < 2) return mm;
  return density > 1.5 ? 0.17 : 0.25;
}

/**
 * The name under which a screen's size is remembered.
 * @param {{ width: number, height: number }} screen
 * @param {number} density
 */
export function sizeKey({ width, height }, density) {
  return `lightleash-mm ${width}x${height}@${density}`;
}

/**
 * What is to be said of frames that come so slowly, as of a television at 24 Hz, or "".
 * @param {number} periodMs
 */
export function slowness(periodMs) {
  if (!(periodMs > SLOW_MS)) return '';
  return `This screen shows only ${Math.round(1000 / periodMs)} pictures a second: set it to 60 Hz.`;
}
