/** What the phone's links and their start are joined to. */

/** @import {CameraFeed} from '../camera/camera_feed.js' */
/** @import {ChoiceCard} from '../ui/choice_card.js' */
/** @import {Event} from '../ui/session_types.js' */
/** @import {Feedback} from '../ui/feedback.js' */
/** @import {Fetch} from '../wire/pairing.js' */
/** @import {Imu} from '../motion/imu.js' */
/** @import {PairingCard} from '../ui/pairing_card.js' */
/** @import {PathChoice, Sight, Welcome} from '../wire/protocol_types.js' */
/** @import {Phone} from './phone.js' */
/** @import {Surroundings as LinkSurroundings} from '../wire/link.js' */
/** @import {VideoSender} from '../video/video.js' */
/** @import {WakefulClock} from '../wire/command.js' */

/**
 * A faster way for records that may be lost.
 * @typedef {{ readonly isHeard: boolean, send(record: ArrayBuffer): void }} FastRecords
 */

/** @typedef {{ sequence: number, tUs: number, nonce: bigint }} Ping */
/** @typedef {{ device: string, sensors: string, video: string }} Identity */

/**
 * Of a phone's links.
 * @typedef {object} Surroundings
 * @property {string} base Address of the page.
 * @property {{ now(): number }} performance
 * @property {WakefulClock} clock Of what people ask for and are told.
 * @property {LinkSurroundings} links
 * @property {(event: Event) => void} dispatch
 * @property {() => Identity} identity
 * @property {(welcome: Welcome) => void} onWelcome
 * @property {(choice: PathChoice) => void} onPath A supervisor's.
 * @property {(sight: Sight) => void} onSight
 * @property {() => void} onUnwelcome A connection ended before the server welcomed us.
 */

/**
 * Of their start.
 * @typedef {object} StartSurroundings
 * @property {Window} window
 * @property {{ now(): number }} performance
 * @property {Fetch} fetchHere
 * @property {(event: Event) => void} dispatch
 * @property {{ device: string, sensors: string, video: string }} identity What the phone says of itself; filled in here.
 * @property {Feedback} feedback
 * @property {CameraFeed} camera
 * @property {VideoSender} video
 * @property {Imu} imu
 * @property {PairingCard} pairing
 * @property {ChoiceCard} choice
 * @property {Phone} phone
 */

export {};
