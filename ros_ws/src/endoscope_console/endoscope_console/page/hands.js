/**
 * What the operator's hands do, as input frames: no browser in here, and time is passed in.
 *
 * One device holds at a time. A grip begins where a device is taken hold of while none is held, and has
 * a number above all before it; it ends when that device is released, or when anything makes `letGo`
 * necessary. What is still pressed then has to be released and pressed again.
 */

import { SOURCE } from './frames.js';

export const DEAD_ZONE = 0.1;
export const PIXELS_PER_RADIAN = 250;
/** Deflection in pixels at which the pad, used for speed, asks for all of it. */
export const PAD_THROW = 80;

const BUTTON = { pauses: [8, 1], enable: 9, mode: 3, hold: 5, turbo: 4, up: 12, down: 13 };
const DIRECTIONS = {
  ArrowLeft: [-1, 0], KeyA: [-1, 0],
  ArrowRight: [1, 0], KeyD: [1, 0],
  ArrowDown: [0, -1], KeyS: [0, -1],
  ArrowUp: [0, 1], KeyW: [0, 1],
};

/** Whether a key, by `event.code`, belongs to the hands. */
export const isMotionKey = (code) => code === 'Space' || code in DIRECTIONS;

const clip = (value, limit = 1) => Math.max(-limit, Math.min(limit, value));

/** Deflection of a stick's axis without its dead zone, -1 to 1; 0 for what is no number. */
export function deflection(axis) {
  if (!Number.isFinite(axis) || Math.abs(axis) <= DEAD_ZONE) return 0;
  return clip(Math.sign(axis) * (Math.abs(axis) - DEAD_ZONE) / (1 - DEAD_ZONE));
}

export class Hands {
  constructor() {
    /** Greatest grip so far, the server's included. */
    this.grips = 0;
    this.seq = 0;
    /** Why the last grip ended. */
    this.reason = '';
    /** 'speed' or 'position', for pad and stick apart; keys always ask for a speed. */
    this.modes = { pad: 'position', gamepad: 'speed' };
    /** The device that holds, or that was touched last: keyboard, pad or gamepad. */
    this.source = 'keyboard';
    this.held = false;
    this._keys = new Set();
    this._pointers = { pad: null, thumb: null };
    this._stick = null;
    this._buttons = new Set();
  }

  /** Continue after the greatest number of a grip that the server knows. */
  countFrom(grips) {
    this.grips = Math.max(this.grips, grips);
  }

  /** End the grip, whatever is still pressed; return whether there was one. */
  letGo(reason) {
    this._keys.clear();
    this._pointers = { pad: null, thumb: null };
    return this._end(reason);
  }

  /** A key went down; return whether the server must be notified. */
  keyDown(code, repeat) {
    const known = isMotionKey(code) || code.startsWith('Shift');
    if (repeat || !known || this._keys.has(code)) return false;
    this._keys.add(code);
    if (code in DIRECTIONS && !this.held) this.source = 'keyboard';
    if (code === 'Space') this._begin('keyboard');
    return true;
  }

  /** A key went up. */
  keyUp(code) {
    if (!this._keys.delete(code)) return false;
    this._check();
    return true;
  }

  /** A pointer went down: a mouse holds by the pad or the thumb's area alone, fingers by both together. */
  pointerDown(area, id, kind, x, y) {
    if (this._pointers[area] !== null) return false;
    this._pointers[area] = { id, mouse: kind === 'mouse', from: [x, y], at: [x, y] };
    if (!this.held) this.source = 'pad';
    this._begin('pad');
    return true;
  }

  /** A pointer moved; its place is in pixels, y downwards. */
  pointerMove(area, id, x, y) {
    const pointer = this._pointers[area];
    if (pointer?.id !== id) return false;
    pointer.at = [x, y];
    return true;
  }

  /** A pointer went up, was cancelled or lost. */
  pointerUp(area, id) {
    if (this._pointers[area]?.id !== id) return false;
    this._pointers[area] = null;
    this._check();
    return true;
  }

  /**
   * Look at the gamepad, `{axes, buttons: [bool]}` or null for none; return what its other buttons ask
   * for now: 'pause', 'mode', 'slower', 'faster', 'enable', and 'enable down' for as long as that one is.
   */
  gamepad(pad) {
    if (pad === null) {
      this._stick = null;
      if (this.source !== 'gamepad') return [];
      this._end('the gamepad was unplugged');
      // The frame that ends a grip and names another device says that this one is gone.
      this.source = 'keyboard';
      return [];
    }
    const down = new Set(pad.buttons.flatMap((pressed, k) => (pressed ? [k] : [])));
    const before = this._stick === null ? down : this._buttons;
    const holds = (set) => set.has(BUTTON.hold) || set.has(BUTTON.turbo);
    this._buttons = down;
    this._stick = {
      x: deflection(pad.axes[0]), y: -deflection(pad.axes[1]), hold: holds(down), turbo: down.has(BUTTON.turbo),
    };
    if (!this.held && (this._stick.x || this._stick.y)) this.source = 'gamepad';
    // A button that was down before anybody looked is no grip.
    if (holds(down) && !holds(before)) this._begin('gamepad');
    this._check();
    const fresh = (k) => down.has(k) && !before.has(k);
    const asked = [];
    if (BUTTON.pauses.some(fresh)) asked.push('pause');
    if (fresh(BUTTON.mode)) asked.push('mode');
    if (fresh(BUTTON.down)) asked.push('slower');
    if (fresh(BUTTON.up)) asked.push('faster');
    if (fresh(BUTTON.enable)) asked.push('enable');
    if (down.has(BUTTON.enable)) asked.push('enable down');
    return asked;
  }

  /** Change how pad or stick is taken; only while nothing is held. */
  toggleMode(device) {
    if (this.held) return false;
    this.modes[device] = this.modes[device] === 'speed' ? 'position' : 'speed';
    return true;
  }

  /** Whether one finger is down of the two that have to be. */
  get half() {
    const { pad, thumb } = this._pointers;
    return !this.held && Boolean((pad && !pad.mouse) !== (thumb && !thumb.mouse));
  }

  /** Whether anything is pressed or deflected that has to be released first. */
  get busy() {
    const { x, y } = this.motion;
    return this.held || ['keyboard', 'pad', 'gamepad'].some((d) => this._holds(d)) || Math.hypot(x, y) >= 0.1;
  }

  /** Whether the device in use asks for an angle. */
  get position() {
    return this.modes[this.source] === 'position';
  }

  /** The next frame, at `t` s; `seen` is the last picture drawn. */
  frame(t, { visible, focused, seen }) {
    this.seq += 1;
    return {
      pressed: this.held, turbo: this.held && this._turbo(), visible, focused, position: this.position,
      source: SOURCE[this.source], seq: this.seq, grip: this.held ? this.grips : 0, seen, t,
      ...this.motion,
    };
  }

  _holds(device) {
    const { pad, thumb } = this._pointers;
    if (device === 'keyboard') return this._keys.has('Space');
    if (device === 'pad') return Boolean(pad?.mouse || thumb?.mouse || (pad && thumb));
    return Boolean(this._stick?.hold);
  }

  /** Only a press of its own begins a grip of a device; what is pressed meanwhile never takes one over. */
  _begin(device) {
    if (this.held || !this._holds(device)) return;
    this.source = device;
    this.held = true;
    this.grips += 1;
    this.reason = '';
    const { pad } = this._pointers;
    if (pad) pad.from = pad.at;
  }

  _check() {
    if (this.held && !this._holds(this.source)) this._end('let go');
  }

  _end(reason) {
    const was = this.held;
    this.held = false;
    if (was) this.reason = reason;
    return was;
  }

  _turbo() {
    if (this.source === 'keyboard') return this._keys.has('ShiftLeft') || this._keys.has('ShiftRight');
    return this.source === 'gamepad' && Boolean(this._stick?.turbo);
  }

  /** Deflection or drag of the device in use; rad for an angle, -1 to 1 for a speed. */
  get motion() {
    if (this.source === 'gamepad') return { x: this._stick?.x ?? 0, y: this._stick?.y ?? 0 };
    if (this.source === 'pad') {
      const { pad } = this._pointers;
      if (!pad) return { x: 0, y: 0 };
      const [x, y] = [pad.at[0] - pad.from[0], pad.from[1] - pad.at[1]];
      if (this.modes.pad === 'position') return { x: x / PIXELS_PER_RADIAN, y: y / PIXELS_PER_RADIAN };
      return { x: clip(x / PAD_THROW), y: clip(y / PAD_THROW) };
    }
    let [x, y] = [0, 0];
    for (const code of this._keys) {
      x += DIRECTIONS[code]?.[0] ?? 0;
      y += DIRECTIONS[code]?.[1] ?? 0;
    }
    return { x: clip(x), y: clip(y) };
  }
}
