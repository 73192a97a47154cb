/** The force across the tip: when it is shown, how strongly a gamepad rumbles, in which words; and its bar. */

import { $, set, write } from './elements.js';

/** Time constant of what is drawn: the estimate is a mean over 0.1 s itself. */
const SMOOTHED_S = 0.1;
/** An arrow stays for so long after something was last seen to touch. */
const STAYS_S = 0.3;
/** End of the bar, as a multiple of what gives an alarm. */
const BEYOND = 2;

const newtons = (force) => force.toFixed(2);

export class TipForce {
  constructor() {
    this.clear();
  }

  clear() {
    /** `{size, least, most, seen}`, in N but for the last; null where no force is known. */
    this.now = null;
    /** `[x, y]` in N as drawn; null while nothing is to be seen. */
    this.arrow = null;
    this._force = null;
    this._seenAt = -Infinity;
    this._at = -Infinity;
  }

  /**
   * Take, at `t` s, force, lower and upper bounds along x and y in N and whether it is `seen`, each null where none
   * came, and the state's `tip`: how long the last force holds is judged by the server.
   */
  take(t, [x, y, lowX, lowY, highX, highY, seen], tip) {
    if (t < this._at) this.clear();
    if (!tip || tip.why) this.now = null;
    else if (x !== null || y !== null) {
      this._force = [x ?? 0, y ?? 0];
      const bounds = [[lowX ?? 0, highX ?? 0], [lowY ?? 0, highY ?? 0]];
      this.now = {
        size: Math.hypot(...this._force),
        least: Math.hypot(...bounds.map(([low, high]) => Math.max(low, -high, 0))),
        most: Math.hypot(...bounds.map(([low, high]) => Math.max(-low, high))),
        seen: seen === 1,
      };
    }
    if (this.now?.seen) this._seenAt = t;
    if (!this.now || t - this._seenAt > STAYS_S) this.arrow = null;
    else {
      const share = 1 - Math.exp((this._at - t) / SMOOTHED_S);
      const from = this.arrow ?? this._force;
      this.arrow = this._force.map((to, k) => from[k] + share * (to - from[k]));
    }
    this._at = t;
  }
}

/** The force now and its bounds, in words: `{size, between, why}`; of what would be seen and why none is known by the state's `tip`. */
export function inWords(tip, now) {
  if (!tip || tip.why || !now) return { size: '–', between: '', why: `no force: ${tip?.why || 'silent'}` };
  if (!now.seen) return { size: '', between: `nothing above ${newtons(tip.visible)} N`, why: '' };
  return { size: `${newtons(now.size)} N`, between: `(${newtons(now.least)} to ${newtons(now.most)})`, why: '' };
}

/** Strength of a rumble, 0 to 1: none up to what would be seen, all of it where there is an alarm. */
export function rumble(tip, now, alarm) {
  if (!now?.seen || !tip || tip.why) return 0;
  return Math.max(0, Math.min(1, (now.size - tip.visible) / Math.max(alarm - tip.visible, 1e-3)));
}

/** Show size, bounds and what would be seen, on a bar and in words; `limits` has the guard's and the alarm's in N. */
export function showForce(tip, now, limits) {
  const words = inWords(tip, now);
  write($('force-size'), words.size);
  write($('force-between'), words.between);
  write($('force-why'), words.why);
  set($('force'), 'data-known', String(!words.why));
  if (words.why) return;
  set($('force'), 'data-seen', String(now.seen));
  const bar = $('force-bar');
  const at = (force) => Math.min(force / (BEYOND * limits.force_alarm), 1) * 100;
  const place = (name, attribute, share) => set(bar.querySelector(`.${name}`), attribute, share.toFixed(1));
  place('band', 'x', at(now.least));
  place('band', 'width', at(now.most) - at(now.least));
  for (const [name, force] of [['estimate', now.size], ['visible', tip.visible], ['limit', limits.force], ['warns', limits.force_alarm]]) {
    for (const end of ['x1', 'x2']) place(name, end, at(force));
  }
  set(bar, 'aria-label', `force at the tip ${words.size} ${words.between}; alarm at ${limits.force_alarm} N, the guard's limit ${limits.force} N`);
}
