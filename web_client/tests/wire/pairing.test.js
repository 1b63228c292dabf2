import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ask, becomeKnown, exclusion, pair, standingFrom, tokenOf, usualName, whoAmI } from '../../src/wire/pairing.js';
import { StopPost } from '../../src/wire/stop.js';

/** @import {Fetch} from '../../src/wire/pairing.js' */

/** @param {Record<string, [number, object]>} answers @returns {{ fetch: Fetch, asked: { path: string, init: any }[] }} */
function server(answers) {
  /** @type {{ path: string, init: any }[]} */
  const asked = [];
  return {
    asked,
    fetch: async (path, init) => {
      asked.push({ path, init });
      const [status, body] = answers[path] ?? [404, {}];
      return new Response(JSON.stringify(body), { status });
    },
  };
}

test('the token is taken from the fragment', () => {
  assert.equal(tokenOf('#k=aB3-_x'), 'aB3-_x');
  assert.equal(tokenOf(''), '');
  assert.equal(tokenOf('#other=1'), '');
});

const IN = { role: 'operator', state: 'in', name: 'Anna', code: '', why: '' };
/** Nothing is lost, so nobody is asked. @returns {Promise<boolean>} */
const never = () => { throw new Error('asked'); };
const WAITING = { ...IN, state: 'waiting', code: 'KBWX' };

/** @param {Fetch} fetch @param {string} hash */
function arrival(fetch, hash) {
  /** @type {string[]} */
  const addresses = [];
  /** @type {string[]} */
  const codes = [];
  return {
    addresses,
    codes,
    arrival: /** @type {any} */ ({
      fetch,
      window: {
        location: { hash, pathname: '/lab/', search: '?x=1' },
        history: { replaceState: (/** @type {any} */ _, /** @type {any} */ __, /** @type {string} */ url) => addresses.push(url) },
      },
      name: 'Anna',
      onWaiting: (/** @type {any} */ { code }) => codes.push(code),
      onLess: never,
      later: (/** @type {() => void} */ callback) => setImmediate(callback),
    }),
  };
}

test('pairing posts the key and a name with our own header and nothing in the address', async () => {
  const { fetch, asked } = server({ 'api/pair': [200, IN] });
  assert.deepEqual(await pair(fetch, 'secret', 'Anna'), IN);
  assert.equal(asked[0]?.path, 'api/pair');
  assert.equal(asked[0]?.init.headers['X-Lightleash'], '1');
  assert.equal(asked[0]?.init.body, '{"token":"secret","name":"Anna"}');
  assert.equal(asked[0]?.init.credentials, 'same-origin');
});

test('an expired link says so, unless an earlier pairing still stands', async () => {
  const refused = /** @type {[number, object]} */ ([401, { field: 'token', allowed: 'a link works once' }]);
  const expired = server({ 'api/pair': refused, 'api/whoami': [401, {}] });
  await assert.rejects(standingFrom(expired.fetch, 'old', '', never), { code: 'link_expired', detail: 'a link works once' });
  const ended = server({ 'api/pair': refused, 'api/whoami': [200, { ...IN, state: 'revoked' }] });
  await assert.rejects(standingFrom(ended.fetch, 'old', '', never), { code: 'link_expired' });
  const known = server({ 'api/pair': refused, 'api/whoami': [200, IN] });
  assert.deepEqual(await standingFrom(known.fetch, 'old', '', never), IN);
});

test('without a link the cookie decides', async () => {
  const { fetch, asked } = server({ 'api/whoami': [401, {}] });
  assert.equal(await standingFrom(fetch, '', '', never), null);
  assert.deepEqual(asked.map(({ path }) => path), ['api/whoami']);
});

test('the key leaves the address as soon as it has done its work, and not before', async () => {
  for (const [status, left] of /** @type {const} */ ([[200, ['/lab/?x=1']], [401, []]])) {
    const { fetch } = server({ 'api/pair': [status, IN], 'api/whoami': [401, {}] });
    const { addresses, arrival: one } = arrival(fetch, '#k=t');
    await becomeKnown(one).catch(() => {});
    assert.deepEqual(addresses, left);
  }
});

test('who has to be confirmed waits with his code, over a hole of the radio, until he is in or not', async () => {
  for (const [end, outcome] of /** @type {const} */ ([['in', 'operator'], ['denied', 'shut_out'], ['expired', 'shut_out']])) {
    const answers = [WAITING, null, { ...IN, state: end, why: 'because' }];
    /** @type {Fetch} */
    const fetch = async (path) => {
      const answer = path === 'api/pair' ? WAITING : answers.shift();
      if (!answer) throw new TypeError('no radio');
      return new Response(JSON.stringify(answer));
    };
    const { codes, arrival: one } = arrival(fetch, '#k=t');
    const became = await becomeKnown(one).catch(({ code, detail }) => (assert.equal(detail, 'because'), code));
    assert.equal(became, outcome);
    assert.deepEqual(codes, ['KBWX', 'KBWX', 'KBWX']);
  }
});

test('a page that was hung up on learns whether it is shut out, unknown, or only without a server', async () => {
  const why = async (/** @type {[number, object]} */ answer) => (await exclusion(server({ 'api/whoami': answer }).fetch))?.code;
  assert.equal(await why([401, {}]), 'not_paired');
  assert.equal(await why([200, { ...IN, state: 'revoked' }]), 'shut_out');
  assert.equal(await why([200, IN]), undefined);
  assert.equal(await exclusion(() => Promise.reject(new TypeError('failed'))), null);
});

test('too many tries, a broken server and no server are told apart', async () => {
  await assert.rejects(pair(server({ 'api/pair': [429, {}] }).fetch, 't', ''), { code: 'too_many_tries' });
  await assert.rejects(
    pair(server({ 'api/pair': [400, { code: 'value', field: 'token', allowed: 'text' }] }).fetch, 't', ''),
    { code: 'server_error', detail: 'token: text' },
  );
  await assert.rejects(whoAmI(() => Promise.reject(new TypeError('failed'))), { code: 'server_unreachable' });
});

test('a device has a name that a person would know it by', () => {
  const names = [
    'Mozilla/5.0 (Linux; Android 10; K) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/130.0.0.0 Mobile Safari/537.36',
    'Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) AppleWebKit/605.1.15 Version/18.0 Mobile/15E148 Safari/604.1',
    'Mozilla/5.0 (X11; Linux x86_64; rv:128.0) Gecko/20100101 Firefox/128.0',
    'x',
  ].map(usualName);
  assert.deepEqual(names, ['Chrome on Android phone', 'Safari on iPhone', 'Firefox on Linux', 'Browser on this device']);
});

test('a wish resolves with the server’s reason when it is refused', async () => {
  const { fetch } = server({ 'api/recording': [409, { code: 'order', field: 'recording', allowed: 'one at a time' }] });
  assert.equal(await ask(fetch, 'POST', 'api/recording'), 'recording: one at a time');
  assert.equal(await ask(server({ 'api/stop': [202, {}] }).fetch, 'POST', 'api/stop'), '');
  assert.equal(await ask(server({}).fetch, 'POST', 'api/x'), '404');
  assert.equal(await ask(() => Promise.reject(new TypeError('Failed to fetch')), 'POST', 'api/x'), 'The server does not answer.');
});

test('a STOP by POST says how old it is, and a request without a body has none', async () => {
  /** @type {(RequestInit | undefined)[]} */
  const sent = [];
  /** @type {import('../../src/wire/pairing.js').Fetch} */
  const fetch = async (_, init) => {
    sent.push(init);
    return new Response('{}', { status: 202 });
  };
  new StopPost(fetch, () => {}).send({ type: 'command', what: 'stop', age_ms: 70, server_ms: 9000 });
  await ask(fetch, 'POST', 'api/recording');
  assert.deepEqual(JSON.parse(String(sent[0]?.body)), { type: 'command', what: 'stop', age_ms: 70, server_ms: 9000 });
  assert.equal(sent[1]?.body, undefined);
});

test('one STOP is under way at a time, and the next may go when it has ended, well or not', async () => {
  /** @type {(() => void)[]} */
  const waiting = [];
  const post = new StopPost(() => new Promise((_, reject) => { waiting.push(() => reject(new Error('lost'))); }), () => {});
  /** @type {import('../../src/wire/protocol_types.js').Command} */
  const stop = { type: 'command', what: 'stop', age_ms: 0, server_ms: null };
  post.send(stop);
  post.send(stop);
  assert.equal(waiting.length, 1);
  waiting[0]?.();
  await new Promise((resolve) => { setImmediate(resolve); });
  post.send(stop);
  assert.equal(waiting.length, 2);
});

test('what the server says to a STOP is told, and one of another version is asked in no words', async () => {
  const answers = [
    [() => new Response('{"stopping": true, "mode": "TRACK"}', { status: 202 })],
    [() => new Response('{"field": "role", "allowed": "pair anew"}', { status: 401 })],
    [() => new Response('{"field": "message", "allowed": "other fields"}', { status: 400 }), () => new Response('{}', { status: 202 })],
    [() => { throw new TypeError('no radio'); }],
  ];
  /** @type {object[]} */
  const told = [];
  /** @type {unknown[]} */
  const bodies = [];
  for (const replies of answers) {
    const post = new StopPost(async (_, init) => {
      bodies.push(init?.body ?? null);
      return /** @type {() => Response} */ (replies.shift())();
    }, (answer) => told.push(answer));
    post.send({ type: 'command', what: 'stop', age_ms: 0, server_ms: null });
    await new Promise((resolve) => { setTimeout(resolve); });
  }
  assert.deepEqual(told, [
    { taken: true, why: '', mode: 'TRACK' }, { taken: false, why: 'pair anew', mode: '' }, { taken: true, why: '', mode: '' },
  ]);
  assert.deepEqual(bodies.map((body) => body === null), [false, false, false, true, false]);
});

test('a link that gives less than this browser has is taken only when its holder says so', async () => {
  const less = { code: 'paired', held: 'supervisor', offered: 'operator', waits: true };
  for (const take of [false, true]) {
    /** @type {string[]} */
    const bodies = [];
    /** @type {Fetch} */
    const fetch = async (path, init) => {
      if (path === 'api/whoami') return new Response(JSON.stringify({ ...IN, role: 'supervisor' }));
      bodies.push(String(init?.body));
      const replaces = JSON.parse(String(init?.body)).replace === true;
      return new Response(JSON.stringify(replaces ? WAITING : less), { status: replaces ? 200 : 409 });
    };
    const standing = await standingFrom(fetch, 'k', 'Anna', async (asked) => {
      assert.deepEqual([asked.held, asked.offered, asked.waits], ['supervisor', 'operator', true]);
      return take;
    });
    assert.deepEqual([standing?.role, standing?.state], take ? ['operator', 'waiting'] : ['supervisor', 'in']);
    assert.deepEqual(bodies, ['{"token":"k","name":"Anna"}', '{"token":"k","name":"Anna","replace":true}'].slice(0, take ? 2 : 1));
  }
});
