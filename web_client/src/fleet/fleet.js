/** What the page of all robots says of each, from what its own server answers. */

/** @import {ShownMode} from '../ui/session_types.js' */

/**
 * One server of the machine: see `server/view/fleet.py`; ended: as it was told to, while this page was open.
 * @typedef {object} Server
 * @property {string} name "" without one.
 * @property {string} robot
 * @property {'live' | 'starting' | 'silent' | 'gone' | 'ended'} state
 * @property {number} https_port
 * @property {number} http_port
 * @property {string} mode
 * @property {string} reason
 * @property {string} leader
 * @property {number | null} latency_ms
 * @property {number | null} battery_v
 */

/**
 * What `api/fleet` answers.
 * @typedef {object} Answer
 * @property {Server[]} servers
 */

/**
 * What stands on a robot's card.
 * @typedef {object} Card
 * @property {string} id Its server's name, which may be "".
 * @property {string} name What it is called.
 * @property {string} robot
 * @property {string} mode Whose colour it has.
 * @property {string} title
 * @property {string} words Why.
 * @property {[string, string][]} figures Each with its name.
 * @property {string} href Its supervisor's page, or "" where there is none to open.
 */

/** An answer that is older tells nothing of a robot that may fly [ms]. */
export const OLD_MS = 3000;

/** @type {Record<Exclude<Server['state'], 'live'>, [ShownMode, string, string]>} */
const UNHEARD = {
  starting: ['DISARMED', 'STARTING', 'Its server is starting: some seconds.'],
  silent: ['NO_WORD', 'NO WORD', 'Its server does not answer: what the robot does is not known.'],
  gone: ['NO_WORD', 'GONE', 'Its server was killed: a robot in flight stops by its own watchdog.'],
  ended: ['DISARMED', 'ENDED', 'Its server was told to end, and has stopped the robot first.'],
};

/**
 * @param {Server} server
 * @param {{ protocol: string, hostname: string }} location This page's.
 * @param {boolean} isOld The answer is.
 * @returns {Card}
 */
export function cardOf(server, location, isOld) {
  const [mode, title, words] = stateOf(server, isOld);
  const port = location.protocol === 'https:' ? server.https_port : server.http_port;
  const isOver = server.state === 'gone' || server.state === 'ended';
  return {
    id: server.name,
    name: nameOf(server),
    robot: server.robot,
    mode,
    title,
    words,
    figures: server.state === 'live' && !isOld ? figuresOf(server) : [],
    href: isOver ? '' : `${location.protocol}//${location.hostname}:${port}/supervisor`,
  };
}

/** @param {Server} server */
function nameOf({ name, robot }) {
  return name === '' ? robot : name;
}

/**
 * @param {Server} server
 * @param {boolean} isOld
 * @returns {[string, string, string]}
 */
function stateOf({ state, mode, reason }, isOld) {
  if (isOld) return ['NO_WORD', 'NO WORD', 'The server of this page does not answer.'];
  return state === 'live' ? [mode, mode, reason] : UNHEARD[state];
}

/**
 * @param {Server} server
 * @returns {[string, string][]}
 */
function figuresOf({ leader, latency_ms: latencyMs, battery_v: batteryV }) {
  return [
    ['Leads', leader || 'nobody'],
    ...(latencyMs === null ? [] : [/** @type {[string, string]} */ (['Latency', `${Math.round(latencyMs)} ms`])]),
    ...(batteryV === null ? [] : [/** @type {[string, string]} */ (['Battery', `${batteryV.toFixed(1)} V`])]),
  ];
}

/**
 * Servers for this page: those that it has seen before and that are not there any more have ended.
 * @param {readonly Server[]} before
 * @param {readonly Server[]} servers
 * @returns {Server[]}
 */
export function withEnded(before, servers) {
  const names = new Set(servers.map(({ name }) => name));
  const ended = before.filter(({ name }) => !names.has(name));
  return [...servers, ...ended.map((one) => ({ ...one, state: /** @type {const} */ ('ended') }))]
    .sort((a, b) => (a.name < b.name ? -1 : 1));
}
