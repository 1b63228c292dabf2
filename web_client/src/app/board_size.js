/** Of the board as it is shown: 9 squares and a margin of half a square to both sides. */
const SQUARES_ACROSS = 10;
const BARS_MM = [5, 1000];

/**
 * How large one square is.
 * @param {string} barMm The bar's length as somebody measured it [mm]; a comma will do.
 * @param {number} barPx The bar's length on the screen.
 * @param {number} boardPx The board's width on the screen, with its margin.
 * @returns {number | null} [mm], or null where nothing sensible was typed.
 */
export function squareMm(barMm, barPx, boardPx) {
  const mm = Number(barMm.trim().replace(',', '.'));
  const [least, most] = BARS_MM;
  if (!(mm >= (least ?? 0) && mm <= (most ?? 0)) || !(barPx > 0)) return null;
  return ((mm / barPx) * boardPx) / SQUARES_ACROSS;
}
