import assert from 'node:assert/strict';
import { test } from 'node:test';
import { existsSync, readFileSync, readdirSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const ROOT = fileURLToPath(new URL('..', import.meta.url));
const PAGES = ['index.html', 'supervisor.html', 'board.html', 'screen.html', 'fleet.html', 'check.html', 'trust.html', 'trust_fr.html'];

/** @param {string} path */
const read = (path) => readFileSync(join(ROOT, path), 'utf8');

/** @param {string} folder @returns {string[]} */
const files = (folder) => readdirSync(join(ROOT, folder), { withFileTypes: true })
  .flatMap((entry) => (entry.isDirectory() ? files(join(folder, entry.name)) : [join(folder, entry.name)]));

const MODULES = files('src');
/** What only a French visitor loads, beside the page. */
const FRENCH = 'src/words/french.js';
/** What of it only one page's visitors load. */
const OWN = [...read(FRENCH).matchAll(/import\('\.\/(.*?)'\)/g)].map(([, name]) => `src/words/${name}`);

/** What only who leads a robot with a tool loads. */
const TOOL = 'src/ui/tool_slider.js';

/** Every file a page needs, through its modules. @param {string} page */
function needed(page) {
  const found = new Set([page]);
  for (const path of found) {
    const text = read(path);
    const names = [
      ...text.matchAll(/(?:src|href)="((?!#|\.\/"|view\/|screen"|fleet"|check"|ca\.crt"|\$secure")[^"]+)"/g), ...text.matchAll(/^import .*?from '([^']+)'/gms),
      ...text.matchAll(/new URL\('([^']+\.js)'/g),
    ];
    for (const [, name] of names) found.add(join(dirname(path), name ?? ''));
  }
  return [...found];
}

test('pages have no inline script, style or handler: the policy forbids them', () => {
  for (const page of PAGES) {
    const text = read(page);
    assert.doesNotMatch(text, /<style|\sstyle=|\son\w+=|javascript:/i, page);
    for (const [, inside] of text.matchAll(/<script[^>]*>([^]*?)<\/script>/g)) assert.equal(inside, '', page);
  }
});

test('nothing comes from another host', () => {
  for (const path of [...PAGES, ...MODULES, 'style.css', 'phone.css', 'supervisor.css', 'calibration.css', 'board.css', 'check.css', 'dark.css', 'fleet.css', 'lens.css', 'link.css',
    'people.css', 'screen.css', 'sight.css', 'tool.css', 'trust.css']) {
    const addresses = read(path).match(/https?:\/\/[\w.-]+/g) ?? [];
    const foreign = addresses.filter((address) => !/localhost|www\.w3\.org|^https:\/\/host$/.test(address));
    assert.deepEqual(foreign, [], path);
  }
});

test('every file a page names is there, and a page weighs less than 100 kB on the wire', () => {
  for (const page of PAGES) {
    const paths = needed(page);
    for (const path of paths) assert.ok(existsSync(resolve(ROOT, path)), `${page} needs ${path}`);
    const bytes = paths.reduce((sum, path) => sum + gzipSync(read(path)).byteLength, 0);
    assert.ok(bytes < 100_000, `${page}: ${bytes} bytes`);
  }
});

test('French is loaded by whoever speaks it, weighs less than 25 kB, and nobody else loads any of it', () => {
  const words = needed(FRENCH);
  assert.ok(MODULES.some((path) => read(path).includes(`import('./${FRENCH.split('/').pop()}')`)));
  for (const page of PAGES) assert.deepEqual(needed(page).filter((path) => [...words, ...OWN].includes(path)), [], page);
  /** @param {string[]} paths */
  const weight = (paths) => paths.reduce((sum, path) => sum + gzipSync(read(path)).byteLength, 0);
  assert.ok(weight(words) < 25_000, `${weight(words)} bytes`);
  for (const own of OWN) assert.ok(weight(needed(own)) < 10_000, `${own}: ${weight(needed(own))} bytes`);
});

test('no module is left over', () => {
  const used = new Set([...PAGES, FRENCH, ...OWN, TOOL].flatMap(needed));
  const onlyTypes = ['src/app/phone_types.js', 'src/camera/frame_types.js', 'src/ui/session_types.js', 'src/wire/pairing_types.js',
    'src/wire/protocol_types.js'];
  assert.deepEqual(MODULES.filter((path) => !used.has(path) && !onlyTypes.includes(path)), []);
});

test('every element the views look for is in their page', () => {
  for (const [page, ...views] of [
    ['index.html', 'src/ui/view.js', 'src/ui/calibration_view.js', 'src/ui/constraints_panel.js', 'src/ui/link_check.js', 'src/ui/pairing_card.js', 'src/ui/choice_card.js',
      'src/ui/handover_card.js', 'src/ui/sight_overlay.js', 'src/ui/leading_choice.js'],
    ['board.html', 'src/app/board.js'],
    ['screen.html', 'src/screen/main.js'],
    ['check.html', 'src/check/main.js'],
    ['supervisor.html', 'src/dashboard/view.js', 'src/dashboard/phone_card.js', 'src/dashboard/runtime_parameters.js',
      'src/dashboard/path_select.js', 'src/dashboard/people_card.js', 'src/dashboard/main.js', 'src/ui/choice_card.js', 'src/ui/leading_choice.js'],
  ]) {
    const ids = new Set([...read(page ?? '').matchAll(/\sid="([^"]+)"/g)].map(([, id]) => id));
    for (const view of views) {
      const wanted = [...read(view).matchAll(/(?:find|text|show|data|list|figure|graph|row|listen|input|place|onClick)\('([a-z][\w-]*)'/g)];
      assert.ok(wanted.length > 0);
      for (const [, id] of wanted) assert.ok(ids.has(id), `${view} looks for #${id} in ${page}`);
    }
  }
});

test('every button has a name that can be read out', () => {
  for (const page of PAGES) {
    for (const [button, inside] of read(page).matchAll(/<button[^>]*>([^]*?)<\/button>/g)) {
      const words = (inside ?? '').replace(/<svg[^]*?<\/svg>|<[^>]+>/g, '').trim();
      assert.ok(words !== '' || /aria-label="[^"]+"/.test(button), button);
    }
  }
});

/** Relative luminance of #rrggbb. @param {string} colour */
function luminance(colour) {
  const [r, g, b] = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  return 0.2126 * (r ?? 0) + 0.7152 * (g ?? 0) + 0.0722 * (b ?? 0);
}

test('every mode’s words stand out from its ground by 4.5 or more', () => {
  let checked = 0;
  for (const [, rule] of read('style.css').matchAll(/\[data-mode[^{]*\{([^}]*)\}/g)) {
    const ground = /--mode: (#\w{6})/.exec(rule ?? '')?.[1] ?? '';
    const words = /--on-mode: (#\w{6})/.exec(rule ?? '')?.[1] ?? '#ffffff';
    const [light, dark] = [luminance(ground), luminance(words)].sort((a, b) => b - a);
    assert.ok(((light ?? 0) + 0.05) / ((dark ?? 0) + 0.05) >= 4.5, `${words} on ${ground}`);
    checked += 1;
  }
  assert.ok(checked >= 7);
});

test('STOP is red, white and black, never on yellow: a page is no emergency stop', () => {
  const rules = [...read('style.css').matchAll(/^\.stop[^{]*\{([^}]*)\}/gm)].map(([, rule]) => rule ?? '').join();
  const grounds = [...rules.matchAll(/background: (#\w{6})/g)].map(([, colour]) => colour ?? '');
  assert.equal(grounds.length, 2);
  for (const ground of grounds) assert.ok(1.05 / (luminance(ground) + 0.05) >= 4.5, ground);
  for (const [colour] of rules.matchAll(/#\w{6}/g)) {
    const [r = 0, g = 0, b = 0] = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
    assert.ok((r === g && g === b) || (r > 2 * g && r > 2 * b), colour);
  }
});
