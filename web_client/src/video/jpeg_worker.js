/**
 * Worker that compresses frames to JPEG. In a page Chromium compresses a canvas when the page has nothing
 * else to do, and waits for that for up to 1 s, on a phone 4 s; in a worker it does so at once.
 */

/**
 * One picture to compress; it is closed here.
 * @typedef {object} JpegWish
 * @property {number} id
 * @property {VideoFrame | ImageBitmap} image
 * @property {number} width Of the JPEG.
 * @property {number} height
 * @property {number} quality 0 to 1.
 */

/** What became of it: its bytes, or why there are none. @typedef {{ id: number, data?: ArrayBuffer, error?: string }} JpegAnswer */

const worker = /** @type {any} */ (globalThis);
/** @type {OffscreenCanvas | null} */
let canvas = null;

/** @param {JpegWish} wish */
async function compress({ image, width, height, quality }) {
  if (canvas?.width !== width || canvas.height !== height) canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext('2d', { alpha: false });
  try {
    context?.drawImage(image, 0, 0, width, height);
  } finally {
    image.close();
  }
  const blob = await canvas.convertToBlob({ type: 'image/jpeg', quality });
  return blob.arrayBuffer();
}

worker.onmessage = async (/** @type {MessageEvent<JpegWish>} */ { data: wish }) => {
  const { id } = wish;
  try {
    const data = await compress(wish);
    worker.postMessage({ id, data }, [data]);
  } catch (error) {
    worker.postMessage({ id, error: String(error) });
  }
};
export {}; // its types are imported, so it is a module
