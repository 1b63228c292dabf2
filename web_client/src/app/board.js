/** The board's page: fills the screen, and turns a measured bar into the size of a square. */

import { squareMm } from './board_size.js';

/** @param {string} id */
function find(id) {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`board.html has no #${id}`);
  return element;
}

const input = /** @type {HTMLInputElement} */ (find('mm'));
const picture = /** @type {HTMLImageElement} */ (find('board'));

function measure() {
  const bar = find('bar').getBoundingClientRect().width;
  const { naturalWidth, naturalHeight, clientWidth, clientHeight } = picture;
  const shown = Math.min(clientWidth / naturalWidth, clientHeight / naturalHeight) * naturalWidth;
  const mm = squareMm(input.value, bar, shown);
  if (mm !== null) find('square').textContent = `A square measures ${mm.toFixed(1)} mm (--square-mm ${mm.toFixed(2)}).`;
}

input.addEventListener('input', measure);
window.addEventListener('resize', measure);
find('ruler').addEventListener('submit', (event) => event.preventDefault());
find('full').addEventListener('click', () => {
  if (document.fullscreenElement === null) void document.documentElement.requestFullscreen();
  else void document.exitFullscreen();
});
