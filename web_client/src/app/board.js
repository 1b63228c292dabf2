/** The board's page: fills the screen, and turns a measured bar into the size of a square. */

import { squareMm } from './board_size.js';
import { speak, write } from '../words/say.js';

/** @param {string} id */
function find(id) {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`board.html has no #${id}`);
  return element;
}

await speak(document, navigator.languages, () => window.localStorage);
const input = /** @type {HTMLInputElement} */ (find('mm'));
const picture = /** @type {HTMLImageElement} */ (find('board'));

function measure() {
  const bar = find('bar').getBoundingClientRect().width;
  const { naturalWidth, naturalHeight, clientWidth, clientHeight } = picture;
  const shown = Math.min(clientWidth / naturalWidth, clientHeight / naturalHeight) * naturalWidth;
  const mm = squareMm(input.value, bar, shown);
  if (mm === null) return;
  const option = `--square-mm ${mm.toFixed(2)}`; // with a point in every language
  write(find('square'), `A square measures ${mm.toFixed(1)} mm (${option}).`);
}

write(find('square'), 'Optional: only distances need the board’s size, the lens does not.');
input.addEventListener('input', measure);
window.addEventListener('resize', measure);
find('ruler').addEventListener('submit', (event) => event.preventDefault());
find('full').addEventListener('click', () => {
  if (document.fullscreenElement === null) void document.documentElement.requestFullscreen();
  else void document.exitFullscreen();
});
