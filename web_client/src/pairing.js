/** Who is this page to the server? Exchanges the token of the QR code for a cookie, and POSTs wishes. */

import { Problem } from './problems.js';

/** @typedef {'operator' | 'supervisor' | 'viewer'} Role */
/** @typedef {(input: string, init?: RequestInit) => Promise<Response>} Fetch */

/** Foreign pages can't set it without asking first. */
export const OWN_HEADERS = Object.freeze({ 'X-Lightleash': '1' });
const PATIENCE_MS = 2000;

/**
 * The token in an address like `https://host/#k=TOKEN`, or "".
 * @param {string} fragment
 */
export function tokenOf(fragment) {
  return new URLSearchParams(fragment.replace(/^#/, '')).get('k') ?? '';
}

/**
 * The page's role by its cookie, or null without one.
 * @param {Fetch} fetch
 * @returns {Promise<Role | null>}
 */
export async function whoAmI(fetch) {
  const response = await reach(fetch, 'api/whoami', { cache: 'no-store' });
  if (response.status === 401) return null;
  if (!response.ok) throw new Problem('server_error', `whoami: ${response.status}`);
  return (await response.json()).role;
}

/**
 * The server answers, and does not know this browser.
 * @param {Fetch} fetch
 */
export async function isStranger(fetch) {
  return (await whoAmI(fetch).catch(() => 'not to be reached')) === null;
}

/**
 * Exchanges a token for a cookie.
 * @param {Fetch} fetch
 * @param {string} token
 * @returns {Promise<Role>}
 */
export async function pair(fetch, token) {
  const response = await reach(fetch, 'api/pair', {
    method: 'POST',
    headers: { ...OWN_HEADERS, 'Content-Type': 'application/json' },
    body: JSON.stringify({ token }),
  });
  if (response.status === 401) throw new Problem('link_expired');
  if (response.status === 429) throw new Problem('too_many_tries');
  if (!response.ok) throw new Problem('server_error', await refusalOf(response));
  return (await response.json()).role;
}

/**
 * The page's role: by its token, else by the cookie of an earlier pairing; null without either.
 * @param {Fetch} fetch
 * @param {string} token "" for none.
 * @returns {Promise<Role | null>}
 */
export async function roleFrom(fetch, token) {
  if (token === '') return whoAmI(fetch);
  try {
    return await pair(fetch, token);
  } catch (error) {
    const role = error instanceof Problem && error.code === 'link_expired' ? await whoAmI(fetch) : null;
    if (role === null) throw error;
    return role;
  }
}

/**
 * The page's role by the token in its address, which is removed: nobody shall find it there.
 * @param {Fetch} fetch
 * @param {{ location: Location, history: History }} window
 */
export async function becomeKnown(fetch, { location, history }) {
  const role = await roleFrom(fetch, tokenOf(location.hash));
  if (role !== null) history.replaceState(null, '', location.pathname + location.search);
  return role;
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
  } catch (error) {
    return error instanceof Error ? error.message : String(error);
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
 */
export async function refusalOf(response) {
  try {
    const { field, allowed } = await response.json();
    if (field && allowed) return `${field}: ${allowed}`;
  } catch {
    // The body was not ours; its status will do.
  }
  return `${response.status} ${response.statusText}`.trim();
}
