import assert from 'node:assert/strict';
import { test } from 'node:test';

import { edgesOf, shapesOf, wayOf } from '../../src/ui/sight_overlay.js';

/** @import {Sight} from '../../src/wire/protocol_types.js' */

/** @type {Sight} */
const SIGHT = {
  type: 'sight', width: 1280, height: 720, found: [0.25, 0.5, 0.5, 0.5], robot: [0.25, 0.5, 0.5, 0.75], goal: [0.3, 0.5],
  toward: null, distance_m: 2.44,
};

/** @param {Partial<Sight>} [change] */
const classes = (change) => shapesOf({ ...SIGHT, ...change }).map((shape) => shape['class']);

test('lights, robot, goal and distance lie where they are in the picture', () => {
  assert.deepEqual(classes(), ['goal', 'robot', 'robot', 'found', 'found', 'distance']);
  const shapes = shapesOf(SIGHT);
  const found = shapes.filter((shape) => shape['class'] === 'found');
  assert.deepEqual(found.map(({ cx, cy }) => [cx, cy]), [[320, 360], [640, 360]]);
  const label = shapes.at(-1);
  assert.equal(label?.text, '2.4 m');
  assert.equal(label?.['x'], 480);
  assert.ok(Number(label?.['y']) < 360 - 20, 'below are the buttons');
});

test('the distance stands below a robot that has no room above it', () => {
  const label = shapesOf({ ...SIGHT, robot: [0.25, 0.1, 0.5, 0.3] }).at(-1);
  assert.ok(Number(label?.['y']) > 0.3 * 720 + 60);
});

test('nothing known is nothing drawn', () => {
  assert.deepEqual(classes({ found: [], robot: [], goal: [], distance_m: null }), []);
});

test('a robot that is about to leave the picture marks the border', () => {
  assert.deepEqual(edgesOf([0.5, 0.5]), []);
  assert.deepEqual(edgesOf([0.02, 0.5, 0.4, 0.99]), ['left', 'bottom']);
  assert.deepEqual(edgesOf([0.98, 0.01]), ['right', 'top']);
  assert.deepEqual(edgesOf([]), []);
});

test('a robot outside has an arrow at the border, towards it, and words', () => {
  const shapes = shapesOf({ ...SIGHT, found: [], robot: [], goal: [], toward: Math.PI / 2 });
  assert.deepEqual(shapes.map((shape) => shape['class']), ['arrow']);
  const [, x, y, turn] = /translate\(([\d.]+) ([\d.]+)\) rotate\(([\d.]+)\)/.exec(String(shapes[0]?.['transform'])) ?? [];
  assert.ok(Math.abs(Number(x) - 640) < 1);
  assert.ok(Number(y) > 600 && Number(y) < 720);
  assert.equal(Number(turn), 90);
});

test('ways are said by eighths of a turn', () => {
  const said = [0, Math.PI / 4, Math.PI / 2, Math.PI, -Math.PI, -Math.PI / 2, -0.1].map(wayOf);
  assert.deepEqual(said, ['right', 'lower right', 'bottom', 'left', 'left', 'top', 'right']);
});
