import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ask, becomeKnown, pair, roleFrom, tokenOf, whoAmI } from '../src/pairing.js';
import { StopPost } from '../src/stop.js';

/** @import {Fetch} from '../src/pairing.js' */

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

test('pairing posts the token with our own header and nothing in the address', async () => {
  const { fetch, asked } = server({ 'api/pair': [200, { role: 'operator' }] });
  assert.equal(await pair(fetch, 'secret'), 'operator');
  assert.equal(asked[0]?.path, 'api/pair');
  assert.equal(asked[0]?.init.headers['X-Lightleash'], '1');
  assert.equal(asked[0]?.init.body, '{"token":"secret"}');
  assert.equal(asked[0]?.init.credentials, 'same-origin');
});

test('an expired token says so, unless an earlier pairing still stands', async () => {
  const expired = server({ 'api/pair': [401, {}], 'api/whoami': [401, {}] });
  await assert.rejects(roleFrom(expired.fetch, 'old'), { code: 'link_expired' });
  const known = server({ 'api/pair': [401, {}], 'api/whoami': [200, { role: 'operator' }] });
  assert.equal(await roleFrom(known.fetch, 'old'), 'operator');
});

test('without a token the cookie decides', async () => {
  const { fetch, asked } = server({ 'api/whoami': [401, {}] });
  assert.equal(await roleFrom(fetch, ''), null);
  assert.deepEqual(asked.map(({ path }) => path), ['api/whoami']);
});

test('the token leaves the address as soon as it has done its work, and not before', async () => {
  for (const [status, left] of /** @type {const} */ ([[200, ['/lab/?x=1']], [401, []]])) {
    const { fetch } = server({ 'api/pair': [status, { role: 'operator' }], 'api/whoami': [401, {}] });
    /** @type {string[]} */
    const addresses = [];
    const window = /** @type {any} */ ({
      location: { hash: '#k=t', pathname: '/lab/', search: '?x=1' },
      history: { replaceState: (/** @type {any} */ _, /** @type {any} */ __, /** @type {string} */ url) => addresses.push(url) },
    });
    await becomeKnown(fetch, window).catch(() => {});
    assert.deepEqual(addresses, left);
  }
});

test('too many tries, a broken server and no server are told apart', async () => {
  await assert.rejects(pair(server({ 'api/pair': [429, {}] }).fetch, 't'), { code: 'too_many_tries' });
  await assert.rejects(
    pair(server({ 'api/pair': [400, { code: 'value', field: 'token', allowed: 'text' }] }).fetch, 't'),
    { code: 'server_error', detail: 'token: text' },
  );
  await assert.rejects(whoAmI(() => Promise.reject(new TypeError('failed'))), { code: 'server_unreachable' });
});

test('a wish resolves with the server’s reason when it is refused', async () => {
  const { fetch } = server({ 'api/recording': [409, { code: 'order', field: 'recording', allowed: 'one at a time' }] });
  assert.equal(await ask(fetch, 'POST', 'api/recording'), 'recording: one at a time');
  assert.equal(await ask(server({ 'api/stop': [202, {}] }).fetch, 'POST', 'api/stop'), '');
  assert.equal(await ask(server({}).fetch, 'POST', 'api/x'), '404');
});

test('a STOP by POST says how old it is, and a request without a body has none', async () => {
  /** @type {(RequestInit | undefined)[]} */
  const sent = [];
  /** @type {import('../src/pairing.js').Fetch} */
  const fetch = async (_, init) => {
    sent.push(init);
    return new Response('{}', { status: 202 });
  };
  new StopPost(fetch).send({ type: 'command', what: 'stop', age_ms: 70, server_ms: 9000 });
  await ask(fetch, 'POST', 'api/recording');
  assert.deepEqual(JSON.parse(String(sent[0]?.body)), { type: 'command', what: 'stop', age_ms: 70, server_ms: 9000 });
  assert.equal(sent[1]?.body, undefined);
});

test('one STOP is under way at a time, and the next may go when it has ended, well or not', async () => {
  /** @type {(() => void)[]} */
  const waiting = [];
  const post = new StopPost(() => new Promise((_, reject) => { waiting.push(() => reject(new Error('lost'))); }));
  /** @type {import('../src/protocol_types.js').Command} */
  const stop = { type: 'command', what: 'stop', age_ms: 0, server_ms: null };
  post.send(stop);
  post.send(stop);
  assert.equal(waiting.length, 1);
  waiting[0]?.();
  await new Promise((resolve) => { setImmediate(resolve); });
  post.send(stop);
  assert.equal(waiting.length, 2);
});
