// SPDX-License-Identifier: Apache-2.0
// The channel to the server: asks for pictures, hands them over, comes back after a break.

const HEADER = 32;
const MAGIC = 0x46565352; // "RSVF"
const RETRY = 1000; // milliseconds
const REST = 200; // without movement, until a picture of full size is asked for
const LOST = 2000; // after which a picture of a movement is no longer waited for

export class Connection {
  #socket = null;
  #asked = 0; // number of the last request
  #waiting = null; // { id, since } of a picture of a movement that is on its way
  #dirty = false;
  #timer = 0;
  #keeping = 0; // id of the view whose picture is to be a file, 0 for none

  // `view()` gives what is to be seen now; `on` has picture(header, blob), a promise, text(message),
  // open(), lost() and answers(), which finds out whether there is somebody to come back to.
  constructor(view, on) {
    this.view = view;
    this.on = on;
    this.#open();
  }

  #open() {
    this.#socket = new WebSocket(`ws://${location.host}/ws`);
    this.#socket.binaryType = 'arraybuffer';
    this.#socket.onopen = () => {
      this.#waiting = null;
      this.on.open();
      if (!document.hidden) this.rest();
    };
    this.#socket.onmessage = ({ data }) => {
      if (typeof data === 'string') this.on.text(JSON.parse(data));
      else this.#take(data);
    };
    this.#socket.onclose = () => {
      this.on.lost();
      this.#comeBack();
    };
  }

  #comeBack() {
    setTimeout(async () => {
      if (await this.on.answers()) this.#open();
      else this.#comeBack();
    }, RETRY);
  }

  #take(data) {
    const words = new DataView(data);
    if (data.byteLength < HEADER || words.getUint32(0, true) !== MAGIC) return;
    const flags = words.getUint32(20, true);
    const header = {
      id: words.getUint32(4, true),
      width: words.getUint32(8, true),
      height: words.getUint32(12, true),
      samples: words.getUint32(16, true),
      last: (flags & 1) !== 0,
      png: (flags & 2) !== 0,
      iteration: words.getUint32(24, true),
      milliseconds: words.getFloat32(28, true),
    };
    header.kept = header.png && header.id === this.#keeping;
    if (header.kept) this.#keeping = 0;
    const type = header.png ? 'image/png' : 'image/jpeg';
    const shown = this.on.picture(header, new Blob([new Uint8Array(data, HEADER)], { type }));
    // It is on its way until it is seen: a page that is slow to decode asks for no second one.
    shown.finally(() => {
      if (this.#waiting && header.id >= this.#waiting.id) this.#waiting = null;
      if (this.#dirty && !this.#waiting) this.#ask();
    });
  }

  send(message) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  sendBytes(bytes) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(bytes);
  }

  nextId() {
    return ++this.#asked;
  }

  // The view has changed. While one picture is on its way the next is not asked for, so that what
  // is asked for is always the newest.
  changed() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.rest(), REST);
    const late = this.#waiting && performance.now() - this.#waiting.since > LOST;
    if (this.#waiting && !late) this.#dirty = true;
    else this.#ask();
  }

  #ask() {
    this.#dirty = false;
    const id = this.nextId();
    this.#waiting = { id, since: performance.now() };
    this.send({ type: 'view', id, moving: true, ...this.view() });
  }

  // Nobody looks: nothing is wanted until the next movement.
  leave() {
    clearTimeout(this.#timer);
    this.#dirty = false;
    this.#waiting = null;
    this.send({ type: 'leave' });
  }

  // Nothing moves: the picture of full size. A movement has taken the place of what was to be kept:
  // that is asked for again.
  rest() {
    clearTimeout(this.#timer);
    this.#dirty = false;
    this.#waiting = null;
    const id = this.nextId();
    if (this.keeping) this.#keeping = id;
    this.send({ type: 'view', id, moving: false, png: this.keeping, ...this.view() });
  }

  // The next picture with all its samples comes without losses, and its header says `kept`.
  keep() {
    this.#keeping = this.#asked + 1;
    this.rest();
  }

  get keeping() {
    return this.#keeping !== 0;
  }
}
