/** The phone's screen: kept awake, and filled where the browser can. */

/** @param {{ wakeLock?: { request(type: 'screen'): Promise<unknown> } }} navigator */
export async function stayAwake(navigator) {
  try {
    await navigator.wakeLock?.request('screen');
  } catch {
    // Battery saver: the screen may go dark, which releases the button.
  }
}

/**
 * Fills the screen and keeps it from turning: a turned picture is a new camera to the server.
 * @param {Document} document
 * @param {{ orientation?: any }} screen
 */
export async function toggleFullScreen(document, screen) {
  if (document.fullscreenElement !== null) {
    await document.exitFullscreen();
    return;
  }
  await document.documentElement.requestFullscreen({ navigationUI: 'hide' });
  await screen.orientation?.lock?.(screen.orientation.type).catch(() => {}); // not on every device
}
