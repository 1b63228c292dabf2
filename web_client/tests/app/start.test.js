import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Start } from '../../src/app/start.js';
import { FakeTime } from '../fakes.js';

/** @type {string[]} */
let log = [];
/** @type {number} */
let whoami = 200;
/** What the server says of this phone, one after the other; the last stays. @type {object[]} */
let standings = [];
/** @type {any} */
let surroundings;

beforeEach(() => {
  [log, whoami, standings] = [[], 200, [{ role: 'operator', state: 'in', code: '', why: '' }]];
  surroundings = {
    window: {
      isSecureContext: true,
      location: { hash: '', pathname: '/', search: '' },
      history: { replaceState() {} },
      navigator: { userAgent: 'Android' },
      screen: { width: 412, height: 915 },
      devicePixelRatio: 2,
      setTimeout: (/** @type {() => void} */ callback) => setImmediate(callback),
      DeviceMotionEvent: { async requestPermission() { log.push('permission'); return 'granted'; } },
    },
    performance: new FakeTime(),
    fetchHere: async () => new Response(JSON.stringify(standings.length > 1 ? standings.shift() : standings[0]), { status: whoami }),
    dispatch: (/** @type {any} */ event) => log.push(event.problem?.code ?? event.text ?? event.type),
    identity: { device: '', sensors: '', video: '' },
    feedback: { unlock: () => log.push('unlock') },
    camera: { isLive: false, lens: 'back', open: async () => log.push('camera') },
    video: { encoder: {}, prepare: async () => 'H.264' },
    imu: { source: 'DeviceMotion', stop() {}, start: () => log.push('imu') },
    phone: { open: () => log.push('open') },
    choice: { ask: async () => { throw new Error('asked'); } },
    pairing: {
      name: 'Anna',
      askName: (/** @type {boolean} */ wanted) => { if (wanted) log.push('name?'); },
      show: (/** @type {string} */ code) => log.push(`code ${code}`),
      hide() {},
    },
  };
});

test('a tap asks for the motion sensors before all else, and comes to an open link', async () => {
  const start = new Start(surroundings);
  const begun = start.begin();
  assert.deepEqual(log.slice(0, 2), ['permission', 'unlock'], 'within the tap itself');
  await begun;
  assert.deepEqual(log.filter((one) => !one.endsWith('…')), ['permission', 'unlock', 'start', 'paired', 'camera', 'imu', 'started', 'open']);
  assert.deepEqual(surroundings.identity, { device: 'Android 412x915@2 / back', sensors: 'DeviceMotion', video: 'H.264' });
  assert.equal(start.startedAtMs, surroundings.performance.now());
});

test('what is in the way is told, and nothing is opened', async () => {
  surroundings.video.encoder = null;
  await new Start(surroundings).begin();
  assert.equal(log.at(-1), 'encoder_missing');
  surroundings.window.DeviceMotionEvent.requestPermission = async () => 'denied';
  await new Start(surroundings).begin();
  assert.equal(log.at(-1), 'motion_denied');
  whoami = 401;
  await new Start(surroundings).begin();
  assert.equal(log.at(-1), 'not_paired');
  assert.ok(!log.includes('open'));
});

test('a stranger, and a page that is not secure, are told before any tap; who brings a token may tap', async () => {
  const start = new Start(surroundings);
  await start.arrive();
  whoami = 401;
  await start.arrive();
  surroundings.window.location.hash = '#k=token';
  await start.arrive();
  surroundings.window.isSecureContext = false;
  await start.arrive();
  assert.deepEqual(log, ['', 'not_paired', 'name?', '', 'name?', 'insecure']);
});

test('who waits for a supervisor sees the four letters until he is let in, and only then the camera opens', async () => {
  const waiting = { role: 'operator', state: 'waiting', code: 'KBWX', why: '' };
  standings = [waiting, waiting, { role: 'operator', state: 'in', code: '', why: '' }];
  await new Start(surroundings).begin();
  const told = log.filter((one) => /^code|^camera|^open/.test(one));
  assert.deepEqual(told, ['code KBWX', 'code KBWX', 'camera', 'open']);
});

test('who is not let in, or is a viewer, is told so and opens nothing', async () => {
  for (const [standing, code] of /** @type {const} */ ([
    [{ role: 'operator', state: 'denied', code: '', why: 'A supervisor did not let it in.' }, 'shut_out'],
    [{ role: 'operator', state: 'revoked', code: '', why: '' }, 'shut_out'],
    [{ role: 'viewer', state: 'in', code: '', why: '' }, 'wrong_role'],
  ])) {
    standings = [standing];
    await new Start(surroundings).begin();
    assert.equal(log.at(-1), code);
  }
  assert.ok(!log.includes('open'));
});
