/**
 * Sends what the hands do, 50 times a second and at once on every change, from the thread that the operator uses:
 * a page that hangs, is hidden or covered must fall silent. A Worker would go on holding.
 */

import { isMotionKey } from './hands.js';

const PERIOD_MS = 20;
/** A drag is sent at most this often, so that no mouse is fast enough to be taken for a flood. */
const MOVE_MS = 10;
/** Length of one rumble, which is asked for anew at half of it: a page that hangs stops rumbling. */
const RUMBLE_MS = 200;
/** After the page has come to the front, no key that goes down is taken for a press. */
const SETTLED_MS = 500;

const writes = (element) =>
  element instanceof HTMLInputElement ? element.type !== 'range' && element.type !== 'checkbox'
    : element instanceof HTMLTextAreaElement || element instanceof HTMLSelectElement || Boolean(element?.isContentEditable);

/** Whether keys belong to a text field, a list or a dialog now. */
export const keysAreTaken = () => writes(document.activeElement) || document.querySelector('dialog[open]') !== null;

export class DeadMan {
  /**
   * @param hands what is pressed and pulled
   * @param areas `{pad, thumb}`: elements
   * @param page `mine()`: whether this page has the controls, `speaks()`: or is about to; `shown()`: whether the section can be seen;
   *   `seen()`: last picture drawn; `send(frame)`; `asked(what)`: a gamepad's button; `ended(reason)`: a grip was ended;
   *   `rumble()`: how strongly the gamepad rumbles now, 0 to 1
   */
  constructor(hands, areas, page) {
    this._hands = hands;
    this._page = page;
    this._focused = document.hasFocus();
    this._focusedAt = -Infinity;
    this._sent = 0;
    this._pad = null;
    this.gamepadLost = false;
    this.gamepadUnknown = false;
    this.rumbleRefused = '';
    this._rumbledAt = -Infinity;
    this._keys();
    for (const [name, element] of Object.entries(areas)) this._area(name, element);
    this._ends();
    setInterval(() => this._tick(), PERIOD_MS);
  }

  /** Whether a gamepad is read. */
  get hasGamepad() {
    return this._pad !== null;
  }

  /** Whether the gamepad can rumble. */
  get canRumble() {
    const motors = this._pad?.vibrationActuator;
    return Boolean(motors?.playEffect) && (motors.effects?.includes('dual-rumble') ?? true);
  }

  /** End the grip, and say so at once. */
  letGo(reason) {
    const was = this._hands.letGo(reason);
    this.send();
    if (was) this._page.ended(reason);
  }

  /** Send a frame now, if anybody wants to hear it. */
  send() {
    if (!this._page.speaks()) return;
    this._sent = performance.now();
    this._page.send(this._hands.frame(this._sent / 1000, {
      visible: document.visibilityState === 'visible' && this._page.shown(),
      focused: this._focused && document.hasFocus(),
      seen: this._page.seen(),
    }));
  }

  _tick() {
    this._readGamepad();
    // An input that has just been sent stands for this beat.
    if (performance.now() - this._sent >= PERIOD_MS / 2) this.send();
  }

  _readGamepad() {
    const all = [...navigator.getGamepads()].filter((pad) => pad?.connected);
    const pad = all.find(({ mapping }) => mapping === 'standard') ?? null;
    this.gamepadUnknown = pad === null && all.length > 0;
    if (pad === null && this._pad !== null) this._unplugged();
    if (pad !== null) this.gamepadLost = false;
    this._pad = pad;
    const held = this._hands.held;
    const buttons = pad?.buttons.map(({ pressed }) => pressed);
    const asked = pad ? this._hands.gamepad({ axes: pad.axes, buttons }) : [];
    this._page.asked(asked);
    if (held !== this._hands.held) this.send();
    this._rumble();
  }

  _rumble() {
    // Of a hidden page it would be refused.
    const may = this.canRumble && !this.rumbleRefused && document.visibilityState === 'visible';
    const strength = may ? this._page.rumble() : 0;
    const now = performance.now();
    if (!strength || now - this._rumbledAt < RUMBLE_MS / 2) return;
    this._rumbledAt = now;
    const how = { duration: RUMBLE_MS, strongMagnitude: strength, weakMagnitude: strength };
    this._pad.vibrationActuator.playEffect('dual-rumble', how).catch(({ message }) => {
      this.rumbleRefused = message;
    });
  }

  _unplugged() {
    this.rumbleRefused = '';
    this.gamepadLost = true;
    const held = this._hands.held;
    this._hands.gamepad(null);
    this._pad = null;
    if (held && !this._hands.held) {
      this.send();
      this._page.ended(this._hands.reason);
    }
  }

  _keys() {
    window.addEventListener('keydown', (event) => {
      // On a Mac the release of another key is not reported while this one is down.
      if (event.metaKey) this.letGo('the Command key is down');
      if (keysAreTaken() || event.ctrlKey || event.metaKey || event.altKey) return;
      if (!this._page.mine() || !this._page.shown()) return;
      // Space must press no button, arrows must move no slider, and neither may scroll.
      if (event.code === 'Space' || (isMotionKey(event.code) && (this._hands.held || !onSlider()))) event.preventDefault();
      // What was held in another window goes on repeating here, and not all browsers call that a repeat.
      const repeats = event.repeat || performance.now() - this._focusedAt < SETTLED_MS;
      if (this._hands.keyDown(event.code, repeats)) this.send();
    });
    window.addEventListener('keyup', (event) => {
      if (event.code === 'Space' && this._page.mine() && this._page.shown() && !keysAreTaken()) event.preventDefault();
      // A key that goes up is always heard, wherever the cursor stands by then.
      if (this._hands.keyUp(event.code)) this.send();
    });
  }

  _area(name, element) {
    const hands = this._hands;
    element.addEventListener('pointerdown', (event) => {
      if (event.button !== 0 || !this._page.mine() || !this._page.shown()) return;
      event.preventDefault();
      document.activeElement?.blur();
      element.setPointerCapture(event.pointerId);
      if (hands.pointerDown(name, event.pointerId, event.pointerType, event.clientX, event.clientY)) this.send();
    });
    element.addEventListener('pointermove', (event) => {
      if (!hands.pointerMove(name, event.pointerId, event.clientX, event.clientY)) return;
      // Another button pressed or released on the way comes as a move.
      if (event.pointerType === 'mouse' && !(event.buttons & 1)) {
        if (hands.pointerUp(name, event.pointerId)) this.send();
      } else if (performance.now() - this._sent >= MOVE_MS) this.send();
    });
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      element.addEventListener(end, (event) => {
        if (hands.pointerUp(name, event.pointerId)) this.send();
      });
    }
    element.addEventListener('contextmenu', (event) => event.preventDefault());
  }

  _ends() {
    window.addEventListener('focus', () => {
      this._focused = true;
      this._focusedAt = performance.now();
      this.send();
    });
    window.addEventListener('blur', () => {
      this._focused = false;
      this.letGo('this page is not in front');
    });
    document.addEventListener('visibilitychange', () => {
      if (document.visibilityState === 'hidden') this.letGo('this page was hidden');
      else this.send();
    });
    window.addEventListener('pagehide', () => this.letGo('this page was left'));
    document.addEventListener('freeze', () => this.letGo('this page was frozen'));
    window.addEventListener('gamepaddisconnected', () => {
      if (this._pad !== null && ![...navigator.getGamepads()].some((pad) => pad?.connected && pad.index === this._pad.index)) {
        this._unplugged();
      }
    });
  }
}

const onSlider = () => document.activeElement instanceof HTMLInputElement && document.activeElement.type === 'range';
