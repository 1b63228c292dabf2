/** Who is this page to the server? Exchanges the key of a link for a cookie, and POSTs requests. */

/** @import {Arrival, Less, Standing} from './pairing_types.js' */

import { Problem } from './problems.js';

/** @typedef {'operator' | 'supervisor' | 'viewer'} Role */
/** @typedef {(input: string, init?: RequestInit) => Promise<Response>} Fetch */

/** Foreign pages can't set it without asking first. */
export const OWN_HEADERS = Object.freeze({ 'X-Lightleash': '1' });
export const PATIENCE_MS = 2000;
export const ASK_AGAIN_MS = 1000;

/**
 * The key in an address like `https://host/#k=KEY`, or "".
 * @param {string} fragment
 */
export function tokenOf(fragment) {
  return new URLSearchParams(fragment.replace(/^#/, '')).get('k') ?? '';
}

/**
 * How the server sees this browser by its cookie; null: it does not know it.
 * @param {Fetch} fetch
 * @returns {Promise<Standing | null>}
 */
export async function whoAmI(fetch) {
  const response = await reach(fetch, 'api/whoami', { cache: 'no-store' });
  if (response.status === 401) return null;
  if (!response.ok) throw new Problem('server_error', `whoami: ${response.status}`);
  return await response.json();
}

/**
 * What is in the way of a browser that was in, if the server answers; null if nothing is.
 * @param {Fetch} fetch
 * @returns {Promise<Problem | null>}
 */
export async function exclusion(fetch) {
  try {
    const standing = await whoAmI(fetch);
    return standing === null ? new Problem('not_paired') : endOf(standing);
  } catch {
    return null; // the server can't be reached, which the link tells
  }
}

/** @param {Standing} standing */
function endOf({ state, why }) {
  return state === 'in' || state === 'waiting' ? null : new Problem('shut_out', why);
}

/**
 * Exchanges a link's key for a cookie.
 * @param {Fetch} fetch
 * @param {string} token
 * @param {string} name
 * @param {boolean} [replace] Give up for it what this browser may already.
 * @returns {Promise<Standing | Less>}
 */
export async function pair(fetch, token, name, replace = false) {
  const response = await reach(fetch, 'api/pair', {
    method: 'POST',
    headers: { ...OWN_HEADERS, 'Content-Type': 'application/json' },
    body: JSON.stringify({ token, name, ...(replace ? { replace } : {}) }),
  });
  if (response.status === 401) throw new Problem('link_expired', await refusalOf(response, false));
  if (response.status === 409) return await response.json();
  if (response.status === 429) throw new Problem('too_many_tries');
  if (!response.ok) throw new Problem('server_error', await refusalOf(response));
  return await response.json();
}

/**
 * How the server sees this browser: by a link's key, else by the cookie of an earlier pairing; null without either.
 * @param {Fetch} fetch
 * @param {string} token "" for none.
 * @param {string} name
 * @param {Arrival['onLess']} onLess
 * @returns {Promise<Standing | null>}
 */
export async function standingFrom(fetch, token, name, onLess) {
  if (token === '') return whoAmI(fetch);
  try {
    const answer = await pair(fetch, token, name);
    if (!('held' in answer)) return answer;
    if (!await onLess(answer)) return await whoAmI(fetch);
    return /** @type {Standing} */ (await pair(fetch, token, name, true));
  } catch (error) {
    const standing = error instanceof Problem && error.code === 'link_expired' ? await whoAmI(fetch) : null;
    if (standing === null || endOf(standing) !== null) throw error;
    return standing;
  }
}

/**
 * The page's role by the key in its address, which is removed: nobody shall find it there. Resolves when a supervisor
 * has confirmed, if one must; null: the server does not know this browser.
 * @param {Arrival} arrival
 * @returns {Promise<Role | null>}
 */
export async function becomeKnown({ fetch, window: { location, history }, name, onWaiting, onLess, later }) {
  let standing = await standingFrom(fetch, tokenOf(location.hash), name, onLess);
  if (standing !== null) history.replaceState(null, '', location.pathname + location.search);
  while (standing?.state === 'waiting') {
    onWaiting(standing);
    await new Promise((resolve) => { later(() => resolve(null), ASK_AGAIN_MS); });
    standing = await whoAmI(fetch).catch(() => standing); // a radio has holes
  }
  if (standing === null) return null;
  const end = endOf(standing);
  if (end !== null) throw end;
  return standing.role;
}

/**
 * What a browser would be called if its holder gives no name.
 * @param {string} agent
 */
export function usualName(agent) {
  const system = /iPhone|iPad|Android|Windows|Macintosh|Linux/.exec(agent.replace('Linux; Android', 'Android'))?.[0] ?? '';
  const browser = /Firefox|Edg(?=\/)|Chrome(?!.*Edg\/)|Safari(?!.*Edg\/)/.exec(agent)?.[0]?.replace('Edg', 'Edge') ?? 'Browser';
  const names = { Macintosh: 'Mac', Android: 'Android phone', '': 'this device' };
  return `${browser} on ${/** @type {Record<string, string>} */ (names)[system] ?? system}`;
}

/**
 * A request that changes something; resolves with an error text, or "" when it was taken.
 * @param {Fetch} fetch
 * @param {'POST' | 'DELETE'} method
 * @param {string} path
 * @param {object} [body] Goes as JSON.
 */
export async function ask(fetch, method, path, body) {
  try {
    const told = body === undefined ? {} : { body: JSON.stringify(body) };
    const response = await reach(fetch, path, {
      method, headers: OWN_HEADERS, keepalive: true, signal: AbortSignal.timeout(PATIENCE_MS), ...told,
    });
    return response.ok ? '' : await refusalOf(response);
  } catch {
    return 'The server does not answer.';
  }
}

/**
 * @param {Fetch} fetch
 * @param {string} path
 * @param {RequestInit} init
 */
async function reach(fetch, path, init) {
  try {
    return await fetch(path, { credentials: 'same-origin', ...init });
  } catch {
    throw new Problem('server_unreachable');
  }
}

/**
 * The server's reason in words.
 * @param {Response} response
 * @param {boolean} [named] With the name of the field.
 */
export async function refusalOf(response, named = true) {
  try {
    const { field, allowed } = await response.json();
    if (field && allowed) return named ? `${field}: ${allowed}` : allowed;
  } catch {
    // The body was not ours; its status will do.
  }
  return `${response.status} ${response.statusText}`.trim();
}
