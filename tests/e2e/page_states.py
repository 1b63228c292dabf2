"""What stands on the pages in each of their states; scripts do not run. As pictures to look at:

python -m tests.e2e.page_states folder [en | fr]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from playwright.sync_api import BrowserContext, Page

from tests.e2e.conftest import wanted_chromium
from tests.e2e.written_pages import FRENCH, opened, written_pages

PHONES = ((360, 640), (412, 915), (915, 412), (667, 375))
TABLET, DESKTOP, LAPTOP = (820, 1180), (1280, 720), (1440, 900)
LANGUAGES = ("en", "fr")
LETTERS_PX = (16, 32)
"""The usual size, and 200 % of it."""

DRAWN = "document.querySelectorAll('.late').forEach((one) => one.remove());"
"""As each page's first drawing does."""
OPERATING = """
const show = (...ids) => ids.forEach((id) => { document.getElementById(id).hidden = false; });
const hide = (...ids) => ids.forEach((id) => { document.getElementById(id).hidden = true; });
const text = (id, words) => { document.getElementById(id).textContent = words; };
const list = (id, lines, kind = '') => document.getElementById(id).replaceChildren(...lines.map(
  (line) => Object.assign(document.createElement('li'), {textContent: line, className: kind})));
const mode = (name, meaning, reason) => {
  document.getElementById('status').dataset.mode = name;
  text('mode', name);
  text('meaning', meaning);
  text('reason', reason);
};
const health = () => Object.entries({leds: '5', path: 'WebSocket', gaps: '12 computer',
  fps: '30 fps', imu: '200 Hz', rtt: '142 ms', kbps: '3.1 Mb/s'})
  .forEach(([id, words]) => text(`h-${id}`, words));
const operate = () => { hide('welcome'); show('operate', 'lead', 'full'); health(); };
const BUSY = 'The server\\'s computer is too busy. chromium takes the most of it: close what is '
  + 'not needed; a laptop wants its charger.';
"""
"""Short words for what the page's modules do."""
PHONE = {
    "start": """show('start', 'name-field'); text('host', 'robot.local');
      text('step', 'Pairing with the server…');""",
    "problem": """show('problem', 'reload', 'last-stop', 'last-stop-words');
      text('problem-title', 'The motion sensors are not allowed');
      list('problem-steps', ['Click the icon left of the address and allow motion sensors.']);
      text('last-stop-words', 'STOP is not confirmed by the robot. '
        + 'Press it again, or cut the robot’s power.');""",
    "pairing": "show('pairing', 'start'); text('match', 'KWRT');",
    "refused": """operate(); mode('DISARMED', 'Thrusters are off', 'Not armed.');
      list('refusals', [BUSY, 'Let go of the button before arming.']); show('calibrate');
      list('warnings', ['The server\\'s computer stood still 9 times in a minute, '
        + 'the longest 0.42 s.']);
      text('hold-hint', 'Arm first');""",
    "ready": """operate(); mode('DISARMED', 'Thrusters are off', 'Not armed.');
      show('handover-start', 'link-check-start');""",
    "moving": """operate(); mode('TRACK', 'The robot follows you', 'Following the phone.');
      document.getElementById('hold').dataset.look = 'moving'; show('toward');
      text('toward', 'The robot is beyond the left of the picture.'); text('wish', 'Disarm');
      text('hold-title', 'Moving'); text('hold-hint', '0.5 × your way · Let go to keep still');""",
    "waiting": """operate(); mode('HOLD', 'The robot keeps still', BUSY);
      document.getElementById('hold').dataset.look = 'again'; show('left', 'notice', 'lens');
      show('lens-0', 'lens-1'); document.getElementById('lens').dataset.tone = 'hint';
      text('lens-text', 'This phone can’t fix the focus: keep the robot between 1 and 4 m away.');
      text('left-s', '12 s'); text('hold-title', 'Let go and press again');
      text('hold-hint', 'Thrust fades in 12 s');
      text('notice', 'It came too late and was not done: press again.');""",
    "stopped": "operate(); mode('STOPPED', 'Thrust is off', 'STOP was pressed.');",
    "calibrating": """operate(); document.getElementById('operate').classList.add('calibrating');
      show('calibration', 'calibration-leave', 'calibration-go');
      document.getElementById('calibration').dataset.verdict = '';
      text('calibration-title', 'Film the board');
      text('board-url', 'robot.local/board');
      text('calibration-hint', 'Look at the board from the left, at 20 to 45 degrees.');
      document.getElementById('calibration-tasks').innerHTML = ['Whole picture', 'Tilted',
        'Near and far', 'Turned'].map((one) => `<div><dt>${one}</dt>
          <dd><progress value=".4"></progress></dd></div>`).join('');
      list('calibration-lines', ['Film the board in the corners of the picture too.'],
        'advice');""",
    "checking": """operate(); document.getElementById('operate').classList.add('checking');
      show('link-check', 'link-check-leave', 'link-check-go');
      document.getElementById('link-check').dataset.grade = 'fair';
      text('link-check-title', 'Usable: the robot will wait for the network now and then.');
      text('link-check-hint', 'In the last 20 s:');
      list('link-check-lines', ['The robot would follow 97.3 % of the time.', 'Round trip 12 ms.']);
      list('link-check-advice', ['The pictures are old: try another path for them.']);""",
    "handing": """operate(); document.getElementById('operate').classList.add('handing');
      show('handover', 'handover-leave', 'handover-take'); text('handover-title', 'Hand over to…');
      text('handover-hint', 'The robot comes down first.');
      document.getElementById('handover-people').innerHTML = ['Anna', 'Bert'].map(
        (one) => `<button class="calibrate quiet-deed">${one}</button>`).join('');""",
    "asked": """show('start');
      text('choice-title', 'This browser is paired already: it supervises');
      text('choice-text', 'With the link that you opened it only watches and may STOP.');
      document.getElementById('choice').showModal();""",
}
"""By state of the phone page: how it is brought about."""
FIGURES = """
const rows = (id, tag, all) => { document.getElementById(id).innerHTML = all.map(
  (cells) => `<${tag}>${cells}</${tag}>`).join(''); };
const figures = (id, all) => rows(id, 'div', all.map(
  ([name, value]) => `<dt>${name}</dt><dd>${value}</dd>`));
const STAGES = ['capture to arrival', 'waiting', 'decode', 'detect', 'identify', 'pose',
  'to control', 'control'];
const fill = () => {
  text('robot', 'ames (simulated)'); text('operator', 'Android 412x915@2.6 / camera 0');
  figures('figures', [['Error', '12.3<small>mm</small>'], ['Turned', '0.12<small>°</small>'],
    ['σ', '12.3<small>mm</small>'], ['Distance', '2.50<small>m</small>'], ['Lights', '5'],
    ['Misfit', '0.34<small>px</small>']]);
  figures('stages', STAGES.map((name) => [name, '12.3'])); text('scale', '150 ms');
  figures('thrusts', [1, 2, 3, 4, 5, 6, 7, 8].map((n) => [n, '1.23 N']));
  figures('control', ['p50', 'p99', 'p99.9', 'Missed', 'Server pause']
    .map((name) => [name, name === 'Missed' ? '123' : '0.12<small>ms</small>']));
  figures('estimate', ['NIS / dof', 'Age', 'Rejected', 'Fused', 'Dropped', 'Late', 'Offset',
    'σ offset', 'σ pos.', 'σ att.'].map((name) => [name, '12.3<small>ms</small>']));
  figures('biases', ['Robot gyro [°/s]', 'Robot accel [m/s²]', 'Phone gyro [°/s]',
    'Phone accel [m/s²]'].map((name) => [name, '+0.01 +0.02 −0.03']));
  rows('streams', 'tr', ['Operator', 'Phone motion', 'Video', 'Pose', 'Robot motion', 'Control']
    .map((name) => `<td>${name}</td><td>142 ms</td><td></td><td>200 Hz</td><td>0</td>`));
  rows('events', 'li', [1, 2, 3].map(
    () => '<time>12:34:56</time><span>TRACK: Following the phone.</span><small>× 14</small>'));
  rows('people', 'li', ['Anna', 'Bert'].map((name) => `<b class="clip">${name}</b>
    <span class="quiet">may lead · 3 min</span><button class="button slim">Give lead</button>
    <button class="button slim">Revoke</button>`));
  text('total', '87 ms light to command');
  text('gaps', 'Gaps in the last minute: phone 3 (0.42 s) · robot 2 · computer 0');
  text('url', 'https://192.168.178.42:8443/#k=AbCdEfGhIjKlMnOpQrSt'); text('ready', '2 to mend');
  document.querySelectorAll('output').forEach((one) => { one.textContent = '+2.5 Hz/(rad/s)'; });
  text('crowd', 'phones 1 · supervisors 2'); text('recording', '2026-07-01T12-34-56');
  text('press', 'discarded 12'); text('verdict', 'Keep');
};
"""
SUPERVISOR = {
    "refused": """fill(); mode('DISARMED', 'Thrusters are off', 'Not armed.');
      show('invite', 'lead');
      list('refusals', [BUSY, 'Let go of the button before arming.']);
      list('warnings', ['The server\\'s computer stood still 9 times in a minute, '
        + 'the longest 0.42 s.']);""",
    "flying": """fill(); mode('HOLD', 'The robot keeps still', BUSY);
      show('screen', 'saturated', 'episode');
      text('left', 'Thrust fades in 3 s');""",
    "asking": """fill(); show('asking', 'notice');
      text('notice', 'Not done: press: the newest one of the recording that runs');
      rows('asking', 'li', [`<span><b>Anna</b> (10.0.0.7) asks to lead. Do these letters stand on
      that phone? </span><strong class="match">KWRT</strong><button class="button slim confirm">
      Confirm</button><button class="button slim">Deny</button>`]);""",
    "blocked": """show('blocked', 'last-stop', 'last-stop-words'); hide('board');
      text('problem-title', 'The server has been updated'); text('last-stop-words', 'STOPPED');
      list('problem-steps', ['Reload this page to get the version that fits.']);""",
}
"""By state of the supervisor's."""
CHECKED = """
const LINES = [['Pictures', '30.0 a second of 1280x720, H264, 2937 kbit/s, evenly within 0.4 ms',
    'good', ''],
  ['Lost pictures', '10.0 %', 'poor',
    'Try another way of pictures, a better network, or close other apps on the phone.'],
  ['Axes of motion', 'up is where pictures have it; turns are unknown', 'unknown',
    'Turn the phone about all its axes, the robot in sight.'],
  ['Light to server', '167 ms from its drawing, 1 in 20 over 185, 1 in 100 over 187', 'fair',
    'If it stays too long: a quicker screen, a 5 GHz Wi-Fi or a cable.'],
  ['LEDs in the picture', 'exact to 0.25 px (each: 0.33, 0.28, 0.25, 0.34, 0.20)', 'fair',
    'Hold the phone more quietly, focus on the robot, allow more kbit/s.']];
const MARKS = {good: '✓ good', fair: '! fair', poor: '✕ poor', unknown: '? unknown'};
const lines = () => document.getElementById('lines').replaceChildren(...LINES.map(
  ([what, value, grade, advice]) => Object.assign(document.createElement('li'), {
    className: 'line', innerHTML: `<h3 class="what">${what}</h3>
      <span class="grade">${MARKS[grade]}</span><p class="value">${value}</p>
      <p class="advice">${advice}</p>`})));
const grades = () => [...document.querySelectorAll('.line')].forEach(
  (line, i) => { line.dataset.grade = LINES[i][2]; });
"""
CHECK = {
    "running": """lines(); grades(); hide('minute', 'long'); show('bar', 'enough');
      document.getElementById('bar').value = 0.4; text('title', 'Listening: 36 s left');
      text('hint', 'Android 412x915@2.6 / camera 0, 24 s');""",
    "waiting": """hide('minute', 'long'); show('bar', 'enough');
      text('title', 'Waiting for a phone');
      document.getElementById('enough').disabled = true;
      text('hint', 'Nothing is heard: phone: while a phone leads: scan the code first');""",
    "told": """lines(); grades(); show('save-page', 'save-json');
      document.getElementById('run').dataset.grade = 'poor';
      text('title', '✕ Not yet: mend what is poor first.');
      text('hint', 'Android 412x915@2.6 / camera 0, 60 s');""",
}
"""By state of the phone check's page."""
RULER = """text('square', 'Optional: only distances need the board’s size, '
  + 'the lens does not.');"""
FLEET = """text('why', '');
  document.getElementById('servers').innerHTML = [
    ['hall', 'ames (simulated)', 'TRACK', 'TRACK', 'Following the phone.',
      [['Leads', 'Anna'], ['Latency', '87 ms'], ['Battery', '14.8 V']]],
    ['roof', 'twister', 'NO_WORD', 'GONE',
      'Its server was killed: a robot in flight stops by its own watchdog.', []],
    ['yard', 'screen', 'DISARMED', 'STARTING', 'Its server is starting: some seconds.', []],
  ].map(([name, robot, mode, title, words, figures]) => `<li class="server">
    <h2><span>${name}</span><small>${robot}</small></h2>
    <p class="state" data-mode="${mode}"><strong>${title}</strong><span>${words}</span></p>
    <dl>${figures.map(([dt, dd]) => `<dt>${dt}</dt><dd>${dd}</dd>`).join('')}</dl>
    <a href="supervisor">Open the page of ${name}</a></li>`).join('');
"""
STATES = {
    **{("index", name): f"{OPERATING}{script}" for name, script in PHONE.items()},
    **{
        ("supervisor", name): f"{OPERATING}{FIGURES}{script}" for name, script in SUPERVISOR.items()
    },
    ("fleet", "written"): f"{OPERATING}{FLEET}",
    ("screen", "setup"): "",
    ("screen", "shows"): """document.getElementById('setup').hidden = true;
      document.getElementById('why').textContent = 'Hold the phone still: '
        + 'measuring how late this screen is.';""",
    ("check", "ready"): "",
    **{("check", name): f"{OPERATING}{CHECKED}{script}" for name, script in CHECK.items()},
    ("board", "ruler"): f"{OPERATING}{RULER}",
    ("board", "measured"): f"{OPERATING}text('square', 'A square measures 25.4 mm '"
    " + '(--square-mm 25.40).');",
    ("trust", "help"): "",
    ("trust_fr", "help"): "",
}
"""By page and state."""
FRENCH_PAGES = ("index", "screen", "check", "board", "fleet", "supervisor")
SHOWN = [
    *((name, state, "en") for name, state in STATES),
    *((name, state, "fr") for name, state in STATES if name in FRENCH_PAGES),
]
"""Each page's states, in each of its languages."""


def letters(px: int) -> tuple[str, ...]:
    """Chromium's flags for somebody who has set letters of this size."""
    return (f"--blink-settings=defaultFontSize={px}",)


def shown(
    context: BrowserContext, name: str, state: str, size: tuple[int, int], language: str = "en"
) -> Page:
    """A page in one of its states, in one of its languages."""
    page = opened(context, name, size)
    page.evaluate(f"() => {{ {DRAWN} {STATES[name, state]} }}")
    if language == "fr":
        page.evaluate(FRENCH)
    return page


def main(argv: Sequence[str] | None = None) -> None:
    """A picture of each state, at each size of screen and of letters, in one language or in all."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path, help="for the pictures")
    parser.add_argument("language", nargs="?", choices=LANGUAGES, help="default: each")
    arguments = parser.parse_args(argv)
    target, executable = arguments.folder, wanted_chromium()
    languages = [arguments.language] if arguments.language else LANGUAGES
    target.mkdir(parents=True, exist_ok=True)
    for px in LETTERS_PX:
        with written_pages(executable, letters(px)) as context:
            for name, state, language in SHOWN:
                if language not in languages:
                    continue
                sizes = PHONES if name == "index" else (PHONES[0], TABLET, DESKTOP, LAPTOP)
                for width, height in sizes:
                    page = shown(context, name, state, (width, height), language)
                    percent = 100 * px // LETTERS_PX[0]
                    file = f"{name}-{state}-{language}-{width}x{height}-{percent}.png"
                    page.screenshot(path=target / file, full_page=name != "index")
                    page.close()


if __name__ == "__main__":
    main()
