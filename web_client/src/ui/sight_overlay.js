/** What the server knows of the picture, drawn on it: lights found, the robot, where it should be, how to find it. */

/** @import {Sight} from '../wire/protocol_types.js' */

import { write } from '../words/say.js';

const SVG = 'http://www.w3.org/2000/svg';
/** Older than this it is wiped off: the phone has moved on [ms]. */
const LIFE_MS = 600;
/** Share of the picture from its border within which the robot is about to leave it. */
const EDGE = 0.08;
const WAYS = ['right', 'lower right', 'bottom', 'lower left', 'left', 'upper left', 'top', 'upper right'];

export class SightOverlay {
  /** @param {Document} document */
  constructor(document) {
    this.document = document;
    /** @param {string} id */
    const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
    this.map = find('sight');
    this.words = find('toward');
    this.drawnMs = Infinity;
  }

  /**
   * @param {Sight} sight
   * @param {number} now
   */
  draw(sight, now) {
    this.drawnMs = now;
    const { width, height, toward } = sight;
    this.map.setAttribute('viewBox', `0 0 ${width} ${height}`);
    this.map.replaceChildren(...shapesOf(sight).map((shape) => this.element(shape)));
    this.say(toward === null ? '' : `The robot is beyond the ${wayOf(toward)} of the picture.`);
  }

  /** @param {number} now */
  age(now) {
    if (now - this.drawnMs < LIFE_MS) return;
    this.drawnMs = Infinity;
    this.map.replaceChildren();
    this.say('');
  }

  /** @param {string} words */
  say(words) {
    write(this.words, words);
    this.words.hidden = words === '';
  }

  /**
   * @param {Shape} shape
   * @returns {Element}
   */
  element({ name, text, ...attributes }) {
    const element = this.document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
    if (text) write(element, text);
    return element;
  }
}

/** @typedef {{ name: string, text?: string, [attribute: string]: string | number | undefined }} Shape */

/**
 * @param {Sight} sight
 * @returns {Shape[]}
 */
export function shapesOf({ width, height, found, robot, goal, toward, distance_m: distance }) {
  const size = 0.02 * Math.max(width, height);
  const robotAt = pointsOf(robot, width, height);
  /** @type {Shape[]} */
  const shapes = edgesOf(robot).map((edge) => ({ name: 'path', class: 'edge', d: edgePath(edge, width, height) }));
  for (const [x, y] of pointsOf(goal, width, height)) shapes.push({ name: 'rect', class: 'goal', x: x - size, y: y - size, width: 2 * size, height: 2 * size });
  for (const [cx, cy] of robotAt) shapes.push({ name: 'circle', class: 'robot', cx, cy, r: 0.35 * size });
  for (const [cx, cy] of pointsOf(found, width, height)) shapes.push({ name: 'circle', class: 'found', cx, cy, r: size });
  if (toward !== null) shapes.push(arrowOf(toward, width, height));
  else if (distance !== null && robotAt.length > 0) {
    const x = robotAt.reduce((sum, [at]) => sum + at, 0) / robotAt.length;
    const ys = robotAt.map(([, at]) => at);
    const above = Math.min(...ys) - 2 * size; // below are the page's buttons
    const y = above > 3 * size ? above : Math.max(...ys) + 4 * size;
    shapes.push({ name: 'text', class: 'distance', x, y, 'font-size': 3 * size, text: `${distance.toFixed(1)} m` });
  }
  return shapes;
}

/**
 * Which borders the robot is about to leave by.
 * @param {number[]} robot
 * @returns {('left' | 'right' | 'top' | 'bottom')[]}
 */
export function edgesOf(robot) {
  const points = pointsOf(robot, 1, 1);
  const xs = points.map(([x]) => x);
  const ys = points.map(([, y]) => y);
  /** @type {[('left' | 'right' | 'top' | 'bottom'), boolean][]} */
  const near = [
    ['left', Math.min(...xs) < EDGE], ['right', Math.max(...xs) > 1 - EDGE],
    ['top', Math.min(...ys) < EDGE], ['bottom', Math.max(...ys) > 1 - EDGE],
  ];
  return near.filter(([, is]) => is).map(([edge]) => edge);
}

/**
 * @param {number} toward Clockwise from the right [rad].
 * @returns {string}
 */
export function wayOf(toward) {
  return WAYS[(Math.round((4 * toward) / Math.PI) + 8) % 8] ?? '';
}

/**
 * At the border, in that direction.
 * @param {number} toward
 * @param {number} width
 * @param {number} height
 * @returns {Shape}
 */
function arrowOf(toward, width, height) {
  const [dx, dy] = [Math.cos(toward), Math.sin(toward)];
  const far = 0.42 * Math.min(width / Math.max(Math.abs(dx), 1e-6), height / Math.max(Math.abs(dy), 1e-6));
  const [x, y] = [width / 2 + far * dx, height / 2 + far * dy];
  const size = 0.05 * Math.max(width, height);
  const turn = (180 * toward) / Math.PI;
  return { name: 'path', class: 'arrow', d: 'M1 0-1-1-.5 0-1 1Z', transform: `translate(${x} ${y}) rotate(${turn}) scale(${size})` };
}

/**
 * @param {'left' | 'right' | 'top' | 'bottom'} edge
 * @param {number} width
 * @param {number} height
 */
function edgePath(edge, width, height) {
  if (edge === 'left' || edge === 'right') return `M${edge === 'left' ? 0 : width} 0V${height}`;
  return `M0 ${edge === 'top' ? 0 : height}H${width}`;
}

/**
 * @param {number[]} shares x and y in turn.
 * @param {number} width
 * @param {number} height
 * @returns {[number, number][]}
 */
function pointsOf(shares, width, height) {
  /** @type {[number, number][]} */
  const points = [];
  for (let k = 0; k + 1 < shares.length; k += 2) points.push([width * (shares[k] ?? 0), height * (shares[k + 1] ?? 0)]);
  return points;
}
