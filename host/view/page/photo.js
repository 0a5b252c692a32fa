// SPDX-License-Identifier: Apache-2.0
// The photo of a training camera over the picture that is drawn from there: beside it, or as their
// difference.

const SAME = 1e-6; // deviation of a pose that is no movement
const BRIGHTER = 4; // a difference of a quarter is white

// The photo of a camera by its number, at most so many pixels wide; null where there is none.
export async function fetchPhoto(number, resizeWidth = undefined) {
  const reply = await fetch(`api/photo/${number}`);
  if (!reply.ok) return null;
  return createImageBitmap(await reply.blob(), resizeWidth ? { resizeWidth } : {});
}

export class Photo {
  #camera = null;
  #number = -1;
  #bitmap = null;
  #asked = 0;

  // `redraw()` when a photo has come.
  constructor(redraw) {
    this.redraw = redraw;
    this.split = 0.5; // share of the picture that the photo covers, from the left
    this.difference = false;
  }

  // The view goes to a camera.
  async choose(camera, number) {
    this.#camera = camera.photo ? camera : null;
    this.#bitmap = null;
    this.#number = number;
    const asked = ++this.#asked;
    if (!this.#camera) return;
    const bitmap = await fetchPhoto(number);
    if (asked !== this.#asked) return;
    this.#bitmap = bitmap;
    this.redraw();
  }

  // Whether there is one for where the camera is.
  at(pose) {
    return this.#bitmap !== null && this.#camera.c2w.every((x, i) => Math.abs(x - pose[i]) < SAME);
  }

  // The number of the camera whose photo is there, -1 for none.
  get number() {
    return this.#bitmap ? this.#number : -1;
  }

  draw(context, picture, rig, width, height) {
    if (!this.at(rig.pose)) return;
    const half = (degrees) => Math.tan(0.5 * degrees * Math.PI / 180);
    // What the photo's height is of the picture's: their angles of view may differ.
    const tall = height * half(this.#camera.fov) / half(rig.fov);
    const wide = tall * this.#camera.aspect;
    const place = [(width - wide) / 2 + this.#camera.shift[0] * tall,
      (height - tall) / 2 + this.#camera.shift[1] * tall, wide, tall];
    context.save();
    context.beginPath();
    context.rect(0, 0, width * this.split, height);
    context.clip();
    if (this.difference) {
      const both = new OffscreenCanvas(Math.max(1, Math.round(width)), Math.max(1, Math.round(height)));
      const mixed = both.getContext('2d');
      mixed.drawImage(picture, 0, 0, both.width, both.height);
      mixed.globalCompositeOperation = 'difference';
      mixed.drawImage(this.#bitmap, ...place);
      // What the photo does not cover has no difference.
      mixed.globalCompositeOperation = 'destination-in';
      mixed.fillRect(...place);
      context.fillStyle = '#000';
      context.fillRect(0, 0, width, height);
      context.filter = `brightness(${BRIGHTER})`;
      context.drawImage(both, 0, 0, width, height);
    } else {
      context.drawImage(this.#bitmap, ...place);
    }
    context.restore();
    context.fillStyle = '#f0a030';
    context.fillRect(width * this.split - 1, 0, 2, height);
  }
}
