/** What can be in the way of a phone, and how its holder mends it on this kind of phone. */

/** @typedef {'ios' | 'android' | 'firefox-android' | 'desktop'} Platform */

/**
 * @typedef {'insecure' | 'link_expired' | 'not_paired' | 'too_many_tries' | 'server_unreachable'
 *   | 'server_error' | 'not_supervisor' | 'shut_out' | 'waiting' | 'wrong_role' | 'camera_missing' | 'camera_denied' | 'camera_busy'
 *   | 'camera_absent' | 'motion_denied' | 'encoder_missing' | 'old_page' | 'refused'} ProblemCode
 */

/** Something the person has to mend. */
export class Problem extends Error {
  /**
   * @param {ProblemCode} code
   * @param {string} [detail] What the browser or the server said.
   */
  constructor(code, detail = '') {
    super(detail || code);
    this.code = code;
    this.detail = detail;
  }
}

/**
 * @param {unknown} error
 * @returns {Problem}
 */
export function problemOf(error) {
  return error instanceof Problem ? error : new Problem('server_error', String(error));
}

/** @typedef {{ title: string, steps: string[], retry: boolean }} Advice */

/**
 * @param {{ userAgent: string, maxTouchPoints?: number }} navigator
 * @returns {Platform}
 */
export function platformOf(navigator) {
  const agent = navigator.userAgent;
  const touchMac = /Macintosh/.test(agent) && (navigator.maxTouchPoints ?? 0) > 1;
  if (/iPhone|iPad|iPod/.test(agent) || touchMac) return 'ios';
  if (/Android/.test(agent)) return /Firefox/.test(agent) ? 'firefox-android' : 'android';
  return 'desktop';
}

/**
 * What to tell the person.
 * @param {Problem} problem
 * @param {Platform} platform
 * @param {string} port Of the page's address.
 * @returns {Advice}
 */
export function adviceFor(problem, platform, port) {
  const known = ADVICE[problem.code](platform, port || '443');
  const steps = problem.detail ? [...known.steps, `Details: ${problem.detail}`] : known.steps;
  return { ...known, steps };
}

const RESCAN = 'Scan the new QR code on the supervisor’s screen or in the terminal.';

/** @type {Record<ProblemCode, (platform: Platform, port: string) => Advice>} */
const ADVICE = {
  insecure: (platform, port) => ({
    title: 'This address is not secure',
    steps: [
      'Browsers give camera and motion sensors only to https:// pages.',
      'Open the https:// address shown with the QR code.',
      ...(platform.includes('android')
        ? [`Or, with a USB cable: run “adb reverse tcp:${port} tcp:${port}” on the computer, then open `
           + `http://localhost:${port} here.`]
        : []),
    ],
    retry: false,
  }),
  link_expired: () => ({
    title: 'This link has expired: scan the QR code again',
    steps: [
      'Each code works once and only for some minutes.',
      'You have not used it? Tell the supervisor: somebody else may have.',
      RESCAN,
    ],
    retry: false,
  }),
  not_paired: () => ({
    title: 'This phone is not paired',
    steps: [RESCAN, 'The code opens this page with a key that lets the server know your phone.'],
    retry: false,
  }),
  waiting: () => ({
    title: 'Waiting for a supervisor to confirm',
    steps: ['The same four letters must stand on the supervisor’s screen.'],
    retry: false,
  }),
  shut_out: () => ({
    title: 'This browser is not let in',
    steps: ['A new code lets it ask again, and a supervisor decides.', RESCAN],
    retry: false,
  }),
  too_many_tries: () => ({
    title: 'Too many tries',
    steps: ['The server refuses new pairings for a minute.', `Wait, then: ${RESCAN}`],
    retry: false,
  }),
  server_unreachable: () => ({
    title: 'The server does not answer',
    steps: [
      'Check that the phone is in the same Wi-Fi network as the computer, and that mobile data or a VPN '
        + 'does not take over.',
      'Check that Lightleash is still running on the computer.',
    ],
    retry: true,
  }),
  server_error: () => ({
    title: 'The server refused',
    steps: ['Try again; if it stays, look at the server’s log.'],
    retry: true,
  }),
  not_supervisor: () => ({
    title: 'This browser is not known to the server',
    steps: [
      'Open the supervisor’s link that the terminal shows when Lightleash starts: it opens once, for some minutes.',
      'Used or too late? “lightleash invite --role supervisor” prints another one.',
    ],
    retry: true,
  }),
  wrong_role: () => ({
    title: 'This link is for another page',
    steps: ['A viewer watches and may STOP. Ask for a code for phones to lead the robot.'],
    retry: false,
  }),
  camera_missing: (platform) => ({
    title: 'This browser gives no access to the camera',
    steps: [platform === 'ios'
      ? 'Open this page in Safari itself, not inside another app.'
      : 'Open this page in Chrome or Firefox itself, not inside another app.'],
    retry: false,
  }),
  camera_denied: (platform) => ({
    title: 'The camera is not allowed',
    steps: {
      ios: [
        'Tap the icon left of the address, then “Website Settings”, and set Camera to “Allow”.',
        'Nothing there? Open the Settings app → Apps → Safari → Camera → “Ask” or “Allow”.',
        'Then reload this page.',
      ],
      android: [
        'Tap the icon left of the address, then “Permissions”, and switch Camera on.',
        'Nothing there? Android Settings → Apps → Chrome → Permissions → Camera → “Allow”.',
      ],
      'firefox-android': [
        'Tap the shield or lock left of the address and clear “Camera: blocked”.',
        'Nothing there? Android Settings → Apps → Firefox → Permissions → Camera → “Allow”.',
      ],
      desktop: ['Click the icon left of the address and allow the camera.'],
    }[platform],
    retry: true,
  }),
  camera_busy: () => ({
    title: 'The camera is in use',
    steps: ['Another app or tab holds the camera: close it (video call, camera app), then try again.'],
    retry: true,
  }),
  camera_absent: () => ({
    title: 'No camera found',
    steps: ['This device has no camera that the browser can use. Use a phone.'],
    retry: true,
  }),
  motion_denied: (platform) => ({
    title: 'The motion sensors are not allowed',
    steps: {
      ios: [
        'Safari asks once and remembers: close this tab, swipe Safari out of the app switcher, open the link '
          + 'again and tap “Allow”.',
        'It does not ask? Settings app → Apps → Safari → Advanced → Website Data: remove this address.',
      ],
      android: ['Tap the icon left of the address → “Permissions” → switch “Motion sensors” on.'],
      'firefox-android': ['In about:config, “device.sensors.enabled” must be true.'],
      desktop: ['Click the icon left of the address and allow motion sensors.'],
    }[platform],
    retry: true,
  }),
  encoder_missing: () => ({
    title: 'This browser can’t send pictures',
    steps: ['Update it: Chrome 94, Firefox 132 or iOS 16.4 and later will do.'],
    retry: false,
  }),
  old_page: () => ({
    title: 'The server has been updated',
    steps: ['Reload this page to get the version that fits.'],
    retry: true,
  }),
  refused: () => ({
    title: 'The server did not take this',
    steps: [],
    retry: true,
  }),
};
