/** Attitude from the browser's angles, and which way this phone says is up. */

/** @import {Quaternion, Triple} from '../wire/protocol.js' */

const STANDARD_GRAVITY = 9.80665;
/** Readings that agree before the sign is turned. */
const NEEDED = 45;

/**
 * Device to earth from the browser's Euler angles: Z (alpha), X′ (beta), Y″ (gamma).
 *
 * The angles are singular with the phone upright, this page's usual pose, so they are turned into a
 * quaternion at once and never filtered. iOS gives other ranges of the same composition.
 * @param {number} alphaDeg
 * @param {number} betaDeg
 * @param {number} gammaDeg
 * @returns {Quaternion} w ≥ 0.
 */
export function quaternionFromEuler(alphaDeg, betaDeg, gammaDeg) {
  const half = Math.PI / 360;
  const [cz, sz] = [Math.cos(alphaDeg * half), Math.sin(alphaDeg * half)];
  const [cx, sx] = [Math.cos(betaDeg * half), Math.sin(betaDeg * half)];
  const [cy, sy] = [Math.cos(gammaDeg * half), Math.sin(gammaDeg * half)];
  const w = cz * cx * cy - sz * sx * sy;
  const x = cz * sx * cy - sz * cx * sy;
  const y = cz * cx * sy + sz * sx * cy;
  const z = sz * cx * cy + cz * sx * sy;
  return w < 0 ? [-w, -x, -y, -z] : [w, x, y, z];
}

/**
 * The earth's up in the device's axes.
 * @param {Quaternion} wxyz Device to earth.
 * @returns {Triple}
 */
export function upInDevice([w, x, y, z]) {
  return [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
}

/**
 * Whether the accelerometer must be negated to read +9.8 up at rest.
 *
 * The platform gives a first guess; while the phone is nearly at rest the fused attitude must agree with it,
 * and overrules it when it steadily does not.
 */
export class GravitySign {
  /** @param {boolean} negated The platform's guess. */
  constructor(negated) {
    /** @type {1 | -1} */
    this.sign = negated ? -1 : 1;
    this.against = 0;
  }

  /**
   * @param {Triple} raw Acceleration with gravity in the platform's sign [m/s²].
   * @param {Quaternion | null} orientation
   * @returns {1 | -1} What to multiply `raw` with.
   */
  judge(raw, orientation) {
    if (orientation === null) return this.sign;
    const up = upInDevice(orientation);
    const length = Math.hypot(...raw);
    const cosine = (this.sign * (raw[0] * up[0] + raw[1] * up[1] + raw[2] * up[2])) / (length || 1);
    if (Math.abs(length - STANDARD_GRAVITY) > 1 || Math.abs(cosine) < 0.9) return this.sign;
    this.against = cosine < 0 ? this.against + 1 : 0;
    if (this.against >= NEEDED) {
      this.sign = this.sign === 1 ? -1 : 1;
      this.against = 0;
    }
    return this.sign;
  }
}
