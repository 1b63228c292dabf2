/** Sentences of the calibration board's page, as `french_page.js` has the phone's. */

/** @type {Record<string, string>} */
export const PAGE = {
  "Calibration board": "Mire d’étalonnage",
  "ChArUco board of 9 by 6 squares": "Mire ChArUco de 9 cases sur 6",
  "This bar measures": "Cette barre mesure",
  "mm": "mm",
  "Optional: only distances need the board’s size, the lens does not.": "Facultatif : la taille de la mire ne sert qu’aux distances, pas à l’objectif.",
  "A square measures {} mm ({}).": "Une case mesure {} mm ({}).",
  "Brightness up, no glare, the screen flat. Film it from all sides.": "Luminosité à fond, sans reflet, écran plat. Filmez-la de tous les côtés."
};
