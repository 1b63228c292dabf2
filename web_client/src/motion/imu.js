/**
 * The phone's motion sensors, whichever interface delivers them best, in one form: W3C device axes (x right,
 * y top, z out of the screen), rad/s, m/s² with +9.8 up at rest, attitude as a quaternion.
 */

/** @import {Motion, Quaternion, ScreenAngle, Triple} from '../wire/protocol.js' */

import { Problem } from '../wire/problems.js';
import { eventUs, nowUs } from '../wire/clock.js';
import { GravitySign, quaternionFromEuler } from './attitude.js';

export const RATE_HZ = 60;
/** Readings closer than this are left out: some browsers deliver 200 a second [µs]. */
const CLOSEST_US = 8000;
const MAX_RATE = 70;
const MAX_ACCELERATION = 320;
const SETTLE_MS = 2000;
/** With fewer readings a second, the other interface is tried. */
const ENOUGH_HZ = 40;
const RADIANS = Math.PI / 180;

/** @typedef {(tUs: number, motion: Motion) => void} OnMotion */

/**
 * What a sensor of the Generic Sensor API has.
 * @typedef {EventTarget & { start(): void, stop(): void, timestamp: number | null, x?: number | null,
 *   y?: number | null, z?: number | null, quaternion?: number[] | null }} Sensor
 * @typedef {new (options: object) => Sensor} SensorClass
 */

/**
 * What is needed of the browser; `window` has it all.
 * @typedef {object} Surroundings
 * @property {EventTarget} events Where devicemotion and deviceorientation are fired.
 * @property {{ now(): number }} performance
 * @property {() => ScreenAngle} screenAngle
 * @property {boolean} negated Whether this platform's accelerations have the opposite sign (WebKit).
 * @property {(callback: () => void, ms: number) => any} setTimeout
 * @property {{ Gyroscope?: SensorClass, Accelerometer?: SensorClass,
 *   RelativeOrientationSensor?: SensorClass }} sensors
 */

/**
 * Asks for the motion sensors; must be called straight from a tap.
 * @param {Record<string, any>} scope The window.
 * @returns {Promise<void>}
 */
export async function requestMotionPermission(scope) {
  const asked = ['DeviceMotionEvent', 'DeviceOrientationEvent']
    .map((name) => scope[name])
    .filter((type) => typeof type?.requestPermission === 'function')
    .map((type) => type.requestPermission());
  const answers = await Promise.allSettled(asked);
  const denied = answers.find((answer) => answer.status === 'rejected' || answer.value !== 'granted');
  if (denied === undefined) return;
  throw new Problem('motion_denied', denied.status === 'rejected' ? String(denied.reason) : '');
}

/** Motion from the best interface; changes to the other one when it fails or is slow. */
export class Imu {
  /**
   * @param {Surroundings} surroundings
   * @param {OnMotion} onMotion
   */
  constructor(surroundings, onMotion) {
    this.surroundings = surroundings;
    this.onMotion = onMotion;
    this.sign = new GravitySign(surroundings.negated);
    this.lastUs = -Infinity;
    this.count = 0;
    /** @type {Quaternion | null} */
    this.orientation = null;
    /** Ends the running interface. */
    this.stop = () => {};
    this.source = this.hasSensors ? 'Generic Sensor' : 'DeviceMotion';
  }

  get hasSensors() {
    const { Gyroscope, Accelerometer } = this.surroundings.sensors;
    return Gyroscope !== undefined && Accelerometer !== undefined;
  }

  start() {
    if (this.source === 'DeviceMotion') {
      this.stop = this.listenToEvents();
      return;
    }
    this.stop = this.listenToSensors();
    this.surroundings.setTimeout(() => {
      if (this.count < (ENOUGH_HZ * SETTLE_MS) / 1000) this.useEvents();
    }, SETTLE_MS);
  }

  useEvents() {
    if (this.source === 'DeviceMotion') return;
    this.stop();
    this.source = 'DeviceMotion';
    this.stop = this.listenToEvents();
  }

  /** @returns {() => void} */
  listenToEvents() {
    const { events } = this.surroundings;
    /** @param {globalThis.Event} event */
    const onMotion = (event) => this.motionEvent(/** @type {DeviceMotionEvent} */ (event));
    /** @param {globalThis.Event} event */
    const onOrientation = (event) => this.orientationEvent(/** @type {DeviceOrientationEvent} */ (event));
    events.addEventListener('devicemotion', onMotion);
    events.addEventListener('deviceorientation', onOrientation);
    return () => {
      events.removeEventListener('devicemotion', onMotion);
      events.removeEventListener('deviceorientation', onOrientation);
    };
  }

  /** @returns {() => void} */
  listenToSensors() {
    const { Gyroscope, Accelerometer, RelativeOrientationSensor } = this.surroundings.sensors;
    if (Gyroscope === undefined || Accelerometer === undefined) return () => {};
    const options = { frequency: RATE_HZ, referenceFrame: 'device' };
    try {
      const gyroscope = new Gyroscope(options);
      const accelerometer = new Accelerometer(options);
      const attitude = RelativeOrientationSensor ? new RelativeOrientationSensor(options) : null;
      gyroscope.addEventListener('reading', () => this.sensorReading(gyroscope, accelerometer));
      attitude?.addEventListener('reading', () => this.attitudeReading(attitude));
      for (const sensor of [gyroscope, accelerometer]) {
        sensor.addEventListener('error', () => this.useEvents());
      }
      const all = [gyroscope, accelerometer, ...(attitude ? [attitude] : [])];
      all.forEach((sensor) => sensor.start());
      return () => all.forEach((sensor) => sensor.stop());
    } catch { // a policy forbids them: the constructor throws
      this.surroundings.setTimeout(() => this.useEvents(), 0);
      return () => {};
    }
  }

  /** @param {DeviceMotionEvent} event */
  motionEvent(event) {
    const { rotationRate, accelerationIncludingGravity: a } = event;
    const rate = tripleOf(rotationRate?.alpha, rotationRate?.beta, rotationRate?.gamma);
    const acceleration = tripleOf(a?.x, a?.y, a?.z);
    if (rate === null || acceleration === null) return;
    this.deliver(event.timeStamp, scaled(rate, RADIANS), acceleration);
  }

  /** @param {DeviceOrientationEvent} event */
  orientationEvent(event) {
    const angles = tripleOf(event.alpha, event.beta, event.gamma);
    if (angles !== null) this.orientation = quaternionFromEuler(...angles);
  }

  /**
   * @param {Sensor} gyroscope
   * @param {Sensor} accelerometer
   */
  sensorReading(gyroscope, accelerometer) {
    const rate = tripleOf(gyroscope.x, gyroscope.y, gyroscope.z);
    const acceleration = tripleOf(accelerometer.x, accelerometer.y, accelerometer.z);
    if (rate !== null && acceleration !== null) this.deliver(gyroscope.timestamp, rate, acceleration);
  }

  /** @param {Sensor} sensor */
  attitudeReading(sensor) {
    const [x, y, z, w] = sensor.quaternion ?? [];
    if ([x, y, z, w].every(Number.isFinite)) {
      this.orientation = /** @type {Quaternion} */ ([w, x, y, z]);
    }
  }

  /**
   * @param {number | null} timeStampMs
   * @param {Triple} rate [rad/s]
   * @param {Triple} rawAcceleration [m/s²], in the platform's sign.
   */
  deliver(timeStampMs, rate, rawAcceleration) {
    const tUs = eventUs(timeStampMs, nowUs(this.surroundings.performance));
    if (tUs - this.lastUs < CLOSEST_US) return;
    if (!within(rate, MAX_RATE) || !within(rawAcceleration, MAX_ACCELERATION)) return;
    this.lastUs = tUs;
    this.count += 1;
    const sign = this.sign.judge(rawAcceleration, this.orientation);
    this.onMotion(tUs, {
      rotation_rate: rate,
      acceleration: scaled(rawAcceleration, sign),
      orientation_wxyz: this.orientation,
      screen_angle_deg: this.surroundings.screenAngle(),
    });
  }
}

/**
 * @param {number | null | undefined} x
 * @param {number | null | undefined} y
 * @param {number | null | undefined} z
 * @returns {Triple | null} Null unless all three are finite numbers.
 */
function tripleOf(x, y, z) {
  const triple = [x, y, z];
  return triple.every(Number.isFinite) ? /** @type {Triple} */ (triple) : null;
}

/**
 * @param {Triple} triple
 * @param {number} factor
 * @returns {Triple}
 */
function scaled(triple, factor) {
  return [triple[0] * factor, triple[1] * factor, triple[2] * factor];
}

/**
 * @param {Triple} triple
 * @param {number} limit
 */
function within(triple, limit) {
  return triple.every((value) => Math.abs(value) <= limit);
}

/**
 * How far the screen is turned from the device's natural orientation.
 * @param {{ orientation?: { angle: number } }} screen
 * @param {number | undefined} legacy `window.orientation`, −90 to 180.
 * @returns {ScreenAngle}
 */
export function screenAngleOf(screen, legacy) {
  const angle = (((screen.orientation?.angle ?? legacy ?? 0) % 360) + 360) % 360;
  return angle === 90 || angle === 180 || angle === 270 ? angle : 0;
}
