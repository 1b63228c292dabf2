/**
 * The JSON messages between the pages and the server, as in `server/messages.py`.
 */

/**
 * Page → server, first: who is there.
 * @typedef {object} Hello
 * @property {'hello'} type
 * @property {number} version Protocol version of the page.
 * @property {'operator' | 'supervisor' | 'video'} role
 * @property {string} device Names the camera's calibration.
 * @property {string} session On the video socket: the session of the operator it belongs to.
 * @property {string} sensors Which interface delivers motion.
 * @property {string} video How frames are encoded.
 */

/**
 * A wish of a person; `key_frame` also travels server → page.
 * @typedef {object} Command
 * @property {'command'} type
 * @property {'arm' | 'disarm' | 'stop' | 'reset' | 'key_frame'} what
 */

/**
 * Page → server: a fault on the page that a supervisor should read.
 * @typedef {object} Log
 * @property {'log'} type
 * @property {string} text
 */

/**
 * Server → page: the answer to hello.
 * @typedef {object} Welcome
 * @property {'welcome'} type
 * @property {string} session
 * @property {number} version
 * @property {string} robot
 * @property {number} width Wanted picture.
 * @property {number} height
 * @property {number} frame_rate_hz
 * @property {number} bitrate_bps
 */

/**
 * Server → page: something was not taken.
 * @typedef {object} Refused
 * @property {'refused'} type
 * @property {string} code
 * @property {string} field
 * @property {string} allowed
 * @property {boolean} fatal The server closes the connection after this.
 */

/**
 * Health of one stream.
 * @typedef {object} Stream
 * @property {number | null} age_ms Of its newest item; null before the first.
 * @property {number} rate_hz
 * @property {number} dropped
 */

/**
 * Server → page, 10 Hz: the truth about the robot.
 * @typedef {object} Status
 * @property {'status'} type
 * @property {'DISARMED' | 'ARMED' | 'TRACK' | 'HOLD' | 'RAMP' | 'STOPPED' | 'LOST'} mode
 * @property {string} reason
 * @property {boolean} ready
 * @property {string[]} refusals
 * @property {string} robot
 * @property {string} operator
 * @property {Record<string, Stream>} streams
 * @property {Record<string, number>} latency_ms
 * @property {number} leds
 * @property {number | null} reprojection_px
 * @property {number[] | null} position_mm
 * @property {number | null} error_mm
 * @property {number | null} error_deg
 * @property {number | null} sigma_mm
 * @property {boolean} saturated
 * @property {string} recording
 * @property {number} phones
 * @property {number} supervisors
 * @property {string} realtime
 * @property {Record<string, number>} control
 * @property {string[]} messages
 */

/** @typedef {Hello | Command | Log} FromPage */
/** @typedef {Welcome | Refused | Status | Command} ToPage */

export {};
