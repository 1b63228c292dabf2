/** Small graphs of the last seconds. */

import { say } from '../words/say.js';

/** @typedef {{ values: readonly (number | null)[], colour: string }} Line */

/**
 * The end of a scale that stays put while values wander: 1, 2 or 5 times a power of ten.
 * @param {number} largest
 */
export function niceEnd(largest) {
  if (!(largest > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(largest));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= largest) ?? 10;
  return step * power;
}

/**
 * Draws lines over the same slots, newest at the right; null leaves a gap.
 * @param {HTMLCanvasElement} canvas
 * @param {Line[]} lines
 * @param {number} slots
 * @param {number} pixelRatio
 */
export function drawLines(canvas, lines, slots, pixelRatio) {
  const width = Math.round(canvas.clientWidth * pixelRatio);
  const height = Math.round(canvas.clientHeight * pixelRatio);
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const context = canvas.getContext('2d');
  if (context === null || width === 0) return;
  const known = lines.flatMap((line) => line.values.filter((value) => value !== null));
  const end = niceEnd(Math.max(0, ...known));
  context.clearRect(0, 0, width, height);
  context.lineWidth = 1.6 * pixelRatio;
  for (const { values, colour } of lines) {
    context.strokeStyle = colour;
    trace(context, values, (i) => ((slots - values.length + i) / (slots - 1)) * width,
      (value) => height - 2 - (value / end) * (height - 4));
  }
  label(context, say(known.length > 0 ? String(end) : 'nothing yet'), pixelRatio);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {readonly (number | null)[]} values
 * @param {(i: number) => number} x
 * @param {(value: number) => number} y
 */
function trace(context, values, x, y) {
  let drawing = false;
  context.beginPath();
  values.forEach((value, i) => {
    if (value !== null && drawing) context.lineTo(x(i), y(value));
    else if (value !== null) context.moveTo(x(i), y(value));
    drawing = value !== null;
  });
  context.stroke();
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {string} text
 * @param {number} pixelRatio
 */
function label(context, text, pixelRatio) {
  context.fillStyle = '#a3b0c3';
  context.font = `${11 * pixelRatio}px system-ui, sans-serif`;
  context.textBaseline = 'top';
  context.fillText(text, 5 * pixelRatio, 4 * pixelRatio);
}
