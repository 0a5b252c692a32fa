// SPDX-License-Identifier: Apache-2.0
// Keyframes in TOML, as `raysplats render --path path.toml` reads them: as much of the language as
// those files need.

import { HEIGHT, WIDTH } from './path.js';
import * as v from './vectors.js';

const ZERO = [0, 0, 0];
const UP = [0, -1, 0]; // of keys that do not say it
const FOV = 50;
const FPS = 30;

// `origin` is that of the model, as in path.js.
export function tomlOf(keys, { seconds, fps, closed, constant, width, height }, origin = ZERO) {
  const list = (point) => `[${point.join(', ')}]`;
  const lines = Object.entries({ seconds, fps, closed, width, height }).map(([name, value]) => `${name} = ${value}`);
  if (constant) lines.push('speed = "constant"');
  for (const key of keys) {
    const [, down, forward] = v.axesOf(key.turn);
    const eye = v.add(key.eye, origin);
    lines.push('', '[[key]]', `eye = ${list(eye)}`,
      `target = ${list(v.add(eye, v.scale(forward, key.distance)))}`,
      `up = ${list(v.scale(down, -1))}`, `fov = ${key.fov}`);
    if (key.seconds !== undefined) lines.push(`seconds = ${key.seconds}`);
  }
  return `${lines.join('\n')}\n`;
}

function valueOf(text) {
  if (text === 'true' || text === 'false') return text === 'true';
  if (/^(["']).*\1$/.test(text)) return text.slice(1, -1);
  if (/^\[.*\]$/.test(text)) {
    return text.slice(1, -1).split(',').map((x) => x.trim()).filter((x) => x !== '').map(valueOf);
  }
  const number = Number(text.replaceAll('_', ''));
  if (Number.isNaN(number)) throw new Error(`${text} is no value`);
  return number;
}

// What stands above the keys, and each of them. Throws for anything else.
function tablesOf(text) {
  const root = {};
  const keys = [];
  let table = root;
  // Arrays may go on over lines.
  const plain = text.replace(/#.*/g, '').replace(/\[[^[\]]*\]/g, (array) => array.replace(/\s+/g, ' '));
  for (const line of plain.split('\n').map((each) => each.trim()).filter((each) => each !== '')) {
    const found = /^(\w+)\s*=\s*(.+)$/.exec(line);
    if (/^\[\[\s*key\s*\]\]$/.test(line)) keys.push(table = {});
    else if (found) table[found[1]] = valueOf(found[2]);
    else throw new Error(`${line} is neither a value nor a key`);
  }
  return { root, keys };
}

function keyframeOf({ eye: place, target, up = UP, fov = FOV, seconds = 1 }, origin) {
  const line = v.sub(target, place);
  const forward = v.normalized(line);
  const right = v.cross(v.scale(up, -1), forward);
  if (!(v.length(right) > 0)) throw new Error('eye, target and up span no plane');
  const axes = [v.normalized(right), v.normalized(v.cross(forward, right)), forward];
  const eye = v.sub(place, origin);
  const key = { eye, turn: v.quaternionOf(axes), fov, distance: v.length(line), seconds };
  if (![...eye, ...key.turn, fov, key.distance, seconds].every(Number.isFinite)) throw new Error('no numbers');
  return key;
}

// The keyframes of a file and its settings; null where it is no camera path.
export function keyframesIn(text, origin = ZERO) {
  try {
    const { root, keys: tables } = tablesOf(text);
    const keys = tables.map((table) => keyframeOf(table, origin));
    if (keys.length === 0) return null;
    const closed = root.closed === true;
    const own = keys.slice(0, closed ? keys.length : -1).reduce((sum, key) => sum + key.seconds, 0);
    return {
      keys,
      closed,
      constant: root.speed === 'constant',
      model: 'pinhole',
      fps: root.fps ?? FPS,
      seconds: root.seconds ?? own,
      width: root.width ?? WIDTH,
      height: root.height ?? HEIGHT,
    };
  } catch {
    return null;
  }
}
