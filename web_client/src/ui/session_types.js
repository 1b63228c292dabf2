/** What the phone page knows, what can happen to it, and what it then does. */

/** @import {Calibrate, Calibration, Refused, Status} from '../wire/protocol_types.js' */
/** @import {Problem} from '../wire/problems.js' */
/** @import {StopAnswer, StopEnd} from '../wire/stop.js' */

/** @typedef {Status['mode'] | 'NO_LINK' | 'NO_WORD'} ShownMode */

/** What is felt and heard. @typedef {ShownMode | 'STOP_LOST' | 'WEAK' | 'LIMIT' | 'EMPTY'} Signal */

/**
 * @typedef {object} Health
 * @property {import('../video/video_paths.js').PathName} path The way pictures go.
 * @property {number} fps Frames sent per second.
 * @property {string} eased What is kept back because the phone can't keep up, in a sign.
 * @property {number | null} rttMs Quickest way there and back of the last frames.
 * @property {number} imuHz
 * @property {number} kbps Video [kbit/s].
 */

/** @typedef {{ what: 'arm' | 'disarm', atMs: number, mode: ShownMode }} Asked */

/**
 * @typedef {object} State
 * @property {'welcome' | 'starting' | 'operating'} phase
 * @property {string} step What is being done while starting.
 * @property {Problem | null} problem What the person has to mend.
 * @property {{ text: string, untilMs: number } | null} notice A passing remark.
 * @property {boolean} linked The server has welcomed us.
 * @property {Status | null} status
 * @property {number} statusAtMs When it came.
 * @property {number} pressAtMode The count of presses when the robot's mode last changed.
 * @property {number} leftOfMs The most that was left until the ramp since it counts down.
 * @property {number} tickedMs When the page last had time for itself.
 * @property {boolean} heard It is young enough to be believed.
 * @property {boolean} held
 * @property {boolean} visible
 * @property {number} press Counts presses.
 * @property {bigint} nonce The newest one of a PING.
 * @property {boolean} stopping STOP was asked for and not yet confirmed.
 * @property {number} stopAtMs When it was asked for, or ended.
 * @property {StopAnswer | null} stopAnswer What the server said to it beside the socket.
 * @property {StopEnd} stopEnd How it ended, without a Status that shows it.
 * @property {boolean} standby Another phone leads: this one watches, and may ask.
 * @property {boolean} led This phone led, and nobody else since.
 * @property {number} freeMs Since when the lead is free to ask for; Infinity: it is not.
 * @property {string} you Id of this browser's pairing.
 * @property {boolean} known The server has let this browser in, at least once.
 * @property {Asked | null} asked Arm or disarm, while nothing shows that it was heard.
 * @property {boolean} motionSilent No motion sensor has answered.
 * @property {Health} health
 * @property {Calibration | null} calibration Of the camera, while there is something to tell.
 */

/**
 * @typedef {{ type: 'start' } | { type: 'paired' } | { type: 'stop_answer', answer: StopAnswer, now: number } | { type: 'step', text: string } | { type: 'problem', problem: Problem }
 *   | { type: 'started' } | { type: 'welcomed', you?: string } | { type: 'watching', you: string } | { type: 'take_lead' } | { type: 'disconnected' }
 *   | { type: 'status', status: Status, now: number } | { type: 'refused', refused: Refused, now: number }
 *   | { type: 'notice', text: string, now: number } | { type: 'ping', nonce: bigint }
 *   | { type: 'tick', now: number } | { type: 'press' } | { type: 'release' }
 *   | { type: 'visibility', visible: boolean } | { type: 'stop', now: number }
 *   | { type: 'stop_tick', now: number } | { type: 'ask', what: 'arm' | 'disarm', now: number } | { type: 'motion_silent', silent: boolean }
 *   | { type: 'health', health: Health } | { type: 'calibration', calibration: Calibration }
 *   | { type: 'calibrate', what: Calibrate['what'] }} Event
 */

/**
 * @typedef {{ type: 'touch' } | { type: 'command', what: 'arm' | 'disarm' | 'stop', ageMs: number }
 *   | { type: 'post_stop', ageMs: number } | { type: 'feel', mode: Signal } | { type: 'close_link' } | { type: 'stand_by' } | { type: 'ask_lead' }
 *   | { type: 'calibrate', what: Calibrate['what'] } | { type: 'tell', text: string }} Effect
 */

/** @typedef {{ state: State, effects: Effect[] }} Outcome */

/**
 * What people ask for.
 * @typedef {object} Requests
 * @property {() => void} onStart
 * @property {() => void} onReload
 * @property {() => void} onPress
 * @property {() => void} onRelease
 * @property {() => void} onStop
 * @property {() => void} onRequest
 * @property {(what: Calibrate['what']) => void} onCalibrate
 * @property {(requested: import('../video/video_paths.js').RequestedPath) => void} onPath
 * @property {() => void} onSound
 * @property {(() => void) | null} onFull Null where the page can't fill the screen.
 */

export {};
