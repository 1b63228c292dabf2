/** What the modes are called and what they mean to a person. */

/** @import {ShownMode} from './session_types.js' */

/** @type {Record<ShownMode, [string, string]>} */
export const MODE_WORDS = {
  DISARMED: ['DISARMED', 'Thrusters are off'],
  ARMED: ['ARMED', 'Ready to move'],
  TRACK: ['TRACK', 'The robot follows you'],
  COAST: ['COAST', 'The robot waits for news'],
  HOLD: ['HOLD', 'The robot keeps still'],
  RAMP: ['RAMP', 'Thrust fades to zero'],
  STOPPED: ['STOPPED', 'Thrust is off'],
  LOST: ['LOST', 'The control is silent'],
  NO_LINK: ['NO LINK', 'Connecting…'],
  NO_WORD: ['NO WORD', 'The server is silent'],
};
