/** The phone page: joins browser, sensors, links and screen. The only module that acts by itself. */

/** @import {Effect, Event} from '../ui/session_types.js' */
/** @import {PathChoice, ToolStatus, Welcome} from '../wire/protocol_types.js' */
/** @import {ToolSlider} from '../ui/tool_slider.js' */

import { browserOf } from './browser.js';
import { CameraFeed } from '../camera/camera_feed.js';
import { ChoiceCard } from '../ui/choice_card.js';
import { Feedback } from '../ui/feedback.js';
import { Lasting, lastingSignal } from '../ui/lasting.js';
import { LensPanel } from '../ui/constraints_panel.js';
import { PaceKeeper } from '../video/rate_control.js';
import { WakefulClock, commandOf } from '../wire/command.js';
import { HandoverCard } from '../ui/handover_card.js';
import { Imu } from '../motion/imu.js';
import { LeadingChoice } from '../ui/leading_choice.js';
import { LinkCheck } from '../ui/link_check.js';
import { PairingCard } from '../ui/pairing_card.js';
import { Phone } from './phone.js';
import { adviceFor, problemOf } from '../wire/problems.js';
import { Rate } from '../wire/clock.js';
import { stayAwake, toggleFullScreen } from '../ui/display.js';
import { SightOverlay } from '../ui/sight_overlay.js';
import { Start } from './start.js';
import { Watch } from '../ui/standby.js';
import { StopPost } from '../wire/stop.js';
import { joinPaths } from './join_paths.js';
import { VideoSender } from '../video/video.js';
import { View } from '../ui/view.js';
import { chooseOther, speak } from '../words/say.js';
import { INITIAL, reduce, requestOf, touchOf } from '../ui/session.js';

const TICK_MS = 33;
const STOP_TICK_MS = 50;
const LASTING_MS = 50;
const HEALTH_MS = 500;
/** Phases of a calibration that need pictures of the camera's own size. */
const WHOLE = ['filming', 'solving'];
const SILENT_MOTION_MS = 3000;
/** Before a camera that was taken away is asked for again. */
const CAMERA_AGAIN_MS = 2000;

await speak(document, navigator.languages, () => window.localStorage);
const here = browserOf(window);
const { scope, platform, fetchHere, links, screenAngle, startJpegWorker, startWorker, later } = here;
const clock = new WakefulClock(performance, Date);
const stopPost = new StopPost(fetchHere, (answer) => dispatch({ type: 'stop_answer', answer, now: clock.now() }));
const feedback = new Feedback(navigator, window.AudioContext, true);
const lasting = new Lasting((signal) => feedback.signal(signal), { againMs: 1200, most: 50 });
const motionRate = new Rate();
const identity = { device: '', sensors: '', video: '' };
let state = INITIAL;
let shown = false;

const phone = new Phone({
  base: document.baseURI,
  performance,
  clock,
  links,
  dispatch,
  identity: () => identity,
  onWelcome: (welcome) => {
    watch.close();
    view.named(welcome.name);
    void welcomed(welcome);
  },
  onPath: ({ wish }) => choosePath(wish, 'supervisor'),
  onSight: (sight) => overlay.draw(sight, performance.now()),
  onUnwelcome: () => void start.checkPairing(), // it hung up: perhaps it does not know this phone any more
});

const watch = new Watch({
  base: document.baseURI, links, clock, serverTime: phone.serverTime, dispatch, onUnwelcome: () => void start.checkPairing(),
});

const view = new View(document, window, {
  onStart: () => void start.begin(),
  onReload: () => window.location.reload(),
  onPress: () => dispatch({ type: 'press' }),
  onRelease: () => dispatch({ type: 'release' }),
  onStop: () => dispatch({ type: 'stop', now: clock.now() }),
  onCalibrate: (what) => dispatch({ type: 'calibrate', what }),
  onPath: (requested) => choosePath(requested, 'operator'),
  onRequest: () => dispatch({ type: 'ask', what: requestOf(state).what, now: clock.now() }),
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
  startJpegWorker,
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
    later(comeBack, CAMERA_AGAIN_MS);
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

const start = new Start({
  window, performance, fetchHere, dispatch, identity, feedback, camera, video, imu, phone,
  pairing: new PairingCard(document, navigator, () => window.localStorage),
  choice: new ChoiceCard(document),
});

const overlay = new SightOverlay(document);

const lensPanel = new LensPanel(document, platform, performance, camera, (text) => phone.log(text));

const handover = new HandoverCard(document, fetchHere, { onTake: () => dispatch({ type: 'take_lead' }), tell: notice });

const leading = new LeadingChoice(document, (lead) => void phone.link.sendMessage(lead), () => performance.now());

/** Of a robot that has a tool. @type {Promise<ToolSlider | null> | null} */
let toolSlider = null;
let toolLoads = 0;

const linkCheck = new LinkCheck(document, performance, fetchHere);

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
  lensPanel.render(state.standby ? { ...state, status: null } : state); // it is another phone’s camera
  linkCheck.render(state);
  handover.render(state);
  useTool(!state.standby && state.heard ? state.status?.tool ?? null : null);
  leading.take(!state.standby && state.heard ? state.status?.leading ?? null : null, state.held);
}

/** @param {ToolStatus | null} tool */
function useTool(tool) {
  if (tool !== null) toolSlider ??= loadTool();
  void toolSlider?.then((slider) => slider?.take(tool, state.held ? state.press : null));
}

/** Null: soon anew, by an address of which no browser knows that it failed. */
async function loadTool() {
  try {
    /** @type {typeof import('../ui/tool_slider.js')} */
    const { ToolSlider } = await import(`../ui/tool_slider.js?${toolLoads++}`);
    return new ToolSlider(document, (use) => void phone.link.sendMessage(use), () => performance.now());
  } catch {
    setTimeout(() => { toolSlider = null; }, 2000);
    return null;
  }
}

/** @param {Effect} effect */
function perform(effect) {
  switch (effect.type) {
    case 'touch':
      if (state.linked) phone.sendTouch(touchOf(state));
      break;
    case 'command':
      phone.command(effect.what, effect.ageMs);
      if (effect.what === 'stop') watch.send(commandOf('stop', effect.ageMs, phone.serverTime));
      break;
    case 'post_stop':
      stopPost.send(commandOf('stop', effect.ageMs, phone.serverTime));
      break;
    case 'feel':
      feedback.signal(effect.mode);
      lasting.felt(effect.mode, performance.now());
      break;
    case 'tell':
      phone.log(effect.text);
      break;
    case 'calibrate':
      phone.calibrate(effect.what);
      break;
    case 'stand_by':
      phone.close();
      paths.end();
      watch.open();
      break;
    case 'ask_lead':
      phone.open();
      break;
    case 'close_link':
      watch.close();
      phone.close();
      paths.end();
  }
}

/** @param {Welcome} welcome */
async function welcomed(welcome) {
  try {
    const words = await camera.settle(welcome);
    identity.video = await video.prepare(welcome, paths.requested === 'JPEG');
    phone.log(`${identity.device}: ${words}, ${identity.video}`);
    pace.begin(welcome.frame_rate_hz);
    paths.begin(welcome);
  } catch (error) {
    phone.log(`camera: ${error}`);
  }
}

/**
 * @param {PathChoice['wish']} requested
 * @param {'operator' | 'supervisor'} by
 */
function choosePath(requested, by) {
  paths.choose(requested, by);
  view.path(requested, by);
  if (by === 'supervisor') notice(`Pictures by ${requested === 'auto' ? 'the best way' : requested}: chosen by the supervisor`);
}

async function comeBack() {
  if (document.hidden) return;
  void stayAwake(navigator);
  try {
    const words = await camera.revive();
    if (words === '') return;
    phone.log(`camera again: ${words}`);
    if (camera.track !== null) await paths.filmAnew(camera.track);
  } catch (error) {
    const { code, message } = problemOf(error);
    notice(`The camera does not come back: ${message}`);
    if (code === 'camera_busy') later(comeBack, CAMERA_AGAIN_MS);
  }
}

function reportHealth() {
  const now = performance.now();
  paths.look((state.heard && state.status?.streams['video']?.age_ms) || null);
  pace.wantWhole(WHOLE.includes(state.calibration?.phase ?? ''));
  void pace.look();
  overlay.age(now);
  dispatch({ type: 'health', health: { ...paths.health(now), eased: pace.sign, imuHz: motionRate.perSecond(now) } });
  const silent = now - start.startedAtMs > SILENT_MOTION_MS && motionRate.perSecond(now) === 0;
  if (silent !== state.motionSilent) dispatch({ type: 'motion_silent', silent });
}

/** @param {string} text */
function notice(text) {
  dispatch({ type: 'notice', text, now: clock.now() });
}

document.getElementById('language')?.addEventListener('click', () => chooseOther(document, () => window.localStorage));
document.addEventListener('visibilitychange', () => {
  dispatch({ type: 'visibility', visible: !document.hidden });
  if (state.phase === 'operating') void comeBack();
});
window.addEventListener('pagehide', () => dispatch({ type: 'visibility', visible: false }));
window.addEventListener('pageshow', () => dispatch({ type: 'visibility', visible: !document.hidden }));
window.addEventListener('unhandledrejection', (event) => phone.log(`page: ${event.reason}`));
window.addEventListener('error', (event) => phone.log(`page: ${event.message}`));
view.sound(feedback.sound);
void start.arrive().then(() => {
  window.setInterval(() => dispatch({ type: 'tick', now: clock.now() }), TICK_MS);
  window.setInterval(() => lasting.take(lastingSignal(state), performance.now()), LASTING_MS);
  window.setInterval(() => dispatch({ type: 'stop_tick', now: clock.now() }), STOP_TICK_MS);
  window.setInterval(reportHealth, HEALTH_MS);
});
