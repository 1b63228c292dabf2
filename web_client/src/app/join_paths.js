/** Joins the ways of pictures and records to the page's other parts. */

/** @import {Fetch} from '../wire/pairing.js' */
/** @import {Surroundings as LinkSurroundings} from '../wire/link.js' */
/** @import {Phone} from './phone.js' */
/** @import {VideoSender} from '../video/video.js' */

import { RtcPath } from '../video/rtc.js';
import { VideoPaths } from '../video/video_paths.js';

/**
 * @param {object} parts
 * @param {Record<string, any>} parts.scope Of the window.
 * @param {{ now(): number, timeOrigin: number }} parts.performance
 * @param {LinkSurroundings} parts.links
 * @param {Fetch} parts.fetchHere
 * @param {(() => Worker) | undefined} parts.startRtcWorker
 * @param {Phone} parts.phone
 * @param {VideoSender} parts.video
 * @param {() => MediaStreamTrack | null} parts.track Of the camera.
 */
export function joinPaths({ scope, performance, links, fetchHere, startRtcWorker, phone, video, track }) {
  const rtc = new RtcPath({
    performance,
    fetch: fetchHere,
    setTimeout: links.setTimeout,
    PeerConnection: scope.RTCPeerConnection,
    ScriptTransform: scope.RTCRtpScriptTransform,
    hasStreams: scope.RTCRtpSender?.prototype.createEncodedStreams !== undefined,
    startWorker: startRtcWorker,
    onRecord: (record) => phone.record(record, (answer) => rtc.send(answer)),
    onLost: () => paths.lost('the connection has ended'),
  });
  const paths = new VideoPaths({
    performance,
    setTimeout: links.setTimeout,
    clearTimeout: links.clearTimeout,
    rtc,
    video,
    socketIsOpen: () => phone.videoLink.isOpen,
    place: () => ({ session: phone.session, track: track() }),
    say: (text) => phone.log(text),
    tell: (choice) => phone.link.sendMessage(choice),
  });
  phone.fast = rtc;
  return { rtc, paths };
}
