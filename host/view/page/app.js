// SPDX-License-Identifier: Apache-2.0
// The page: what people do with mouse, fingers and keys becomes a camera, pictures of it come back.

import { Rig } from './camera.js';
import { Connection } from './connection.js';
import { Crop } from './crop.js';
import { Keyframes } from './keyframes.js';
import { TrainingCameras } from './cameras.js';
import { Meshes } from './meshes.js';
import { Photo } from './photo.js';
import { Pointers } from './pointers.js';
import { Run } from './run.js';

const $ = (id) => document.getElementById(id);
const TURN = 0.006; // radians per pixel
const KEY_TURN = 1.2; // radians per second
const FLY = 0.5; // distances to the centre per second
const CLICK = 4; // pixels that a click may slip
const REST = 80; // milliseconds after which a pointer does not move
const READ = 3000; // milliseconds in which a sentence is read

const picture = $('picture');
const overlay = $('overlay');
let state = null;
let told = ''; // the state as the program wrote it
let rig = null;
let link = null;
let home = null;
let picking = 0; // id of the last question for a point
let frames = []; // when the last pictures of movements came
let came = 0; // pictures so far
let drawn = 0; // the one on the page, as they came
let facts = ''; // of the last picture, where it came after the last sentence
let resting = 0; // timer until the pointer is taken to rest
let reading = 0; // timer while a sentence is read
const held = new Set(); // keys
let run = null; // while the model trains
let over = false; // the run has said that it ends
let nearChosen = false; // the model's own holds until somebody moves the slider

// What automated tests look at; nothing here reads it.
const seen = { pictures: 0, last: null, lost: 0, id: 0, errors: [] };
window.raysplats = seen;

// A sentence for people, which pictures do not take away before it is read.
function say(text) {
  facts = '';
  $('status').textContent = text;
  clearTimeout(reading);
  reading = setTimeout(() => {
    reading = 0;
    if (facts) $('status').textContent = facts;
  }, READ);
}

function tell(text) {
  facts = text;
  if (!reading) $('status').textContent = text;
}

// The part of the stage that the picture fills: all of it, or what a panorama leaves black.
function box() {
  const [width, height] = [picture.clientWidth, picture.clientHeight];
  if (rig.model !== 'equirectangular') return { left: 0, top: 0, width, height };
  const wide = Math.min(width, 2 * height);
  return { left: (width - wide) / 2, top: (height - wide / 2) / 2, width: wide, height: wide / 2 };
}

function size() {
  const density = Math.min(window.devicePixelRatio || 1, 2);
  const { width, height } = box();
  return [width, height].map((side) => Math.max(1, Math.round(side * density)));
}

function wanted() {
  const color = $('background').value;
  const view = { c2w: rig.pose, model: rig.model, fov: rig.fov, size: size(), output: $('output').value };
  if (nearChosen) view.near = nearDepth();
  if ($('order').value) view.order = $('order').value;
  if ($('own-background').checked) {
    view.background = [1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16) / 255);
  }
  return view;
}

function nearDepth() {
  return Number($('near').value) ** 2 * state.radius;
}

function changed() {
  const around = rig.model === 'equirectangular';
  $('model').value = rig.model;
  $('fov').max = rig.widest;
  $('fov').value = rig.fov;
  $('fov').disabled = around;
  $('fov-text').textContent = around ? 'all around' : `${Math.round(rig.fov)}\u00b0`;
  picture.classList.toggle('whole', around);
  $('save-toml').disabled = rig.model !== 'pinhole';
  $('near-text').textContent = nearDepth().toPrecision(2);
  link.changed();
  drawOverlay();
}

function drawOverlay() {
  const density = window.devicePixelRatio || 1;
  overlay.width = Math.round(overlay.clientWidth * density);
  overlay.height = Math.round(overlay.clientHeight * density);
  const context = overlay.getContext('2d');
  context.scale(density, density);
  // Other lenses bend lines and photos.
  const straight = rig.model === 'pinhole';
  $('photo-section').hidden = !straight || !photo.at(rig.pose);
  if (!straight) return;
  for (const layer of [crop, cameras]) layer.draw(context, rig, overlay.clientWidth, overlay.clientHeight);
  photo.draw(context, picture, rig, overlay.clientWidth, overlay.clientHeight);
}

// Choosing the camera that is there already brings its photo back.
function goTo(camera) {
  go(camera.c2w, camera.fov);
  photo.choose(camera, state.cameras.indexOf(camera)).catch(() => {});
}

function setUp() {
  const chosen = $('up').value;
  if (chosen === 'start') rig.up = [...state.up];
  else if (chosen === 'view') rig.up = rig.axes[1].map((x) => -x);
  else rig.up = chosen.split(',').map(Number);
  $('up-text').textContent = chosen === 'start' ? ''
    : `--up ${rig.up.map((x) => Number(x.toPrecision(4))).join(',')}`;
  if (chosen !== 'view') rig.level();
  changed();
}

async function show(header, blob) {
  if (header.kept) download(blob, 'view.png');
  const number = ++came;
  const bitmap = await createImageBitmap(blob);
  if (number < drawn) return bitmap.close(); // a newer one has been quicker
  drawn = number;
  picture.width = bitmap.width;
  picture.height = bitmap.height;
  picture.getContext('2d').drawImage(bitmap, 0, 0);
  bitmap.close();
  seen.id = header.id;
  seen.pictures += 1;
  if (photo.at(rig.pose)) drawOverlay();
  seen.last = header;
  const now = performance.now();
  frames = frames.filter((time) => now - time < 1000);
  frames.push(now);
  const moving = header.samples === 1 && !header.last;
  const step = run ? `, iteration ${header.iteration}` : '';
  const speed = moving && frames.length > 2 ? `, ${frames.length} pictures a second` : '';
  const samples = header.samples > 1 ? `, ${header.samples} samples` : '';
  const keeping = link.keeping ? ', saving...' : '';
  tell(`${header.width} \u00d7 ${header.height}${samples}, ${header.milliseconds.toFixed(0)} ms`
    + `${speed}${step}${keeping}${meshes.leftOut(wanted())}`);
}

function download(blob, name) {
  const address = URL.createObjectURL(blob);
  const anchor = document.createElement('a');
  anchor.href = address;
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

function heard(message) {
  if (message.type === 'pick' && message.id === picking) {
    if (message.point) {
      rig.center(message.point);
      changed();
    } else {
      say('Nothing is there to turn around');
    }
  } else if (message.type === 'error') {
    seen.errors.push(message.text);
    say(message.text);
  } else if (message.type === 'note') {
    say(message.text);
  } else if (message.type === 'meshes') {
    meshes.take(message.meshes);
    seen.meshes = message.meshes;
  } else if (message.type === 'scene') {
    seen.scene = message.text;
    download(new Blob([message.text], { type: 'text/plain' }), 'scene.toml');
  } else if (message.type === 'run' && run) {
    if (message.ended) run.ended(message.ended);
    else run.ask();
  }
}

function banner(text) {
  $('banner').textContent = text;
  $('banner').hidden = text === '';
}

// Whether the program that this page shows is there. A new start has a new token, which comes to this
// page too once its address is open in another one; what shows something else needs another page.
async function answers() {
  const reply = await fetch('api/state').catch(() => null);
  if (reply?.status === 403) {
    banner('The program has been started anew: open the address that it has printed.');
  }
  if (!reply?.ok) return false;
  if (await reply.text() !== told) location.reload();
  return true;
}

function go(pose, fov) {
  rig.pose = pose;
  if (fov) rig.fov = fov;
  rig.face(state.center);
  changed();
}

function click(x, y) {
  if (rig.model !== 'pinhole') return;
  const found = cameras.at(rig, x, y, overlay.clientWidth, overlay.clientHeight);
  if (found) goTo(found);
}

// A pointer that moves on asks for nothing.
function hover(event) {
  clearTimeout(resting);
  if (event.buttons !== 0 || rig.model !== 'pinhole') return;
  const { offsetX, offsetY } = event;
  resting = setTimeout(() => {
    cameras.hover(rig, offsetX, offsetY, overlay.clientWidth, overlay.clientHeight).catch(() => {});
  }, REST);
}

function pick(x, y) {
  const { left, top, width, height } = box();
  const px = [(x - left) / width, (y - top) / height];
  if (px.some((share) => share < 0 || share > 1)) return;
  picking = link.nextId();
  link.send({ type: 'pick', id: picking, ...wanted(), output: 'color', px });
}

function drag(dx, dy, sideways) {
  if (sideways) {
    const unit = rig.pixel(box().height);
    rig.move(-dx * unit, -dy * unit, 0);
  } else if ($('mode').value === 'fly') {
    // What is under the pointer goes along: the camera turns the other way, ...
    rig.look(0.5 * dx * TURN, 0.5 * dy * TURN);
  } else {
    // ... or around the centre, which is the opposite sense.
    rig.orbit(-dx * TURN, -dy * TURN);
  }
  changed();
}

let clock = 0;
function fly(now) {
  const passed = Math.min((now - clock) / 1000, 0.1);
  clock = now;
  const key = (plus, minus) => (held.has(plus) ? 1 : 0) - (held.has(minus) ? 1 : 0);
  const step = FLY * Math.max(rig.distance, 0.05 * state.radius) * passed * (held.has('shift') ? 4 : 1);
  const [right, down, forward] = [key('d', 'a'), key('q', 'e'), key('w', 's')];
  const [yaw, pitch] = [key('arrowleft', 'arrowright'), key('arrowup', 'arrowdown')];
  if (right || down || forward) rig.move(right * step, down * step, forward * step);
  if (yaw || pitch) rig.look(yaw * KEY_TURN * passed, pitch * KEY_TURN * passed);
  if (right || down || forward || yaw || pitch) changed();
  if (held.size > 0) requestAnimationFrame(fly);
}

// Whether a control with the focus has its own use for a key: fields for text for all of them, lists and
// sliders for the arrows.
function takes(control, key) {
  if (control.matches('input:not([type=range], [type=checkbox], [type=color], [type=file])')) return true;
  return key.startsWith('arrow') && control.matches('select, input[type=range]');
}

function keyDown(event) {
  if ($('help').open || event.ctrlKey || event.metaKey || event.altKey) return;
  const key = event.key.toLowerCase();
  if (takes(event.target, key)) return;
  const actions = {
    '?': () => { held.clear(); $('help').showModal(); },
    f: () => { $('mode').value = $('mode').value === 'fly' ? 'orbit' : 'fly'; },
    r: () => { rig.keyframe = home; changed(); },
    u: () => { rig.level(); changed(); },
    k: () => keyframes.add(),
    c: () => { $('show-cameras').click(); },
    p: () => $('toggle').click(),
  };
  if (actions[key]) {
    event.preventDefault();
    actions[key]();
  } else if ('wasdqe'.includes(key) || key.startsWith('arrow') || key === 'shift') {
    // A page scrolls by arrows, and a list goes to what begins with a letter.
    if (key !== 'shift') event.preventDefault();
    if (held.size === 0) {
      clock = performance.now();
      requestAnimationFrame(fly);
    }
    held.add(key);
  }
}

const cameras = new TrainingCameras($('cameras'), goTo, drawOverlay);
const photo = new Photo(drawOverlay);
const crop = new Crop($('crop-sliders'), $('crop-text'), drawOverlay);
const meshes = new Meshes($('mesh-section'), {
  send: (message) => link.send(message),
  sendBytes: (bytes) => link.sendBytes(bytes),
  say,
  changed,
  target: () => rig.target,
});
const keyframes = new Keyframes({
  list: $('keyframes'),
  origin: () => state.origin,
  settings: () => {
    const [width, height] = size();
    return {
      seconds: Number($('seconds').value) || 5,
      fps: Number($('fps').value) || 30,
      closed: $('closed').checked,
      constant: $('constant').checked,
      model: rig.model,
      width: Number($('path-width').value) || width,
      height: Number($('path-height').value) || height,
    };
  },
  view: () => rig.keyframe,
  go: (key) => { rig.keyframe = key; changed(); },
  download,
});

function wire() {
  new Pointers(picture, { drag, zoom: (factor) => { rig.zoom(factor); changed(); }, click, pick, slip: CLICK });
  picture.addEventListener('pointermove', hover);
  document.addEventListener('keydown', keyDown);
  document.addEventListener('keyup', (event) => held.delete(event.key.toLowerCase()));
  window.addEventListener('blur', () => held.clear());
  new ResizeObserver(() => changed()).observe(picture);
  $('fov').addEventListener('input', () => { rig.fov = Number($('fov').value); changed(); });
  $('model').addEventListener('change', () => { rig.lens = $('model').value; changed(); });
  $('near').addEventListener('input', () => { nearChosen = true; });
  $('output').addEventListener('change', changed);
  $('order').addEventListener('change', changed);
  $('up').addEventListener('change', setUp);
  $('split').addEventListener('input', () => {
    photo.split = Number($('split').value) / 100;
    drawOverlay();
  });
  $('difference').addEventListener('change', () => {
    photo.difference = $('difference').checked;
    drawOverlay();
  });
  $('show-crop').addEventListener('change', () => {
    crop.shown = $('show-crop').checked;
    $('crop-sliders').hidden = !crop.shown;
    drawOverlay();
  });
  for (const id of ['near', 'own-background', 'background']) {
    $(id).addEventListener('input', changed);
  }
  $('home').addEventListener('click', () => { rig.keyframe = home; changed(); });
  $('level').addEventListener('click', () => { rig.level(); changed(); });
  $('png').addEventListener('click', () => {
    tell('saving...');
    link.keep();
  });
  $('toggle').addEventListener('click', () => document.body.classList.toggle('bare'));
  $('show-cameras').addEventListener('change', () => {
    cameras.shown = $('show-cameras').checked;
    drawOverlay();
  });
  $('add-key').addEventListener('click', () => keyframes.add());
  $('clear-keys').addEventListener('click', () => keyframes.clear());
  $('play').addEventListener('click', () => keyframes.play());
  $('save-path').addEventListener('click', () => keyframes.save());
  $('save-toml').addEventListener('click', () => keyframes.saveToml());
  $('load-path').addEventListener('change', async (event) => {
    const stored = await keyframes.load(event.target.files[0]);
    event.target.value = '';
    if (!stored) {
      say('That file holds no camera path');
      return;
    }
    for (const name of ['seconds', 'fps']) $(name).value = stored[name];
    for (const name of ['width', 'height']) $(`path-${name}`).value = stored[name];
    for (const name of ['closed', 'constant']) $(name).checked = stored[name];
    rig.lens = stored.model;
    changed();
  });
  const stage = $('stage');
  stage.addEventListener('dragover', (event) => event.preventDefault());
  stage.addEventListener('drop', (event) => {
    event.preventDefault();
    if (!state.takes_meshes) say('Meshes cannot be dropped here');
    else if (event.dataTransfer.files.length > 0) meshes.drop(event.dataTransfer.files[0]);
  });
  $('mesh-file').addEventListener('change', (event) => {
    meshes.drop(event.target.files[0]);
    event.target.value = '';
  });
  $('mesh-save').addEventListener('click', () => link.send({ type: 'scene', id: link.nextId(), ...wanted() }));
  document.addEventListener('visibilitychange', () => {
    if (document.hidden) link.leave();
    else link.rest();
  });
}

async function start() {
  const reply = await fetch('api/state');
  told = await reply.text();
  if (!reply.ok) throw new Error(told);
  state = JSON.parse(told);
  rig = new Rig(state.up);
  rig.pose = state.start.c2w;
  rig.fov = state.start.fov;
  rig.face(state.center);
  home = rig.keyframe;
  document.title = `${state.name} - RaySplats`;
  $('title').textContent = state.name;
  $('about').textContent = state.about;
  $('camera-section').hidden = state.cameras.length === 0;
  $('near').disabled = !state.has_near;
  $('near').value = state.has_near ? Math.sqrt(Math.min(state.near / state.radius, 1)) : 0;
  for (const option of $('output').options) {
    if (['depth', 'normals', 'hits'].includes(option.value)) option.disabled = !state.has_depth;
  }
  $('order').disabled = !state.has_order;
  for (const id of ['own-background', 'background']) $(id).disabled = !state.has_background;
  const missing = [[state.has_depth, 'depth, normals, number of hits'], [state.has_near, 'near limit'],
    [state.has_order, 'order of hits'], [state.has_background, 'background']]
    .filter(([has]) => !has).map(([, name]) => name);
  $('missing').hidden = missing.length === 0;
  $('missing').textContent = `Not here, because of its surfaces: ${missing.join(', ')}.`;
  cameras.fill(state.cameras, state.center);
  crop.begin(state.center, state.radius, state.origin);
  $('mesh-section').hidden = !state.takes_meshes;
  meshes.begin(state.radius);
  tell('Waiting for the first picture; kernels may have to be compiled');
  link = new Connection(wanted, {
    picture: show,
    text: heard,
    open: () => {
      banner('');
      if (state.takes_meshes) link.send({ type: 'meshes' });
    },
    lost: () => {
      seen.lost += 1;
      if (!over) banner('The program does not answer: it may have ended. Trying again.');
    },
    answers,
  });
  if (state.trains) {
    run = new Run((message) => link.send(message), (text) => {
      over = true;
      banner(link.keeping ? `${text} The picture that was to be saved could not be drawn before.` : text);
    });
    seen.run = run;
  }
  seen.rig = rig;
  seen.photo = photo;
  wire();
  changed();
}

start().catch((error) => banner(`The page cannot start: ${error.message}`));
