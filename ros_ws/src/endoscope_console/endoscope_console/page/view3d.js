/** The bending section in space, on a 2D canvas: as it is, and as it is wanted. Lengths in m, z along the instrument. */

const TUBE = 0.0014;
const WIRE = 0.00115;
const WANTED = 0.0024;
const GROUND = -0.005;
/** Height in px at the foot of the picture that is kept for words. */
const FOOT = 88;
/** Smallest distance of the tensions' labels from the wires. */
const LABEL_PX = 78;
const RINGS_MM = [5, 10, 15];
const HOME = { azimuth: -0.42, elevation: 0.5, zoom: 1 };
const WIRES = [
  { name: 'x+', along: [1, 0] }, { name: 'x−', along: [-1, 0] },
  { name: 'y+', along: [0, 1] }, { name: 'y−', along: [0, -1] },
];
/** Length in m of an arrow of the force that gives an alarm, and the longest one. */
const [PUSH, LONGEST_PUSH] = [0.007, 0.014];
const FULL_TURN = 2 * Math.PI;

const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => {
  const n = Math.hypot(...a);
  return n > 0 ? [a[0] / n, a[1] / n, a[2] / n] : a;
};

/** A camera that looks at the middle of the section; +x is to the right of the picture, +y away. */
export class Camera {
  constructor(width, height, { azimuth, elevation, zoom } = HOME) {
    const [sa, ca, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
    const target = [0, 0, 0.0075];
    const distance = 0.11;
    const free = Math.max(height - FOOT, 100);
    this.eye = add(target, [sa * ce, -ca * ce, se], distance);
    this.right = [ca, sa, 0];
    this.ahead = unit(add(target, this.eye, -1));
    this.up = cross(this.right, this.ahead);
    this._focal = (distance * Math.min(width * 0.74, free) * 0.58 * zoom) / 0.02;
    this._centre = [width / 2, free * 0.53];
  }

  /** Place in the picture in px, and px a metre there. */
  project(point) {
    const seen = add(point, this.eye, -1);
    const scale = this._focal / Math.max(dot(seen, this.ahead), 1e-3);
    return [this._centre[0] + scale * dot(seen, this.right), this._centre[1] - scale * dot(seen, this.up), scale];
  }
}

/** Points of a centre line from its coordinates in a row; none where one of them is not known. */
export function points(coordinates) {
  const out = [];
  for (let k = 0; k < coordinates.length; k += 3) {
    const point = [coordinates[k], coordinates[k + 1], coordinates[k + 2]];
    if (!point.every(Number.isFinite)) return [];
    out.push(point);
  }
  return out;
}

/** Directions x and y of the instrument along a centre line, carried on without twist. */
export function frames(line) {
  let x = [1, 0, 0];
  return line.map((point, k) => {
    const tangent = unit(add(line[Math.min(k + 1, line.length - 1)], line[Math.max(k - 1, 0)], -1));
    x = unit(add(x, tangent, -dot(x, tangent)));
    return { point, tangent, x, y: cross(tangent, x) };
  });
}

/** The arrow of a force at the end of a centre line, which ends at the tube: `{from, to, size, level}`, in m and N. */
export function pushed(line, { force: [fx, fy], alarm, level }) {
  const { point, x, y } = frames(line).at(-1);
  const size = Math.hypot(fx, fy);
  const along = unit(add([fx * x[0], fx * x[1], fx * x[2]], y, fy));
  const to = add(point, along, -TUBE);
  return { from: add(to, along, -Math.min((PUSH * size) / alarm, LONGEST_PUSH)), to, size, level };
}

/** Colour of a tension between none and its ceiling, from the colours of a scale `[r, g, b]`. */
export function tensionColour(tension, ceiling, scale) {
  if (!Number.isFinite(tension)) return 'rgb(109 120 134)';
  // By the root, since most of what happens lies far below the ceiling.
  const at = Math.sqrt(Math.max(0, Math.min(1, tension / ceiling))) * (scale.length - 1);
  const [low, high] = [scale[Math.floor(at)], scale[Math.ceil(at)]];
  const mixed = low.map((value, k) => Math.round(value + (high[k] - value) * (at - Math.floor(at))));
  return `rgb(${mixed.join(' ')})`;
}

export class View3d {
  /**
   * @param canvas fills its box; turning it by dragging, nearer and farther by the wheel
   * @param reset button that is shown while it is turned
   */
  constructor(canvas, reset) {
    this._canvas = canvas;
    this._reset = reset;
    this._ctx = canvas.getContext('2d');
    this._ground = document.createElement('canvas');
    this._angles = { ...HOME };
    const style = getComputedStyle(document.documentElement);
    this._colour = (name) => style.getPropertyValue(`--${name}`).trim();
    this._tensions = [1, 2, 3, 4, 5].map((k) => {
      const hex = parseInt(this._colour(`tension-${k}`).slice(1), 16);
      return [(hex >> 16) & 255, (hex >> 8) & 255, hex & 255];
    });
    this._font = `12px ${this._colour('sans')}`;
    this._last = null;
    new ResizeObserver(() => this._resize()).observe(canvas);
    this._turnByHand();
  }

  /**
   * Draw `{wanted, actual}` in coordinates, `tensions` of the four wires in N and their `ceiling`, and what pushes
   * the tip: `{force, alarm, level}`, `[x, y]` in the tip's frame in N or null, what gives an alarm in N, and the level of the one that stands.
   */
  draw(scene) {
    this._last = scene;
    const { _ctx: ctx, _camera: camera } = this;
    if (!camera) return;
    ctx.setTransform(this._ratio, 0, 0, this._ratio, 0, 0);
    ctx.clearRect(0, 0, this._width, this._height);
    ctx.drawImage(this._ground, 0, 0, this._width, this._height);
    const base = [0, 0, GROUND];
    const actual = points(scene.actual);
    const wanted = points(scene.wanted);
    if (actual.length) this._shadow([base, ...actual]);
    if (wanted.length) this._wantedTube([base, ...wanted]);
    const push = actual.length && scene.push.force ? pushed(actual, scene.push) : null;
    const behind = push && dot(add(push.from, push.to, -1), this._camera.ahead) > 0;
    if (behind) this._push(push);
    if (actual.length) this._actualTube([base, ...actual], scene.tensions, scene.ceiling);
    if (push && !behind) this._push(push);
    if (wanted.length) this._wantedLine(wanted);
    this._numbers(scene.tensions, scene.ceiling);
  }

  _resize() {
    const { clientWidth: width, clientHeight: height } = this._canvas;
    if (!width || !height) return;
    this._ratio = Math.min(window.devicePixelRatio || 1, 2);
    [this._width, this._height] = [width, height];
    for (const canvas of [this._canvas, this._ground]) {
      canvas.width = Math.round(width * this._ratio);
      canvas.height = Math.round(height * this._ratio);
    }
    this._look();
  }

  _look() {
    if (!this._width) return;
    // Seen from elsewhere, the tip does not go where the hand goes.
    this._reset.hidden = this._angles.azimuth === HOME.azimuth && this._angles.elevation === HOME.elevation;
    this._camera = new Camera(this._width, this._height, this._angles);
    this._drawGround();
    if (this._last) this.draw(this._last);
  }

  /** Ground, its rings and axes; they change only with the camera. */
  _drawGround() {
    const ctx = this._ground.getContext('2d');
    ctx.setTransform(this._ratio, 0, 0, this._ratio, 0, 0);
    ctx.clearRect(0, 0, this._width, this._height);
    ctx.font = this._font;
    const [line, quiet] = [this._colour('line'), this._colour('quiet')];
    const last = RINGS_MM.at(-1) / 1000;
    RINGS_MM.toReversed().forEach((mm, k) => {
      this._circle(ctx, [0, 0, GROUND], [1, 0, 0], [0, 1, 0], mm / 1000);
      if (k === 0) {
        ctx.fillStyle = 'rgb(255 255 255 / 2.5%)';
        ctx.fill();
      }
      ctx.strokeStyle = line;
      ctx.lineWidth = 1;
      ctx.stroke();
    });
    for (let k = 0; k < 12; k++) {
      const [c, s] = [Math.cos((k * FULL_TURN) / 12), Math.sin((k * FULL_TURN) / 12)];
      ctx.globalAlpha = 0.4;
      this._path(ctx, [[0.005 * c, 0.005 * s, GROUND], [last * c, last * s, GROUND]]);
      ctx.stroke();
      ctx.globalAlpha = 1;
    }
    ctx.strokeStyle = quiet;
    ctx.fillStyle = quiet;
    ctx.lineWidth = 1.5;
    ctx.textAlign = 'center';
    ctx.textBaseline = 'middle';
    for (const [axis, name] of [[[1, 0], 'bend x  →'], [[0, 1], 'bend y  ↑']]) {
      const at = (r) => [r * axis[0], r * axis[1], GROUND];
      const side = [0.0006 * axis[1], 0.0006 * axis[0], 0];
      this._path(ctx, [at(0.002), at(last)]);
      ctx.stroke();
      this._path(ctx, [add(at(last - 0.0012), side), at(last), add(at(last - 0.0012), side, -1)]);
      ctx.stroke();
      const [x, y] = this._camera.project(at(last + 0.0016));
      ctx.fillText(name, x, y);
    }
    ctx.textAlign = 'left';
    for (const mm of RINGS_MM) {
      const [x, y] = this._camera.project([(mm / 1000) * 0.94, (-mm / 1000) * 0.342, GROUND]);
      ctx.fillText(`${mm} mm`, x + 3, y + 7);
    }
  }

  _shadow(line) {
    const ctx = this._ctx;
    const flat = line.map(([x, y]) => [x, y, GROUND]);
    ctx.lineCap = ctx.lineJoin = 'round';
    ctx.strokeStyle = 'rgb(0 0 0 / 45%)';
    ctx.lineWidth = 2 * TUBE * this._camera.project(flat[0])[2];
    this._path(ctx, flat);
    ctx.stroke();
    // How high the tip is, and above what.
    const tip = line.at(-1);
    ctx.strokeStyle = this._colour('quiet');
    ctx.lineWidth = 1;
    ctx.setLineDash([2, 4]);
    this._path(ctx, [tip, flat.at(-1)]);
    ctx.stroke();
    ctx.setLineDash([]);
    const [x, y] = this._camera.project(flat.at(-1));
    ctx.beginPath();
    ctx.arc(x, y, 3, 0, FULL_TURN);
    ctx.fillStyle = this._colour('quiet');
    ctx.fill();
  }

  _wantedTube(line) {
    const ctx = this._ctx;
    ctx.strokeStyle = this._colour('wanted');
    ctx.globalAlpha = 0.2;
    ctx.lineCap = 'butt';
    ctx.lineJoin = 'round';
    ctx.lineWidth = 2 * WANTED * this._camera.project(line.at(-1))[2];
    this._path(ctx, line);
    ctx.stroke();
    ctx.globalAlpha = 0.8;
    ctx.lineWidth = 1.5;
    ctx.setLineDash([7, 5]);
    for (const side of [1, -1]) {
      ctx.beginPath();
      this._edge(line, side * WANTED).forEach(([x, y]) => ctx.lineTo(x, y));
      ctx.stroke();
    }
    ctx.setLineDash([]);
    const end = frames(line).at(-1);
    this._circle(ctx, end.point, end.x, end.y, WANTED);
    ctx.stroke();
    ctx.globalAlpha = 1;
  }

  _wantedLine(line) {
    const ctx = this._ctx;
    ctx.strokeStyle = this._colour('wanted');
    ctx.lineWidth = 2;
    ctx.setLineDash([8, 6]);
    this._path(ctx, line);
    ctx.stroke();
    ctx.setLineDash([]);
  }

  _actualTube(line, tensions, ceiling) {
    const { _ctx: ctx, _camera: camera } = this;
    const along = frames(line);
    const wires = WIRES.map(({ along: [a, b] }, k) => {
      const out = along.map((f) => add([a * f.x[0], a * f.x[1], a * f.x[2]], f.y, b));
      const path = along.map((f, i) => add(f.point, out[i], WIRE));
      return { path, out, colour: tensionColour(tensions[k], ceiling, this._tensions) };
    });
    const behind = (wire, i) => dot(wire.out[i], camera.ahead) > 0;
    const stretch = (back) => {
      ctx.lineCap = 'round';
      for (const wire of wires) {
        ctx.strokeStyle = wire.colour;
        ctx.globalAlpha = back ? 0.45 : 1;
        ctx.lineWidth = back ? 3 : 4;
        ctx.beginPath();
        let drawing = false;
        wire.path.forEach((point, i) => {
          const here = behind(wire, i) === back;
          const [x, y] = camera.project(point);
          if (here && drawing) ctx.lineTo(x, y);
          else if (here) ctx.moveTo(x, y);
          drawing = here;
        });
        ctx.stroke();
      }
      ctx.globalAlpha = 1;
    };
    stretch(true);
    ctx.lineJoin = 'round';
    ctx.lineCap = 'butt';
    ctx.strokeStyle = 'rgb(242 244 248 / 22%)';
    ctx.lineWidth = 2 * TUBE * camera.project(along[Math.floor(along.length / 2)].point)[2];
    this._path(ctx, line);
    ctx.stroke();
    ctx.strokeStyle = this._colour('actual');
    ctx.lineWidth = 1.2;
    ctx.globalAlpha = 0.4;
    for (let i = 5; i < along.length - 1; i += 5) {
      this._circle(ctx, along[i].point, along[i].x, along[i].y, TUBE);
      ctx.stroke();
    }
    ctx.globalAlpha = 1;
    ctx.lineWidth = 2.5;
    for (const side of [1, -1]) {
      ctx.beginPath();
      this._edge(line, side * TUBE).forEach(([x, y]) => ctx.lineTo(x, y));
      ctx.stroke();
    }
    stretch(false);
    const tip = along.at(-1);
    this._circle(ctx, tip.point, tip.x, tip.y, TUBE);
    ctx.fillStyle = dot(tip.tangent, camera.ahead) < 0 ? this._colour('actual') : 'rgb(242 244 248 / 35%)';
    ctx.fill();
    ctx.strokeStyle = this._colour('actual');
    ctx.stroke();
  }

  /** An arrow that pushes the tip, with its size. */
  _push({ from, to, size, level }) {
    const { _ctx: ctx, _camera: camera } = this;
    const [[x0, y0], [x1, y1]] = [camera.project(from), camera.project(to)];
    const length = Math.hypot(x1 - x0, y1 - y0);
    const [ux, uy] = length > 0 ? [(x1 - x0) / length, (y1 - y0) / length] : [0, 1];
    const head = Math.min(12, 0.6 * length);
    const [xh, yh] = [x1 - head * ux, y1 - head * uy];
    ctx.lineCap = 'butt';
    ctx.lineJoin = 'round';
    for (const [colour, wider] of [[this._colour('background'), 4], [this._colour(level ? `alarm-${level}` : 'ink'), 0]]) {
      ctx.strokeStyle = ctx.fillStyle = colour;
      ctx.lineWidth = 4 + wider;
      ctx.beginPath();
      ctx.moveTo(x0, y0);
      ctx.lineTo(xh, yh);
      ctx.stroke();
      ctx.beginPath();
      ctx.moveTo(x1, y1);
      ctx.lineTo(xh - 0.6 * head * uy, yh + 0.6 * head * ux);
      ctx.lineTo(xh + 0.6 * head * uy, yh - 0.6 * head * ux);
      ctx.closePath();
      ctx.fill();
      ctx.lineWidth = wider;
      if (wider) ctx.stroke();
    }
    ctx.font = `600 13px ${this._colour('sans')}`;
    ctx.textBaseline = 'middle';
    ctx.textAlign = Math.abs(ux) < 0.5 ? 'center' : ux > 0 ? 'right' : 'left';
    const words = [`${size.toFixed(2)} N`, x0 - 8 * ux, y0 - 14 * uy];
    ctx.strokeStyle = this._colour('background');
    ctx.lineWidth = 4;
    ctx.strokeText(...words);
    ctx.fillText(...words);
  }

  /** Tensions in numbers, beside where the wires leave the ground. */
  _numbers(tensions, ceiling) {
    const { _ctx: ctx, _camera: camera } = this;
    ctx.font = `600 13px ${this._colour('sans')}`;
    ctx.textAlign = 'center';
    ctx.textBaseline = 'middle';
    WIRES.forEach(({ name, along: [a, b] }, k) => {
      const foot = camera.project([WIRE * a, WIRE * b, GROUND]);
      const end = camera.project([0.0088 * a, 0.0088 * b, GROUND]);
      // In a small picture too, they leave the section free.
      const away = Math.max(1, LABEL_PX / Math.hypot(end[0] - foot[0], end[1] - foot[1]));
      const x = foot[0] + away * (end[0] - foot[0]);
      const y = Math.min(foot[1] + away * (end[1] - foot[1]), this._height - FOOT - 4);
      ctx.strokeStyle = tensionColour(tensions[k], ceiling, this._tensions);
      ctx.lineWidth = 2;
      ctx.beginPath();
      ctx.moveTo(foot[0], foot[1]);
      ctx.lineTo(x, y);
      ctx.stroke();
      const text = `${name}  ${Number.isFinite(tensions[k]) ? tensions[k].toFixed(1) : '–'} N`;
      const width = ctx.measureText(text).width + 26;
      ctx.fillStyle = this._colour('background');
      ctx.beginPath();
      ctx.roundRect(x - width / 2, y - 12, width, 24, 6);
      ctx.fill();
      ctx.stroke();
      ctx.fillStyle = tensionColour(tensions[k], ceiling, this._tensions);
      ctx.fillRect(x - width / 2 + 7, y - 5, 10, 10);
      ctx.fillStyle = this._colour('ink');
      ctx.fillText(text, x + 8, y + 1);
    });
  }

  _path(ctx, line) {
    ctx.beginPath();
    for (const point of line) {
      const [x, y] = this._camera.project(point);
      ctx.lineTo(x, y);
    }
  }

  _circle(ctx, centre, x, y, radius) {
    ctx.beginPath();
    for (let k = 0; k < 40; k++) {
      const turn = (k * FULL_TURN) / 40;
      const [px, py] = this._camera.project(add(add(centre, x, radius * Math.cos(turn)), y, radius * Math.sin(turn)));
      ctx.lineTo(px, py);
    }
    ctx.closePath();
  }

  /** Outline of a tube to one side, in the picture. */
  _edge(line, radius) {
    const at = line.map((point) => this._camera.project(point));
    return at.map(([x, y, scale], k) => {
      const [x0, y0] = at[Math.max(0, k - 1)];
      const [x1, y1] = at[Math.min(at.length - 1, k + 1)];
      const length = Math.hypot(x1 - x0, y1 - y0) || 1;
      return [x - (radius * scale * (y1 - y0)) / length, y + (radius * scale * (x1 - x0)) / length];
    });
  }

  _turnByHand() {
    const canvas = this._canvas;
    const angles = this._angles;
    let from = null;
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      from = { x: event.clientX, y: event.clientY, ...angles };
    });
    canvas.addEventListener('pointermove', (event) => {
      if (!from) return;
      angles.azimuth = from.azimuth - (event.clientX - from.x) / 160;
      angles.elevation = Math.max(0.05, Math.min(1.5, from.elevation + (event.clientY - from.y) / 160));
      this._look();
    });
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      canvas.addEventListener(end, () => {
        from = null;
      });
    }
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      angles.zoom = Math.max(0.5, Math.min(3, angles.zoom * Math.exp(-event.deltaY / 600)));
      this._look();
    }, { passive: false });
    const reset = () => {
      Object.assign(angles, HOME);
      this._look();
      this._reset.blur();
    };
    canvas.addEventListener('dblclick', reset);
    this._reset.addEventListener('click', reset);
  }
}
