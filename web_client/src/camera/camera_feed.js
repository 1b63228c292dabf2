/** The camera from permission to frames, and again after it was taken away. */

/** @import {OnFrame, ProcessorClass, Source} from './frame_types.js' */
/** @import {ScreenAngle} from '../wire/protocol.js' */
/** @import {Wanted} from './camera.js' */

import { Lens } from './constraints.js';
import { openCamera, settleCamera } from './camera.js';
import { settingsWords } from './constraints_words.js';
import { startFrames } from './frame_source.js';

/**
 * @typedef {object} Surroundings
 * @property {MediaDevices | undefined} mediaDevices
 * @property {{ now(): number }} performance
 * @property {HTMLVideoElement} video
 * @property {(stream: MediaStream) => void} preview
 * @property {ProcessorClass | undefined} Processor
 * @property {(() => Worker) | undefined} startWorker
 * @property {() => ScreenAngle} screenAngle
 * @property {OnFrame} onFrame
 * @property {(text: string) => void} onLost
 */

export class CameraFeed {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.surroundings = surroundings;
    /** @type {MediaStreamTrack | null} */
    this.track = null;
    /** Settings of the open camera. @type {Lens | null} */
    this.settings = null;
    /** @type {Source | null} */
    this.source = null;
    /** @type {Wanted | null} */
    this.wanted = null;
  }

  /** True while the camera gives pictures. */
  get isLive() {
    return this.track?.readyState === 'live';
  }

  /** Label of the lens. */
  get lens() {
    return this.track?.label ?? '';
  }

  async open() {
    const stream = await openCamera(this.surroundings.mediaDevices);
    const track = stream.getVideoTracks()[0];
    if (track === undefined) return;
    this.track = track;
    this.settings = new Lens(track);
    track.addEventListener('ended', () => this.surroundings.onLost('The camera was taken away'));
    this.surroundings.preview(stream);
  }

  /**
   * Holds the camera to the picture the server wants and lets its frames flow; resolves with what it settled
   * on, in words.
   * @param {Wanted} wanted
   */
  async settle(wanted) {
    this.wanted = wanted;
    const { track, settings } = this;
    if (track === null || settings === null || !this.isLive) return 'no camera';
    await settleCamera(track, wanted);
    await settings.steady(wanted.distance_m);
    const source = await startFrames({ ...this.surroundings, track });
    this.source?.stop(); // one that began meanwhile, too
    this.source = source;
    return `${settingsWords(track.getSettings())}, through the ${source.name}`;
  }

  /** Opens it again if it was lost; resolves with its words, or "" if nothing was to be done. */
  async revive() {
    if (this.track === null || this.isLive) return '';
    await this.open();
    return this.wanted === null ? '' : this.settle(this.wanted);
  }
}
