import assert from 'node:assert/strict';
import { test } from 'node:test';

import { GravitySign, quaternionFromEuler, upInDevice } from '../../src/motion/attitude.js';

/** @param {number[]} actual @param {number[]} expected */
function near(actual, expected) {
  actual.forEach((value, i) => assert.ok(Math.abs(value - (expected[i] ?? NaN)) < 1e-9, `${actual} ${expected}`));
}

/** Product of rotation matrices, row by row. @param {number[][]} a @param {number[][]} b */
const product = (a, b) => a.map((row) => [0, 1, 2].map(
  (j) => row.reduce((sum, value, k) => sum + value * (b[k]?.[j] ?? NaN), 0),
));

/** The W3C composition, as matrices. @param {number} alpha @param {number} beta @param {number} gamma */
function w3c(alpha, beta, gamma) {
  const [a, b, g] = [alpha, beta, gamma].map((deg) => (deg * Math.PI) / 180);
  const [ca, sa, cb, sb, cg, sg] = [a, b, g].flatMap((x = 0) => [Math.cos(x), Math.sin(x)]);
  const z = [[ca, -(sa ?? 0), 0], [sa, ca, 0], [0, 0, 1]];
  const x = [[1, 0, 0], [0, cb, -(sb ?? 0)], [0, sb, cb]];
  const y = [[cg, 0, sg], [0, 1, 0], [-(sg ?? 0), 0, cg]];
  return product(product(/** @type {number[][]} */ (z), /** @type {number[][]} */ (x)), /** @type {number[][]} */ (y));
}

test('the quaternion is the Z-X′-Y″ composition, whatever the ranges of the angles', () => {
  for (const [alpha, beta, gamma] of [[10, 20, 30], [350, -100, 80], [200, 60, 170], [0, 90, 0]]) {
    const [w, x, y, z] = quaternionFromEuler(alpha ?? 0, beta ?? 0, gamma ?? 0);
    near([w * w + x * x + y * y + z * z], [1]);
    const third = w3c(alpha ?? 0, beta ?? 0, gamma ?? 0)[2] ?? [];
    near(upInDevice([w, x, y, z]), third);
    const first = w3c(alpha ?? 0, beta ?? 0, gamma ?? 0)[0] ?? [];
    near([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], first);
  }
});

test('up is out of the screen lying flat, along the top upright, along the right edge on its left side', () => {
  near(upInDevice(quaternionFromEuler(123, 0, 0)), [0, 0, 1]);
  near(upInDevice(quaternionFromEuler(45, 90, 0)), [0, 1, 0]);
  near(upInDevice(quaternionFromEuler(45, 0, -90)), [1, 0, 0]);
});

test('the platform’s sign stands while the attitude agrees with it', () => {
  const sign = new GravitySign(true);
  for (let i = 0; i < 500; i++) assert.equal(sign.judge([0, -9.8, 0], quaternionFromEuler(0, 90, 0)), -1);
});

test('a steadily contradicting attitude turns the sign, once', () => {
  const sign = new GravitySign(true);
  for (let i = 0; i < 200; i++) sign.judge([0, 9.8, 0], quaternionFromEuler(0, 90, 0));
  assert.deepEqual([sign.sign, sign.against], [1, 0]);
});

test('a shake, a fall or a missing attitude says nothing about the sign', () => {
  const sign = new GravitySign(false);
  const upright = quaternionFromEuler(0, 90, 0);
  for (let i = 0; i < 500; i++) {
    sign.judge([0, -25, 0], upright);
    sign.judge([0, -0.4, 0], upright);
    sign.judge([0, -9.8, 0], null);
    sign.judge([9.8, 0, 0], upright);
  }
  assert.equal(sign.sign, 1);
});
