import assert from 'node:assert/strict';
import { test } from 'node:test';

import { cameraConstraints, cameraProblem, deviceName, openCamera } from '../../src/camera/camera.js';
import { Problem, adviceFor, platformOf } from '../../src/wire/problems.js';

test('platforms are told apart, iPads that pose as Macs too', () => {
  assert.equal(platformOf({ userAgent: 'Mozilla/5.0 (iPhone; CPU iPhone OS 18_2 like Mac OS X)' }), 'ios');
  assert.equal(platformOf({ userAgent: 'Mozilla/5.0 (Macintosh; Intel Mac OS X)', maxTouchPoints: 5 }), 'ios');
  assert.equal(platformOf({ userAgent: 'Mozilla/5.0 (Macintosh; Intel Mac OS X)', maxTouchPoints: 0 }), 'desktop');
  assert.equal(platformOf({ userAgent: 'Mozilla/5.0 (Linux; Android 15) Chrome/157' }), 'android');
  assert.equal(platformOf({ userAgent: 'Mozilla/5.0 (Android 15; Mobile; rv:160.0) Firefox/160.0' }), 'firefox-android');
});

test('every problem has a title and, on every platform, a way to mend it', () => {
  const codes = /** @type {const} */ ([
    'insecure', 'link_expired', 'not_paired', 'too_many_tries', 'server_unreachable', 'server_error',
    'not_supervisor', 'wrong_role', 'camera_missing', 'camera_denied', 'camera_busy', 'camera_absent',
    'motion_denied', 'encoder_missing', 'old_page',
  ]);
  for (const code of codes) {
    for (const platform of /** @type {const} */ (['ios', 'android', 'firefox-android', 'desktop'])) {
      const advice = adviceFor(new Problem(code), platform, '8443');
      assert.ok(advice.title.length > 5 && advice.steps.every((step) => step.length > 10), code);
      assert.ok(advice.steps.length > 0, code);
    }
  }
  assert.match(adviceFor(new Problem('link_expired'), 'ios', '').title, /expired: scan the QR code again/);
});

test('an insecure page on Android names the cable way with the page’s own port', () => {
  const { steps } = adviceFor(new Problem('insecure'), 'android', '8443');
  assert.ok(steps.some((step) => step.includes('adb reverse tcp:8443 tcp:8443')));
});

test('what the camera says becomes a problem of its own', async () => {
  const named = (/** @type {string} */ name) => Object.assign(new Error('x'), { name });
  assert.equal(cameraProblem(named('NotAllowedError')).code, 'camera_denied');
  assert.equal(cameraProblem(named('NotFoundError')).code, 'camera_absent');
  assert.equal(cameraProblem(named('NotReadableError')).code, 'camera_busy');
  await assert.rejects(openCamera(undefined), { code: 'camera_missing' });
});

test('the wanted picture is asked for exactly, the rear camera and the rate as wishes', () => {
  assert.deepEqual(cameraConstraints({ width: 1280, height: 720, frame_rate_hz: 30 }, 'exact'), {
    facingMode: { ideal: 'environment' }, width: { exact: 1280 }, height: { exact: 720 },
    frameRate: { ideal: 30, max: 60 },
  });
});

test('a device is named by its model or size, and its lens, however the phone is held', async () => {
  const iphone = { userAgent: '(iPhone; CPU iPhone OS 18_2)' };
  const upright = await deviceName(iphone, { width: 393, height: 852 }, 3, 'Back Camera');
  assert.equal(upright, 'iPhone 393x852@3 / Back Camera');
  assert.equal(await deviceName(iphone, { width: 852, height: 393 }, 3, 'Back Camera'), upright);
  const pixel = { userAgent: '', userAgentData: { getHighEntropyValues: async () => ({ model: 'Pixel 7' }) } };
  assert.equal(await deviceName(pixel, { width: 1, height: 2 }, 1, ''), 'Pixel 7 / camera');
});
