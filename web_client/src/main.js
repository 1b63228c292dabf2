/** The phone page: joins browser, sensors, links and screen. The only module that acts by itself. */

/** @import {Effect, Event} from './session_types.js' */
/** @import {Welcome} from './protocol_types.js' */

import { browserOf } from './browser.js';
import { CameraFeed } from './camera_feed.js';
import { Feedback } from './feedback.js';
import { LensPanel } from './lens_panel.js';
import { PaceKeeper } from './pace_keeper.js';
import { Imu, requestMotionPermission } from './imu.js';
import { Phone } from './phone.js';
import { Problem, adviceFor, problemOf } from './problems.js';
import { Rate } from './clock.js';
import { stayAwake, toggleFullScreen } from './display.js';
import { StopPost } from './stop.js';
import { USUAL, deviceName } from './camera.js';
import { joinPaths } from './join_paths.js';
import { VideoSender } from './video.js';
import { View } from './view.js';
import { INITIAL, reduce, touchOf, wish } from './session.js';
import { becomeKnown, isStranger, tokenOf } from './pairing.js';

const TICK_MS = 33;
const STOP_TICK_MS = 50;
const HEALTH_MS = 500;
/** Phases of a calibration that need pictures of the camera's own size. */
const WHOLE = ['filming', 'solving'];
const SILENT_MOTION_MS = 3000;

const here = browserOf(window);
const { scope, platform, fetchHere, links, screenAngle, startWorker, later } = here;
const stopPost = new StopPost(fetchHere);
const feedback = new Feedback(navigator, window.AudioContext, platform !== 'android');
const motionRate = new Rate();
const identity = { device: '', sensors: '', video: '' };
let state = INITIAL;
let shown = false;
let startedAtMs = Infinity;

const phone = new Phone({
  base: document.baseURI,
  performance,
  links,
  dispatch,
  identity: () => identity,
  onWelcome: (welcome) => void welcomed(welcome),
  onUnwelcome: () => void checkPairing(),
});

const view = new View(document, window, {
  onStart: () => void start(),
  onReload: () => window.location.reload(),
  onPress: () => dispatch({ type: 'press' }),
  onRelease: () => dispatch({ type: 'release' }),
  onStop: () => dispatch({ type: 'stop' }),
  onCalibrate: (what) => dispatch({ type: 'calibrate', what }),
  onPath: (wished) => paths.choose(wished),
  onWish: () => dispatch({ type: 'ask', what: wish(state).what }),
  onSound: () => {
    feedback.unlock();
    feedback.sound = !feedback.sound;
    view.sound(feedback.sound);
  },
  onFull: document.fullscreenEnabled ? () => void toggleFullScreen(document, screen) : null,
});

const video = new VideoSender({
  performance,
  send: (record) => phone.sendFrame(record),
  log: (text) => phone.log(text),
  VideoEncoder: scope.VideoEncoder,
  OffscreenCanvas: scope.OffscreenCanvas,
});
phone.video = video;

const { rtc, paths } = joinPaths({ ...here, performance, phone, video, track: () => camera.track });

const camera = new CameraFeed({
  mediaDevices: navigator.mediaDevices,
  performance,
  video: view.video,
  preview: (stream) => view.preview(stream),
  Processor: scope.MediaStreamTrackProcessor,
  startWorker,
  screenAngle,
  onFrame: (frame) => paths.offer(frame),
  onLost: (text) => {
    notice(text);
    phone.log(text);
  },
});

const pace = new PaceKeeper({
  paths,
  camera: () => camera.track?.getSettings() ?? {},
  tell: (words) => {
    notice(words);
    phone.log(words);
  },
});

const imu = new Imu({
  events: window,
  performance,
  screenAngle,
  negated: platform === 'ios',
  setTimeout: later,
  sensors: scope,
}, (tUs, motion) => {
  motionRate.add(performance.now());
  phone.sendMotion(tUs, motion);
  rtc.pictures.turned(motion.orientation_wxyz);
});

const lensPanel = new LensPanel(document, platform, performance, camera, (text) => phone.log(text));

/** @param {Event} event */
function dispatch(event) {
  const outcome = reduce(state, event);
  state = outcome.state;
  outcome.effects.forEach(perform);
  if (event.type === 'disconnected') paths.end();
  if (!shown) {
    shown = true;
    requestAnimationFrame(show);
  }
}

function show() {
  shown = false;
  const { problem } = state;
  view.render(state, problem === null ? null : adviceFor(problem, platform, window.location.port));
  lensPanel.render(state);
}

/** @param {Effect} effect */
function perform(effect) {
  switch (effect.type) {
    case 'touch':
      if (state.linked) phone.sendTouch(touchOf(state));
      break;
    case 'command':
      phone.command(effect.what);
      break;
    case 'post_stop':
      stopPost.send();
      break;
    case 'feel':
      feedback.signal(effect.mode);
      break;
    case 'calibrate':
      phone.calibrate(effect.what);
      break;
    case 'close_link':
      phone.close();
      paths.end();
  }
}

/** Everything a tap starts; what fails is told with the way to mend it. */
async function start() {
  const motionAllowed = requestMotionPermission(window); // must come first: it needs the tap itself
  motionAllowed.catch(() => {}); // awaited below
  feedback.unlock();
  dispatch({ type: 'start' });
  try {
    step('Pairing with the server…');
    if ((await becomeKnown(fetchHere, window)) === null) throw new Problem('not_paired');
    step('Waiting for your permission: motion sensors…');
    await motionAllowed;
    step('Waiting for your permission: camera…');
    if (!camera.isLive) await camera.open();
    identity.device = await deviceName(navigator, screen, window.devicePixelRatio, camera.lens);
    await begin();
  } catch (error) {
    dispatch({ type: 'problem', problem: problemOf(error) });
  }
}

async function begin() {
  identity.video = await video.prepare({ ...USUAL, bitrate_bps: 4e6 });
  if (video.encoder === null) throw new Problem('encoder_missing');
  imu.stop();
  imu.start();
  startedAtMs = performance.now();
  identity.sensors = imu.source;
  void stayAwake(navigator);
  dispatch({ type: 'started' });
  phone.open();
}

/** The server hung up before welcoming us: perhaps it does not know this phone any more. */
async function checkPairing() {
  if (await isStranger(fetchHere)) dispatch({ type: 'problem', problem: new Problem('not_paired') });
}

/** @param {Welcome} welcome */
async function welcomed(welcome) {
  try {
    const words = await camera.settle(welcome);
    identity.video = await video.prepare(welcome, paths.wish === 'JPEG');
    phone.log(`${identity.device}: ${words}, ${identity.video}`);
    pace.begin(welcome.frame_rate_hz);
    paths.begin(welcome);
  } catch (error) {
    phone.log(`camera: ${error}`);
  }
}

async function comeBack() {
  void stayAwake(navigator);
  try {
    const words = await camera.revive();
    if (words === '') return;
    phone.log(`camera again: ${words}`);
    if (camera.track !== null) await rtc.pictures.replaceTrack(camera.track);
  } catch (error) {
    notice(`The camera does not come back: ${problemOf(error).message}`);
  }
}

function reportHealth() {
  const now = performance.now();
  paths.look((state.heard && state.status?.streams['video']?.age_ms) || null);
  pace.wantWhole(WHOLE.includes(state.calibration?.phase ?? ''));
  void pace.look();
  dispatch({ type: 'health', health: { ...paths.health(now), eased: pace.sign, imuHz: motionRate.perSecond(now) } });
  const silent = now - startedAtMs > SILENT_MOTION_MS && motionRate.perSecond(now) === 0;
  if (silent !== state.motionSilent) dispatch({ type: 'motion_silent', silent });
}

/** @param {string} text */
function step(text) {
  dispatch({ type: 'step', text });
}

/** @param {string} text */
function notice(text) {
  dispatch({ type: 'notice', text, now: performance.now() });
}

async function arrive() {
  if (!window.isSecureContext) {
    dispatch({ type: 'problem', problem: new Problem('insecure') });
    return;
  }
  const token = tokenOf(window.location.hash);
  if (token === '' && (await isStranger(fetchHere))) {
    dispatch({ type: 'problem', problem: new Problem('not_paired') });
    return;
  }
  dispatch({ type: 'step', text: '' });
}

document.addEventListener('visibilitychange', () => {
  dispatch({ type: 'visibility', visible: !document.hidden });
  if (!document.hidden && state.phase === 'operating') void comeBack();
});
window.addEventListener('pagehide', () => dispatch({ type: 'visibility', visible: false }));
window.addEventListener('pageshow', () => dispatch({ type: 'visibility', visible: !document.hidden }));
window.addEventListener('unhandledrejection', (event) => phone.log(`page: ${event.reason}`));
window.addEventListener('error', (event) => phone.log(`page: ${event.message}`));
view.sound(feedback.sound);
void arrive().then(() => {
  window.setInterval(() => dispatch({ type: 'tick', now: performance.now() }), TICK_MS);
  window.setInterval(() => dispatch({ type: 'stop_tick' }), STOP_TICK_MS);
  window.setInterval(reportHealth, HEALTH_MS);
});
