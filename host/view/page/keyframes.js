// SPDX-License-Identifier: Apache-2.0
// The list of keyframes: views to go back to, to play, to save as a camera path.

import { courseOf, keyframesOf, pathFile } from './path.js';
import { keyframesIn, tomlOf } from './toml.js';

export class Keyframes {
  #keys = [];
  #playing = false;

  // `page` has list (an element), origin() of the model, settings(), view(), go(view) and
  // download(blob, name).
  constructor(page) {
    this.page = page;
  }

  #changed() {
    this.page.list.replaceChildren(...this.#keys.map((key, i) => {
      const item = document.createElement('li');
      const button = (text, title, action) => {
        const made = document.createElement('button');
        made.textContent = text;
        made.title = title;
        made.addEventListener('click', action);
        return made;
      };
      item.append(
        `view at ${key.fov.toFixed(0)}\u00b0`,
        button('go', `Go to view ${i + 1}`, () => this.page.go(key)),
        button('\u00d7', `Remove view ${i + 1}`, () => {
          this.#keys.splice(i, 1);
          this.#changed();
        }),
      );
      return item;
    }));
  }

  add() {
    this.#keys.push(this.page.view());
    this.#changed();
  }

  clear() {
    this.#keys = [];
    this.#changed();
  }

  // Shows the path from begin to end; a second call ends it.
  play() {
    if (this.#playing || this.#keys.length === 0) {
      this.#playing = false;
      return;
    }
    this.#playing = true;
    const begin = performance.now();
    const { seconds, ...settings } = this.page.settings();
    const course = courseOf(this.#keys, settings);
    const step = (now) => {
      const share = Math.min((now - begin) / (1000 * seconds), 1);
      if (!this.#playing) return;
      this.page.go(course(share));
      if (share < 1) requestAnimationFrame(step);
      else this.#playing = false;
    };
    requestAnimationFrame(step);
  }

  save() {
    this.#save((...path) => JSON.stringify(pathFile(...path), null, 1), 'application/json', 'path.json');
  }

  saveToml() {
    this.#save(tomlOf, 'application/toml', 'path.toml');
  }

  #save(write, type, name) {
    if (this.#keys.length === 0) this.add();
    const text = write(this.#keys, this.page.settings(), this.page.origin());
    this.page.download(new Blob([text], { type }), name);
  }

  // Takes the keyframes of a file; its settings, or null where it has none.
  async load(file) {
    const text = await file.text();
    let stored = null;
    try {
      stored = file.name.endsWith('.toml') ? keyframesIn(text, this.page.origin())
        : keyframesOf(JSON.parse(text), this.page.view().distance, this.page.origin());
    } catch {
      return null;
    }
    if (!stored) return null;
    this.#keys = stored.keys;
    this.#changed();
    return stored;
  }
}
