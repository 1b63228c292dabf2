/** The phone's place on the board: its picture while there is one, otherwise the code that lets one in. */

/** @typedef {{ url: string, qr_svg: string }} Invite */

/** Without a picture for so long the code is shown again [ms]. */
const PICTURE_LIFE_MS = 3000;
/** A code opens for ten minutes. */
export const INVITE_LIFE_MS = 480_000;

export class PhoneCard {
  /**
   * @param {Document} document
   * @param {{ createObjectURL(blob: Blob): string, revokeObjectURL(url: string): void }} urls
   * @param {() => Promise<Invite | null>} fetchInvite
   */
  constructor(document, urls, fetchInvite) {
    /** @param {string} id */
    const find = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
    this.urls = urls;
    this.fetchInvite = fetchInvite;
    this.picture = /** @type {HTMLImageElement} */ (find('picture'));
    this.qr = /** @type {HTMLImageElement} */ (find('qr'));
    this.link = /** @type {HTMLAnchorElement} */ (find('url'));
    this.invite = find('invite');
    this.button = find('code');
    this.pictureMs = -Infinity;
    this.inviteMs = -Infinity;
    this.wanted = false;
    this.known = 0;
  }

  /** Somebody has come, perhaps by the code that is shown: it opens once. @param {number} count */
  paired(count) {
    if (count > this.known) this.inviteMs = -Infinity;
    this.known = count;
  }

  /** The person wants to see the code, or not any more. */
  toggle() {
    this.wanted = !this.wanted;
    this.button.setAttribute('aria-pressed', String(this.wanted));
  }

  /**
   * @param {Uint8Array<ArrayBuffer>} jpeg
   * @param {number} now [ms]
   */
  take(jpeg, now) {
    this.pictureMs = now;
    this.replace(this.picture, new Blob([jpeg], { type: 'image/jpeg' }));
  }

  /** @param {number} now [ms] */
  tick(now) {
    const code = this.wanted || now - this.pictureMs > PICTURE_LIFE_MS;
    if (code && now - this.inviteMs > INVITE_LIFE_MS) void this.renew(now);
    this.picture.hidden = code;
    this.invite.hidden = !code || this.link.textContent === '';
  }

  /** @param {number} now [ms] */
  async renew(now) {
    this.inviteMs = now;
    const invite = await this.fetchInvite();
    if (invite === null) {
      this.inviteMs = now - INVITE_LIFE_MS + 5000; // soon again
      return;
    }
    this.replace(this.qr, new Blob([invite.qr_svg], { type: 'image/svg+xml' }));
    this.link.href = invite.url;
    this.link.textContent = invite.url;
  }

  /**
   * @param {HTMLImageElement} image
   * @param {Blob} blob
   */
  replace(image, blob) {
    const old = image.src;
    image.src = this.urls.createObjectURL(blob);
    if (old.startsWith('blob:')) this.urls.revokeObjectURL(old);
  }
}
