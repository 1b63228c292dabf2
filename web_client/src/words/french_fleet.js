/** Sentences of the page of all robots, as `french_page.js` has the phone's. */

/** @type {Record<string, string>} */
export const PAGE = {
  "All robots here": "Tous les robots ici",
  "Only to look at: STOP and all else is on each robot’s own page.": "Rien qu’à regarder : STOP et le reste sont sur la page de chaque robot.",
  "Asking…": "Demande en cours…",
  "STARTING": "DÉMARRAGE",
  "Its server is starting: some seconds.": "Son serveur démarre : quelques secondes.",
  "Its server does not answer: what the robot does is not known.": "Son serveur ne répond pas : on ignore ce que fait le robot.",
  "GONE": "DISPARU",
  "Its server was killed: a robot in flight stops by its own watchdog.": "Son serveur a été tué : un robot en vol s’arrête par son propre chien de garde.",
  "ENDED": "TERMINÉ",
  "Its server was told to end, and has stopped the robot first.": "Son serveur a reçu l’ordre de finir, et a d’abord arrêté le robot.",
  "The server of this page does not answer.": "Le serveur de cette page ne répond pas.",
  "Nothing is shown: {}": "Rien n’est montré : {}",
  "Open the page of {}": "Ouvrir la page de {}",
  "Leads": "Guide",
  "nobody": "personne",
  "Latency": "Latence",
  "Battery": "Batterie"
};
