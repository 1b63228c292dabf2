import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Imu, requestMotionPermission, screenAngleOf } from '../../src/motion/imu.js';
import { FakeTime } from '../fakes.js';

/** @import {Motion} from '../../src/wire/protocol.js' */

class FakeSensor extends EventTarget {
  /** @type {Record<string, FakeSensor>} */
  static running = {};

  x = 0;
  y = 0;
  z = 0;
  quaternion = [0, 0, 0, 1];
  timestamp = 0;

  start() {
    FakeSensor.running[this.constructor.name] = this;
  }

  stop() {
    delete FakeSensor.running[this.constructor.name];
  }
}
class Gyroscope extends FakeSensor {}
class Accelerometer extends FakeSensor {}
class RelativeOrientationSensor extends FakeSensor {}

/** @param {{ negated?: boolean, sensors?: object }} options */
function imuOf({ negated = false, sensors = {} } = {}) {
  const time = new FakeTime();
  time.ms = 5000;
  const events = new EventTarget();
  /** @type {{ tUs: number, motion: Motion }[]} */
  const got = [];
  const imu = new Imu({
    events, performance: time, screenAngle: () => 90, negated, setTimeout: time.setTimeout,
    sensors: /** @type {any} */ (sensors),
  }, (tUs, motion) => got.push({ tUs, motion }));
  imu.start();
  /** @param {string} type @param {object} parts */
  const fire = (type, parts) => {
    time.advance(16);
    events.dispatchEvent(Object.defineProperties(
      Object.assign(new Event(type), parts), { timeStamp: { value: time.ms - 2 } },
    ));
  };
  return { imu, time, got, fire };
}

const REST = { x: 0, y: 9.8, z: 0 };

test('devicemotion becomes rad/s about x, y, z with the time of its event', () => {
  const { got, fire } = imuOf();
  fire('devicemotion', {
    rotationRate: { alpha: 180, beta: 90, gamma: -45 }, accelerationIncludingGravity: REST,
  });
  assert.equal(got[0]?.tUs, 5014e3);
  assert.deepEqual(got[0]?.motion, {
    rotation_rate: [Math.PI, Math.PI / 2, -Math.PI / 4], acceleration: [0, 9.8, 0],
    orientation_wxyz: null, screen_angle_deg: 90,
  });
});

test('WebKit’s negated accelerations are turned to +9.8 up', () => {
  const { got, fire } = imuOf({ negated: true });
  fire('deviceorientation', { alpha: 0, beta: 90, gamma: 0 });
  fire('devicemotion', {
    rotationRate: { alpha: 0, beta: 0, gamma: 0 }, accelerationIncludingGravity: { x: 0, y: -9.8, z: 0 },
  });
  assert.equal(got[0]?.motion.acceleration[1], 9.8);
});

test('a silent orientation is a still one: the last is kept', () => {
  const { got, fire } = imuOf();
  fire('deviceorientation', { alpha: 0, beta: 90, gamma: 0 });
  for (let i = 0; i < 100; i++) {
    fire('devicemotion', { rotationRate: { alpha: 0, beta: 0, gamma: 0 }, accelerationIncludingGravity: REST });
  }
  assert.equal(got.length, 100);
  assert.ok(Math.abs((got[99]?.motion.orientation_wxyz?.[1] ?? 0) - Math.SQRT1_2) < 1e-9);
});

test('missing, endless or impossible readings are not sent', () => {
  const { got, fire } = imuOf();
  const rate = { alpha: 0, beta: 0, gamma: 0 };
  fire('devicemotion', { rotationRate: null, accelerationIncludingGravity: REST });
  fire('devicemotion', { rotationRate: rate, accelerationIncludingGravity: null });
  fire('devicemotion', { rotationRate: { ...rate, beta: null }, accelerationIncludingGravity: REST });
  fire('devicemotion', { rotationRate: { ...rate, beta: NaN }, accelerationIncludingGravity: REST });
  fire('devicemotion', { rotationRate: { ...rate, beta: 5000 }, accelerationIncludingGravity: REST });
  fire('deviceorientation', { alpha: null, beta: null, gamma: null });
  assert.deepEqual(got, []);
});

test('Generic Sensors are preferred and dated by the hardware', () => {
  const { got, imu } = imuOf({ sensors: { Gyroscope, Accelerometer, RelativeOrientationSensor } });
  const { Gyroscope: gyroscope, Accelerometer: accelerometer, RelativeOrientationSensor: attitude } = FakeSensor.running;
  Object.assign(accelerometer ?? {}, REST);
  Object.assign(attitude ?? {}, { quaternion: [0.1, 0.2, 0.3, 0.9] });
  attitude?.dispatchEvent(new Event('reading'));
  Object.assign(gyroscope ?? {}, { x: 0.5, timestamp: 4990 });
  gyroscope?.dispatchEvent(new Event('reading'));
  assert.equal(imu.source, 'Generic Sensor');
  assert.equal(got[0]?.tUs, 4990e3);
  assert.deepEqual(got[0]?.motion.rotation_rate, [0.5, 0, 0]);
  assert.deepEqual(got[0]?.motion.orientation_wxyz, [0.9, 0.1, 0.2, 0.3]);
});

test('a refused sensor, a slow one and one that throws give way to devicemotion', () => {
  class Throwing extends FakeSensor {
    start() {
      throw new Error('denied by policy');
    }
  }
  for (const spoil of ['error', 'slow', 'throw']) {
    const sensors = spoil === 'throw'
      ? { Gyroscope: Throwing, Accelerometer } : { Gyroscope, Accelerometer };
    const { got, imu, time, fire } = imuOf({ sensors });
    if (spoil === 'error') FakeSensor.running.Gyroscope?.dispatchEvent(new Event('error'));
    time.advance(2001);
    assert.equal(imu.source, 'DeviceMotion', spoil);
    fire('devicemotion', { rotationRate: { alpha: 0, beta: 0, gamma: 0 }, accelerationIncludingGravity: REST });
    assert.equal(got.length, 1, spoil);
  }
});

test('two hundred readings a second are thinned to at most 125', () => {
  const { got, imu, time } = imuOf();
  for (let i = 0; i < 200; i++) {
    time.advance(5);
    imu.deliver(time.ms, [0, 0, 0], [0, 9.8, 0]);
  }
  assert.equal(got.length, 100);
});

test('permission: granted where nobody asks, a problem where it is denied', async () => {
  await requestMotionPermission({});
  await requestMotionPermission({ DeviceMotionEvent: { requestPermission: async () => 'granted' } });
  for (const requestPermission of [async () => 'denied', () => Promise.reject(new Error('no tap'))]) {
    await assert.rejects(requestMotionPermission({ DeviceMotionEvent: { requestPermission } }), {
      code: 'motion_denied',
    });
  }
});

test('the screen’s angle is 0, 90, 180 or 270, from new and old interfaces', () => {
  assert.equal(screenAngleOf({ orientation: { angle: 270 } }, undefined), 270);
  assert.equal(screenAngleOf({}, -90), 270);
  assert.equal(screenAngleOf({}, 90), 90);
  assert.equal(screenAngleOf({}, undefined), 0);
});
