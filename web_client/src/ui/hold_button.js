/** A button that means something only while held: whatever ends the holding, or might have, releases. */

/**
 * @param {HTMLElement} button
 * @param {{ window: EventTarget, document: EventTarget & { hidden: boolean } }} page
 * @param {{ onPress: () => void, onRelease: () => void }} handlers
 */
export function attachHold(button, page, { onPress, onRelease }) {
  /** The finger that holds, the keyboard, or nobody. @type {number | 'key' | null} */
  let holder = null;

  /** @param {number | 'key'} who */
  const press = (who) => {
    if (holder !== null) return;
    holder = who;
    onPress();
  };
  const release = () => {
    if (holder === null) return;
    holder = null;
    onRelease();
  };

  button.addEventListener('pointerdown', (event) => {
    event.preventDefault();
    if (holder !== null || event.button !== 0) return;
    try {
      button.setPointerCapture(event.pointerId);
    } catch {
      return; // the finger has already left
    }
    press(event.pointerId);
  });
  for (const type of /** @type {const} */ (['pointerup', 'pointercancel', 'lostpointercapture'])) {
    button.addEventListener(type, (event) => {
      if (event.pointerId === holder) release();
    });
  }
  button.addEventListener('keydown', (event) => {
    if (event.key !== ' ' && event.key !== 'Enter') return;
    event.preventDefault();
    if (!event.repeat) press('key');
  });
  button.addEventListener('keyup', () => {
    if (holder === 'key') release();
  });
  for (const type of ['blur', 'pagehide']) page.window.addEventListener(type, release);
  page.document.addEventListener('freeze', release);
  button.addEventListener('blur', () => {
    if (holder === 'key') release();
  });
  page.document.addEventListener('visibilitychange', () => {
    if (page.document.hidden) release();
  });
  // Long presses must neither select, nor scroll, nor open a menu.
  button.addEventListener('touchstart', (event) => event.preventDefault(), { passive: false });
  page.document.addEventListener('contextmenu', (event) => event.preventDefault());
  page.document.addEventListener('selectstart', (event) => event.preventDefault());
}
