import assert from 'node:assert/strict';
import { test } from 'node:test';

import { cardOf, withEnded } from '../../src/fleet/fleet.js';

/** @import {Server} from '../../src/fleet/fleet.js' */

const HERE = { protocol: 'http:', hostname: '127.0.0.1' };
const LAN = { protocol: 'https:', hostname: 'robots.lan' };

/** @param {Partial<Server>} parts @returns {Server} */
const server = (parts) => ({
  name: 'left', robot: 'ames', state: 'live', https_port: 8443, http_port: 8080, mode: 'TRACK',
  reason: 'The robot follows.', leader: 'Anna', latency_ms: 87.4, battery_v: null, ...parts,
});

test('a card tells mode, why, who leads and how late', () => {
  const card = cardOf(server({}), HERE, false);
  assert.deepEqual([card.name, card.robot, card.mode, card.title, card.words], ['left', 'ames', 'TRACK', 'TRACK', 'The robot follows.']);
  assert.deepEqual(card.figures, [['Leads', 'Anna'], ['Latency', '87 ms']]);
});

test('what is not told is left out, and nobody is said to lead', () => {
  assert.deepEqual(cardOf(server({ leader: '', latency_ms: null, battery_v: 11.14 }), HERE, false).figures,
    [['Leads', 'nobody'], ['Battery', '11.1 V']]);
});

test('the page of another server is on the same host, at its port of the same kind', () => {
  assert.equal(cardOf(server({}), HERE, false).href, 'http://127.0.0.1:8080/supervisor');
  assert.equal(cardOf(server({}), LAN, false).href, 'https://robots.lan:8443/supervisor');
});

test('who has no name is called as its robot', () => {
  assert.equal(cardOf(server({ name: '' }), HERE, false).name, 'ames');
});

test('of a server that is not heard no mode, leader or figure is shown as if it were now', () => {
  for (const state of /** @type {const} */ (['starting', 'silent', 'gone', 'ended'])) {
    const card = cardOf(server({ state }), HERE, false);
    assert.deepEqual(card.figures, []);
    assert.doesNotMatch(`${card.title} ${card.words} ${card.mode}`, /TRACK|follows|Anna/);
    assert.equal(card.href === '', state === 'gone' || state === 'ended');
  }
});

test('an old answer shows no mode at all', () => {
  const card = cardOf(server({}), HERE, true);
  assert.deepEqual([card.title, card.mode, card.figures.length], ['NO WORD', 'NO_WORD', 0]);
});

test('who was here and is not any more has ended, until it is back', () => {
  const [left, right] = [server({}), server({ name: 'right' })];
  const ended = withEnded([left, right], [right]);
  assert.deepEqual(ended.map(({ name, state }) => [name, state]), [['left', 'ended'], ['right', 'live']]);
  assert.deepEqual(withEnded(ended, [right, left]).map(({ state }) => state), ['live', 'live']);
});
