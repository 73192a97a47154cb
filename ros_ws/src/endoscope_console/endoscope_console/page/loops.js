/** Actual against wanted angle: the loop that friction makes, without compensation and with it. */

import { Loop } from './history.js';

const STEPS_DEG = [15, 30, 60, 90, 120];
export const UNCOMPENSATED = 'none';

export class Loops {
  /** @param boxes one element a joint, with a canvas and `[data-before]`, `[data-after]` for numbers */
  constructor(boxes) {
    const style = getComputedStyle(document.documentElement);
    this._colour = (name) => style.getPropertyValue(`--${name}`).trim();
    this._boxes = boxes;
    /** Compensation that the loops called after are of. */
    this._mode = '';
    this.paths = boxes.map(() => ({ before: new Loop(), after: new Loop() }));
    for (const box of boxes) new ResizeObserver(() => this.draw()).observe(box.querySelector('canvas'));
  }

  /** Take the newest angles of a joint in deg, under the compensator's mode; nothing where it is not known. */
  take(joint, mode, wanted, actual) {
    if (!mode) return;
    if (mode !== UNCOMPENSATED && mode !== this._mode) {
      this._mode = mode;
      for (const path of this.paths) path.after = new Loop();
    }
    const path = this.paths[joint][mode === UNCOMPENSATED ? 'before' : 'after'];
    path.take(wanted, actual);
  }

  clear() {
    this.paths = this._boxes.map(() => ({ before: new Loop(), after: new Loop() }));
    this.draw();
  }

  draw() {
    this._boxes.forEach((box, k) => {
      this._draw(box.querySelector('canvas'), this.paths[k]);
      for (const part of ['before', 'after']) {
        const { rmse } = this.paths[k][part];
        const text = rmse === null ? '–' : `${rmse.toFixed(1)}°`;
        const element = box.querySelector(`[data-${part}]`);
        if (element.textContent !== text) element.textContent = text;
      }
    });
  }

  _draw(canvas, { before, after }) {
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!width || !height) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const ctx = canvas.getContext('2d');
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    const most = Math.max(1, ...[before, after].flatMap((l) => [...l.wanted, ...l.actual].map(Math.abs)));
    const reach = STEPS_DEG.find((step) => step >= most) ?? most;
    // Left and below there is room for ticks and names.
    const [left, below] = [30, 26];
    const side = Math.min(width - left, height - below) / 2 - 6;
    const [midX, midY] = [left + (width - left) / 2, (height - below) / 2];
    const x = (deg) => midX + (deg / reach) * side;
    const y = (deg) => midY - (deg / reach) * side;
    ctx.strokeStyle = this._colour('line');
    ctx.lineWidth = 1;
    ctx.strokeRect(midX - side, midY - side, 2 * side, 2 * side);
    ctx.beginPath();
    ctx.moveTo(x(-reach), y(0));
    ctx.lineTo(x(reach), y(0));
    ctx.moveTo(x(0), y(-reach));
    ctx.lineTo(x(0), y(reach));
    ctx.stroke();
    ctx.strokeStyle = this._colour('wanted');
    ctx.setLineDash([4, 4]);
    ctx.beginPath();
    ctx.moveTo(x(-reach), y(-reach));
    ctx.lineTo(x(reach), y(reach));
    ctx.stroke();
    ctx.setLineDash([]);
    for (const [path, colour] of [[before, 'reference'], [after, 'actual']]) {
      ctx.strokeStyle = this._colour(colour);
      ctx.lineWidth = 1.5;
      ctx.beginPath();
      path.wanted.forEach((deg, k) => ctx.lineTo(x(deg), y(path.actual[k])));
      ctx.stroke();
    }
    ctx.fillStyle = this._colour('quiet');
    ctx.font = `10px ${this._colour('sans')}`;
    ctx.textAlign = 'center';
    if (!before.wanted.length && !after.wanted.length) ctx.fillText('bend to and fro', midX, midY - side + 13);
    for (const deg of [-reach, 0, reach]) ctx.fillText(String(deg), x(deg), midY + side + 11);
    ctx.fillText('wanted, deg', midX, midY + side + 22);
    ctx.textAlign = 'right';
    for (const deg of [-reach, 0, reach]) ctx.fillText(String(deg), midX - side - 4, y(deg) + 4);
    ctx.save();
    ctx.translate(midX - side - 24, midY);
    ctx.rotate(-Math.PI / 2);
    ctx.textAlign = 'center';
    ctx.fillText('actual, deg', 0, 0);
    ctx.restore();
  }
}
