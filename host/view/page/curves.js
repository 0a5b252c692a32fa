// SPDX-License-Identifier: Apache-2.0
// Small curves over the iterations of a run.

const PAD = 4; // pixels above and below a curve

function extent(values) {
  const low = Math.min(...values);
  const high = Math.max(...values);
  return high > low ? [low, high] : [low - 0.5, high + 0.5];
}

// Values of single views scatter: their mean over a window is what can be read.
function smoothed(points, window) {
  return points.map(([x], i) => {
    const some = points.slice(Math.max(0, i - window + 1), i + 1);
    return [x, some.reduce((sum, [, y]) => sum + y, 0) / some.length];
  });
}

export class Curve {
  constructor(canvas) {
    this.canvas = canvas;
  }

  // `points` and `marks` are lists of [iteration, value]; `last` is the end of the axis.
  draw(points, marks, last) {
    const { canvas } = this;
    const density = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = Math.round(width * density);
    canvas.height = Math.round(height * density);
    if (points.length === 0) return;
    const context = canvas.getContext('2d');
    context.scale(density, density);
    const style = getComputedStyle(canvas);
    const mean = smoothed(points, Math.max(1, Math.round(points.length / 24)));
    const [low, high] = extent([...points, ...marks].map(([, y]) => y));
    const place = ([x, y]) => [x / last * width,
      height - PAD - (y - low) / (high - low) * (height - 2 * PAD)];
    const line = (list) => {
      context.beginPath();
      for (const point of list) context.lineTo(...place(point));
      context.stroke();
    };
    context.strokeStyle = style.getPropertyValue('--line');
    if (mean.length > 2) line(points);
    context.strokeStyle = context.fillStyle = style.getPropertyValue('--accent');
    context.lineWidth = 1.6;
    line(mean);
    for (const mark of marks) {
      context.beginPath();
      context.arc(...place(mark), 3, 0, 2 * Math.PI);
      context.fill();
    }
  }
}
