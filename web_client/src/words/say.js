/** The one way by which words reach the page: in the language of whoever looks. The sources say them in English. */

const KEPT = 'lightleash-language';

/** @type {(text: string) => string} */
export let say = (text) => text;

/** @param {Element | null | undefined} element @param {string} text */
export function write(element, text) {
  const said = say(text);
  if (element && element.textContent !== said) element.textContent = said;
}

/**
 * French, if it is chosen here or comes before English among the browser's languages.
 * @param {Document} document
 * @param {readonly string[]} languages
 * @param {() => Storage} storage May throw where a browser keeps nothing.
 */
export async function speak(document, languages, storage) {
  try {
    if (!(kept(storage) ?? languages.find((one) => /^(en|fr)\b/.test(one)))?.startsWith('fr')) return;
    const { speakFrench } = await import('./french.js');
    say = await speakFrench(document);
  } catch {
    // English will do
  }
}

/** @param {() => Storage} storage */
function kept(storage) {
  try {
    return storage().getItem(KEPT);
  } catch {
    return null;
  }
}

/**
 * The other language, remembered; the page begins anew.
 * @param {Document} document
 * @param {() => Storage} storage
 */
export function chooseOther(document, storage) {
  storage().setItem(KEPT, document.documentElement.lang === 'fr' ? 'en' : 'fr');
  document.location.reload();
}
