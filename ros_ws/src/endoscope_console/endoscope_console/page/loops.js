/**
 * Actual against wanted angle: the loop that friction makes, without compensation and with it. Or the force at the tip
 * against the angle that it was measured at.
 */

import { Loop } from './history.js';
import { holding } from './plots.js';

const STEPS_DEG = [15, 30, 60, 90, 120];
const STEPS_N = [0.2, 0.5, 1, 2, 5, 10, 20];
export const UNCOMPENSATED = 'none';

const newPaths = () => ({ before: new Loop(), after: new Loop(), force: new Loop(900, 0.01) });

export class Loops {
  /**
   * @param boxes one element a joint, with a canvas and `[data-before]`, `[data-after]` for numbers
   * @param force button that changes to the force and back
   */
  constructor(boxes, force) {
    force.addEventListener('click', () => {
      this._ofForce = !this._ofForce;
      force.setAttribute('aria-pressed', String(this._ofForce));
      force.blur();
      this.draw();
    });
    this._ofForce = false;
    const style = getComputedStyle(document.documentElement);
    this._colour = (name) => style.getPropertyValue(`--${name}`).trim();
    this._boxes = boxes;
    /** Compensation that the loops called after are of. */
    this._mode = '';
    this.paths = boxes.map(newPaths);
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

  /** Take the newest force along a joint in N, and the angle in deg where it was measured; null where not known. */
  takeForce(joint, angle, force) {
    this.paths[joint].force.take(angle, force);
  }

  clear() {
    this.paths = this._boxes.map(newPaths);
    this.draw();
  }

  draw() {
    this._boxes.forEach((box, k) => {
      const { before, after, force } = this.paths[k];
      const canvas = box.querySelector('canvas');
      if (this._ofForce) this._draw(canvas, [[force, 'curve-1']], ['actual, deg', 'force, N'], STEPS_N);
      else this._draw(canvas, [[before, 'reference'], [after, 'actual']], ['wanted, deg', 'actual, deg']);
      box.querySelector('[data-of]').textContent = this._ofForce ? 'force' : 'RMS error';
      for (const part of ['before', 'after']) {
        const { rmse } = this.paths[k][part];
        const text = rmse === null ? '–' : `${rmse.toFixed(1)}°`;
        const element = box.querySelector(`[data-${part}]`);
        if (element.textContent !== text) element.textContent = text;
      }
    });
  }

  /** Draw paths of [loop, colour] in axes of two names; without steps of their own both have the same ones, and a diagonal. */
  _draw(canvas, paths, [across, up], steps = null) {
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
    const most = (name) => Math.max(0, ...paths.flatMap(([loop]) => loop[name].map(Math.abs)));
    const wide = holding(STEPS_DEG, 0, steps ? most('wanted') : Math.max(most('wanted'), most('actual')));
    const high = steps ? holding(steps, 0, most('actual')) : wide;
    // Left and below there is room for ticks and names.
    const [left, below] = [30, 26];
    const side = Math.min(width - left, height - below) / 2 - 6;
    const [midX, midY] = [left + (width - left) / 2, (height - below) / 2];
    const x = (value) => midX + (value / wide) * side;
    const y = (value) => midY - (value / high) * side;
    ctx.strokeStyle = this._colour('line');
    ctx.lineWidth = 1;
    ctx.strokeRect(midX - side, midY - side, 2 * side, 2 * side);
    ctx.beginPath();
    ctx.moveTo(x(-wide), y(0));
    ctx.lineTo(x(wide), y(0));
    ctx.moveTo(x(0), y(-high));
    ctx.lineTo(x(0), y(high));
    ctx.stroke();
    if (!steps) {
      ctx.strokeStyle = this._colour('wanted');
      ctx.setLineDash([4, 4]);
      ctx.beginPath();
      ctx.moveTo(x(-wide), y(-high));
      ctx.lineTo(x(wide), y(high));
      ctx.stroke();
      ctx.setLineDash([]);
    }
    for (const [loop, colour] of paths) {
      ctx.strokeStyle = this._colour(colour);
      ctx.lineWidth = 1.5;
      ctx.beginPath();
      loop.wanted.forEach((value, k) => ctx.lineTo(x(value), y(loop.actual[k])));
      ctx.stroke();
    }
    ctx.fillStyle = this._colour('quiet');
    ctx.font = `10px ${this._colour('sans')}`;
    ctx.textAlign = 'center';
    if (!paths.some(([loop]) => loop.wanted.length)) ctx.fillText(steps ? 'no force yet' : 'bend to and fro', midX, midY - side + 13);
    for (const value of [-wide, 0, wide]) ctx.fillText(String(value), x(value), midY + side + 11);
    ctx.fillText(across, midX, midY + side + 22);
    ctx.textAlign = 'right';
    for (const value of [-high, 0, high]) ctx.fillText(String(value), midX - side - 4, y(value) + 4);
    ctx.save();
    ctx.translate(midX - side - 24, midY);
    ctx.rotate(-Math.PI / 2);
    ctx.textAlign = 'center';
    ctx.fillText(up, 0, 0);
    ctx.restore();
  }
}
