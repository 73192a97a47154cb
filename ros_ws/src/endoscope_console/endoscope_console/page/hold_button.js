/** A button that acts once it has been held for a second: by a pointer, by Enter, or by a key of its own. */

import { toggle } from './elements.js';

const HELD_S = 1;
const TICK_MS = 20;
/** A page that stood still has not seen whether the button was released: more than this does not count. */
const LONGEST_TICK_S = 0.05;

export class HoldButton {
  /**
   * @param button element of the class `hold`
   * @param act called once, when it has been held long enough
   * @param may whether it may be held now
   */
  constructor(button, act, may = () => true) {
    this._may = may;
    this._button = button;
    this._act = act;
    this._by = null;
    this._timer = 0;
    button.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      this.press(`pointer ${event.pointerId}`);
    });
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      button.addEventListener(end, (event) => this.release(`pointer ${event.pointerId}`));
    }
    button.addEventListener('keydown', (event) => {
      if (event.code === 'Enter' && !event.repeat) this.press('Enter');
    });
    button.addEventListener('keyup', (event) => {
      if (event.code === 'Enter') this.release('Enter');
    });
    button.addEventListener('contextmenu', (event) => event.preventDefault());
    for (const [target, end] of [[button, 'blur'], [window, 'blur'], [document, 'visibilitychange'], [window, 'pagehide']]) {
      target.addEventListener(end, () => this.cancel());
    }
  }

  get enabled() {
    return !this._button.disabled;
  }

  set enabled(on) {
    toggle(this._button, 'disabled', !on);
    if (!on) this.cancel();
  }

  /** Begin to hold, by whatever names itself so. */
  press(by) {
    if (!this.enabled || this._by !== null || !this._may()) return;
    this._by = by;
    this._share = 0;
    let last = performance.now();
    this._timer = setInterval(() => {
      if (!this._may()) {
        this.cancel();
        return;
      }
      const now = performance.now();
      this._share += Math.min((now - last) / 1000, LONGEST_TICK_S) / HELD_S;
      last = now;
      this._button.style.setProperty('--share', String(Math.min(1, this._share)));
      if (this._share >= 1) {
        clearInterval(this._timer);
        this._timer = 0;
        this._act();
      }
    }, TICK_MS);
  }

  /** Let go; only by whom it is held. */
  release(by) {
    if (by === this._by) this.cancel();
  }

  cancel() {
    clearInterval(this._timer);
    this._timer = 0;
    this._by = null;
    this._button.style.setProperty('--share', '0');
  }
}
