// SPDX-License-Identifier: Apache-2.0
// A run in training: what it has reached, its curves, and what the page may ask of it.

import { Curve } from './curves.js';

const ASK = 1000; // milliseconds between questions

const $ = (id) => document.getElementById(id);

function duration(seconds) {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

export class Run {
  // `send` takes a message for the server; `ended` hears the last word on the run.
  constructor(send, ended) {
    this.send = send;
    this.ended = ended;
    this.state = null;
    this.curves = ['loss', 'psnr', 'count'].map((name) => new Curve($(`curve-${name}`)));
    $('run').hidden = false;
    $('pause').addEventListener('click', () => send({ type: this.state?.paused ? 'resume' : 'pause' }));
    $('save').addEventListener('click', () => send({ type: 'save' }));
    $('share').addEventListener('change', () => send({ type: 'share', share: $('share').value / 100 }));
    $('share').addEventListener('input', () => { $('share-text').textContent = `${$('share').value} %`; });
    this.#loop();
  }

  async #loop() {
    try {
      if (!document.hidden) await this.ask();
    } finally {
      setTimeout(() => this.#loop(), ASK);
    }
  }

  // Asks how far the run is and shows it.
  async ask() {
    try {
      const reply = await fetch('api/run');
      if (!reply.ok) return;
      this.state = await reply.json();
    } catch {
      return; // the banner says that the program does not answer
    }
    this.#show();
  }

  #show() {
    const { rows, tests, iterations, paused, share, left, ended } = this.state;
    $('pause').textContent = paused ? 'Resume' : 'Pause';
    if (document.activeElement !== $('share')) {
      $('share').value = Math.round(100 * share);
      $('share-text').textContent = `${$('share').value} %`;
    }
    const row = rows[rows.length - 1];
    if (row) {
      const [iteration, seconds, loss, psnr, gaussians] = row;
      $('bar').value = iteration / iterations;
      const rest = ended ? 'ended' : paused ? 'paused' : left === null ? '' : `about ${duration(left)} left`;
      $('progress').textContent = [`${iteration} of ${iterations} iterations`, duration(seconds), rest]
        .filter(Boolean).join(', ');
      $('text-loss').textContent = loss.toFixed(4);
      $('text-psnr').textContent = `${psnr.toFixed(2)} dB`
        + (tests.length ? `, test views ${tests[tests.length - 1][1].toFixed(2)} dB` : '');
      $('text-count').textContent = gaussians.toLocaleString('en');
    }
    const [loss, psnr, count] = this.curves;
    loss.draw(rows.map((r) => [r[0], r[2]]), [], iterations);
    psnr.draw(rows.map((r) => [r[0], r[3]]), tests, iterations);
    count.draw(rows.map((r) => [r[0], r[4]]), [], iterations);
    if (ended) this.ended(ended);
  }
}
