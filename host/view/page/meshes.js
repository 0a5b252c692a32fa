// SPDX-License-Identifier: Apache-2.0
// Meshes that are dropped on the picture: sent to the program, moved, turned, resized and given a
// material while it draws them.

const PART = 49152; // bytes of a message
const FORMATS = ['obj', 'ply', 'glb'];
const FIRST_SIZE = 0.25; // of a new mesh, in radii of the model
const REACH = 2; // of the sliders, in radii around where a mesh began
const SIZES = 3; // powers of ten that the slider of sizes spans, to both sides
const STEPS = 400;

export class Meshes {
  #list = []; // as the program has them
  #origin = new Map(); // where each began
  #chosen = 0;

  // `parent` holds select, sliders and buttons (index.html); `on` has send(message), sendBytes(bytes),
  // say(text), changed() and target(), the point that a new mesh comes to.
  constructor(parent, on) {
    this.parent = parent;
    this.on = on;
  }

  begin(radius) {
    this.radius = radius;
    const slider = (id, name, low, high, step) => {
      const input = document.createElement('input');
      Object.assign(input, { type: 'range', id: `mesh-${id}`, min: low, max: high, step });
      input.addEventListener('input', () => this.#place(true));
      input.addEventListener('change', () => this.#place(false));
      const label = document.createElement('label');
      label.append(name, input);
      return label;
    };
    const reach = REACH * radius;
    this.#part('sliders').replaceChildren(
      ...['x', 'y', 'z'].map((axis) => slider(`at-${axis}`, `Along ${axis}`, -reach, reach, 2 * reach / STEPS)),
      ...['x', 'y', 'z'].map((axis) => slider(`turn-${axis}`, `About ${axis}`, -180, 180, 1)),
      slider('size', 'Size', -SIZES, SIZES, 2 * SIZES / STEPS));
    this.#part('material').addEventListener('change', () => this.#place(false));
    this.#part('list').addEventListener('change', () => this.#choose(Number(this.#part('list').value)));
    this.#part('remove').addEventListener('click', () => this.on.send({ type: 'remove', mesh: this.#chosen }));
  }

  #part(name) {
    return this.parent.querySelector(`#mesh-${name}`);
  }

  // Sends a file; the program answers with the list, or says what is wrong with it.
  async drop(file) {
    const format = file.name.split('.').pop().toLowerCase();
    if (!FORMATS.includes(format)) {
      this.on.say('Meshes are OBJ, PLY or GLB files');
      return;
    }
    const bytes = new Uint8Array(await file.arrayBuffer());
    this.on.say(`${file.name} is on its way`);
    this.on.send({
      type: 'mesh', format, name: file.name, bytes: bytes.length,
      material: this.#part('material').value, at: this.on.target(), rotate: [0, 0, 0],
      size: FIRST_SIZE * this.radius,
    });
    for (let i = 0; i < bytes.length; i += PART) this.on.sendBytes(bytes.subarray(i, i + PART));
  }

  // The program's list of meshes.
  take(list) {
    const added = list.find((mesh) => !this.#list.some((known) => known.mesh === mesh.mesh));
    this.#list = list;
    for (const mesh of list) {
      if (!this.#origin.has(mesh.mesh)) this.#origin.set(mesh.mesh, { at: mesh.at, size: mesh.size });
    }
    this.#part('list').replaceChildren(...list.map((mesh) => {
      const option = document.createElement('option');
      option.value = mesh.mesh;
      option.textContent = `${mesh.name}, ${mesh.triangles} triangles`;
      return option;
    }));
    this.#part('controls').hidden = list.length === 0;
    const kept = list.some((mesh) => mesh.mesh === this.#chosen);
    if (added || !kept) this.#choose(added ? added.mesh : list[0]?.mesh ?? 0);
    else this.#choose(this.#chosen);
    this.on.changed();
  }

  // What of a view message the program leaves out while there are meshes, for the line of the status.
  leftOut({ near, order, background }) {
    if (this.#list.length === 0) return '';
    const names = [[near || undefined, 'near limit'], [order, 'order of hits'], [background, 'background']]
      .filter(([wish]) => wish !== undefined).map(([, name]) => name);
    return names.length === 0 ? '' : `, beside meshes without: ${names.join(', ')}`;
  }

  #choose(number) {
    this.#chosen = number;
    const mesh = this.#list.find((each) => each.mesh === number);
    if (!mesh) return;
    const origin = this.#origin.get(number);
    this.#part('list').value = number;
    this.#part('material').value = mesh.material;
    ['x', 'y', 'z'].forEach((axis, i) => {
      this.#part(`at-${axis}`).value = mesh.at[i] - origin.at[i];
      this.#part(`turn-${axis}`).value = mesh.rotate[i];
    });
    this.#part('size').value = Math.log10(mesh.size / origin.size);
  }

  #place(moving) {
    const mesh = this.#list.find((each) => each.mesh === this.#chosen);
    if (!mesh) return;
    const origin = this.#origin.get(mesh.mesh);
    const value = (name) => Number(this.#part(name).value);
    mesh.material = this.#part('material').value;
    mesh.at = ['x', 'y', 'z'].map((axis, i) => origin.at[i] + value(`at-${axis}`));
    mesh.rotate = ['x', 'y', 'z'].map((axis) => value(`turn-${axis}`));
    mesh.size = origin.size * 10 ** value('size');
    const { material, at, rotate, size } = mesh;
    this.on.send({ type: 'place', mesh: mesh.mesh, material, at, rotate, size, moving });
    this.on.changed();
  }
}
