/** The page for operating: orders, their answers, and the state of the instrument. */

import { SIGN, standing } from './alarms.js';
import { keysAreTaken } from './dead_man.js';
import { $, each, make, set, toggle, write } from './elements.js';
import { inWords, isCalibrated, isOfNoClass, lamp, nameOf, nextStep, played, stateIsFresh } from './guidance.js';
import { HoldButton } from './hold_button.js';

const SCALES = [0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3];
/** Width in px that an alarm needs to be read, in the one line that they have. */
const ALARM_PX = 400;
const LOST_S = 10;
const CALIBRATE = 3;
const ANSWER_S = 8;
const SLIDING_MS = 1000;
/** Time within which the state shows a requested scale. */
const SCALE_SETTLES_MS = 1500;
/** A protective stop is not unlocked by the hand that is still pressing. */
const FAULT_REST_S = 2;
const RUMBLE = 'endoscope rumble';

const deg = (value, digits = 0) => (Number.isFinite(value) ? `${value.toFixed(digits)}°` : '–');

/** The scale of the list that is nearest to a value. */
export const nearestScale = (value) =>
  SCALES.reduce((best, scale, k) => (Math.abs(Math.log(scale / value)) < Math.abs(Math.log(SCALES[best] / value)) ? k : best), 0);

export class Operate {
  /** @param app state of the page, see main.js */
  constructor(app) {
    this.app = app;
    this._faultSince = null;
    this._answered = 0;
    // Since a calibration, until the instrument has moved otherwise.
    this._offersHome = false;
    this._sliding = 0;
    this._scaleAsked = NaN;
    this._scaleAskedAt = -Infinity;
    // Nothing moves by itself under a hand that holds.
    const free = () => !app.hands.held;
    this._holds = {
      KeyE: new HoldButton($('enable'), () => this._enable()),
      KeyH: new HoldButton($('home'), () => this._home(), free),
      KeyC: new HoldButton($('calibrate'), () => this._calibrate(), free),
    };
    this._buttons();
    this._keys();
  }

  /** Pause at once: end the grip and send the order, whoever has the controls. */
  pause() {
    const { app } = this;
    app.deadMan.letGo('paused');
    for (const hold of Object.values(this._holds)) hold.cancel();
    if (app.mayHalt()) this._order({ op: 'state', command: 'pause' }, 'Pause');
  }

  /** What a gamepad's other buttons ask for. */
  gamepadAsked(asked) {
    const { app } = this;
    const enable = this._holds.KeyE;
    if (!asked.includes('enable down')) enable.release('gamepad');
    if (asked.includes('pause')) this.pause();
    if (!app.mine || !app.shown() || !document.hasFocus()) return;
    if (asked.includes('enable')) enable.press('gamepad');
    if (asked.includes('mode')) this.toggleMode('gamepad');
    if (asked.includes('faster')) this._stepScale(1);
    if (asked.includes('slower')) this._stepScale(-1);
  }

  toggleMode(device) {
    if (this.app.hands.toggleMode(device)) this.render();
    else this.say('Let go first: the mode changes only while nothing is held.');
  }

  /** Show a text in the line for answers. */
  say(text) {
    write($('answer'), text);
    this._answered = performance.now();
  }

  /** Show the state of everything; several times a second, and at once on every change. */
  render() {
    const { app } = this;
    const { state, mine, role, connected } = app;
    const age = app.stateAge();
    const fresh = stateIsFresh(state, age);
    const word = fresh ? state.operating_state : state?.operating_state ? `${state.operating_state}?` : '…';
    write($('state'), word);
    set(document.body, 'data-state', fresh ? state.operating_state : 'UNKNOWN');
    const heard = Number.isFinite(age) ? `not heard for ${age.toFixed(0)} s` : 'waiting for the graph';
    write($('state-why'), fresh ? reasonOf(state) : state?.graph_ended ? 'the graph has ended' : heard);
    set($('state-why'), 'title', $('state-why').textContent);
    this._renderLamp();
    this._renderSigns();
    this._renderAlarms();
    const rests = this._restsAfterFault(fresh);
    if (state?.operating_state !== 'ENABLED' || state.dead_man?.state === 'ENGAGED') this._offersHome = false;
    const next = nextStep({
      connected, current: app.current(), role, mine, state, stateAge: age, rests, busy: app.hands.busy, half: app.hands.half, held: app.hands.held,
      touch: app.touch, home: this._offersHome, why: app.whyClosed,
    });
    write($('next'), next.text);
    set(document.body, 'data-step', String(next.step));
    for (const item of document.querySelectorAll('#guide li')) {
      const step = Number(item.dataset.step);
      const done = step < next.step && (step !== CALIBRATE || isCalibrated(state));
      set(item, 'data-is', step === next.step ? 'now' : done ? 'done' : 'later');
    }
    set(document.body, 'data-ready', String(state?.dead_man?.state === 'READY' && next.step > 0));
    this._renderOrders(fresh, rests);
    this._renderHand();
    this._renderTube(state ?? {});
    if (this._answered && performance.now() - this._answered > 1000 * ANSWER_S) {
      this._answered = 0;
      write($('answer'), '');
    }
  }

  _renderLamp() {
    const { app } = this;
    const shown = app.current() ? lamp(app.state) : 'UNKNOWN';
    write($('lamp'), shown);
    set($('lamp'), 'class', `lamp ${shown.toLowerCase()}`);
    set($('view'), 'data-lamp', shown);
    const deadMan = app.state?.dead_man;
    let why = '';
    if (shown === 'UNKNOWN') why = app.endedHere || 'nothing is heard of it';
    else if (shown === 'HELD') why = 'the hand holds; nothing follows yet';
    else if (shown === 'FOLLOWING') why = app.state.playing ? 'as long as you hold on' : 'the hand';
    else if (app.endedHere) why = app.endedHere;
    else if (deadMan?.state === 'READY') why = 'ready';
    else if (deadMan?.reason) why = inWords(deadMan.reason);
    write($('lamp-why'), why);
  }

  _renderSigns() {
    const { app } = this;
    const holder = app.state?.lease?.holder;
    write($('operator'), app.mine ? 'you' : nameOf(holder, app.state) || 'nobody');
    const age = app.pictureAge();
    write($('age'), Number.isFinite(age) ? (age < 10 ? `${Math.round(1000 * age)} ms` : 'old') : 'none');
    set($('age'), 'data-old', String(age > 0.3));
    const recorder = app.state?.recorder;
    write($('recorder'), recorder ? (recorder.recording ? `● ${recorder.bag.split('/').at(-1)}` : recorder.message.split(':')[0]) : '–');
    set($('recorder'), 'title', recorder ? `${recorder.message} ${recorder.bag}` : '');
  }

  _renderAlarms() {
    const { app } = this;
    const alarms = standing(app.state?.alarms, {
      connected: app.connected, everConnected: app.everConnected, pictureAge: app.pictureAge(),
      gamepadLost: app.deadMan?.gamepadLost, mine: app.mine, lost: performance.now() - app.lostAt < 1000 * LOST_S ? app.whyLost : '',
    });
    const fitting = Math.max(1, Math.floor(window.innerWidth / ALARM_PX));
    const shown = app.tab === 'see' ? alarms : alarms.slice(0, fitting);
    if (alarms.length > shown.length) {
      shown.push({ id: ' more', level: 'low', text: `+${alarms.length - shown.length}: tab See` });
    }
    each($('alarms'), shown, (alarm) => `${alarm.id} ${alarm.level}`, (alarm) => {
      const element = make('div', { class: `alarm ${alarm.level}` }, make('span', { class: 'visually-hidden' }, `${SIGN[alarm.level]}: `), make('span', { class: 'text' }));
      if (alarm.latched) {
        const button = make('button', { class: 'acknowledge' }, 'Seen');
        button.addEventListener('click', () => this._order({ op: 'acknowledge', alarm: alarm.id }, 'Seen'));
        element.append(button);
      }
      return element;
    }, (element, alarm) => {
      const why = inWords(app.state?.dead_man?.reason);
      write(element.querySelector('.text'), alarm.id === 'dead_man' && why ? `The hand was let go of: ${why}.` : alarm.text);
      set(element, 'title', element.querySelector('.text').textContent);
      const button = element.querySelector('button');
      if (button) toggle(button, 'disabled', app.role !== 'operator');
    });
  }

  /** Whether a FAULT is so young, or its cause so present, that it cannot be left yet. */
  _restsAfterFault(fresh) {
    const { state } = this.app;
    const fault = fresh && state.operating_state === 'FAULT';
    this._faultSince = fault ? (this._faultSince ?? performance.now()) : null;
    return fault && (performance.now() - this._faultSince <= 1000 * FAULT_REST_S || Boolean(state.causes?.length));
  }

  _renderOrders(fresh, rests) {
    const { app } = this;
    const { state, mine } = app;
    const may = mine && app.connected && app.shown();
    const now = fresh ? state.operating_state : null;
    const busy = Boolean(state?.calibration?.running);
    toggle($('pause'), 'disabled', !app.mayHalt());
    const claim = $('claim');
    const holder = state?.lease?.holder;
    write(claim, mine ? 'Give back' : holder && holder !== app.you ? 'Take over …' : 'Take the controls');
    set(claim, 'class', mine ? '' : 'main');
    toggle(claim, 'disabled', app.claiming || !app.connected || app.role !== 'operator');
    this._holds.KeyE.enabled = may && now !== null && now !== 'ENABLED' && !rests && !state.prepares;
    write($('enable').querySelector('span'), now === 'PAUSED' ? 'Resume' : 'Enable');
    this._holds.KeyH.enabled = may && now === 'ENABLED' && !busy;
    set($('home'), 'data-offered', String(this._offersHome));
    this._holds.KeyC.enabled = may && now === 'ENABLED' && !busy;
    toggle($('disable'), 'disabled', !app.mayHalt() || now === 'DISABLED');
  }

  _renderHand() {
    const { hands, mine, state, deadMan } = this.app;
    const free = mine && !hands.held;
    const engaged = Boolean(hands.held && state?.dead_man?.state === 'ENGAGED');
    set($('hand'), 'data-held', String(engaged));
    set($('hand'), 'data-live', String(mine));
    // A grip that was ended looks ended, however long it is still pressed.
    const looks = hands.held ? (engaged ? 'following' : 'spent') : 'off';
    set($('pad'), 'data-on', hands.source === 'pad' ? looks : 'off');
    set($('thumb'), 'data-on', looks);
    const position = hands.modes.pad === 'position';
    set($('mode-position'), 'aria-pressed', String(position));
    set($('mode-speed'), 'aria-pressed', String(!position));
    for (const id of ['mode-position', 'mode-speed', 'scale']) toggle($(id), 'disabled', !free);
    const scale = state?.console?.scale;
    write($('scale-value'), Number.isFinite(scale) ? String(Number(scale.toPrecision(2))) : '–');
    if (Number.isFinite(scale) && performance.now() > this._sliding) $('scale').value = String(nearestScale(scale));
    let device = this.app.touch ? '' : 'keys: arrows, or W A S D';
    if (deadMan?.gamepadUnknown) device = 'unsupported gamepad mapping: use another gamepad or browser';
    else if (deadMan?.hasGamepad) device = `gamepad: hold RB; stick asks for ${hands.modes.gamepad}`;
    if (deadMan?.rumbleRefused) device += `; it does not rumble: ${deadMan.rumbleRefused}`;
    write($('device'), device);
    toggle($('rumble').parentElement, 'hidden', !deadMan?.canRumble);
  }

  _renderTube(state) {
    const { mine } = this.app;
    const { calibration = {}, compensator = {}, recorder = {} } = state;
    const { running, step, progress, result } = calibration;
    const known = isCalibrated(state);
    toggle($('calibration-progress'), 'hidden', !running);
    if (running) $('calibration-progress').value = progress ?? 0;
    let text = 'Not calibrated yet.';
    if (running) text = `${step || 'calibrating'}, ${Math.round(100 * (progress ?? 0))} %`;
    else if (result) text = result.message || 'calibrated';
    write($('calibration-text'), text);
    // A reason takes the place of what was not found.
    toggle($('found'), 'hidden', isOfNoClass(state));
    write($('class'), known ? `${deg(result.class_deg)} (${Math.round(100 * (result.probability ?? 0))} %)` : '–');
    write($('size'), known ? deg(result.size_deg, 1) : '–');
    write($('interval'), result && Number.isFinite(result.low_deg) ? `${deg(result.low_deg, 1)} and ${deg(result.high_deg, 1)}` : '–');
    const select = $('compensator');
    const modes = this.app.modes;
    each(select, modes, (mode) => mode, (mode) => make('option', { value: mode }, mode.replaceAll('_', ' ')), () => {});
    if (document.activeElement !== select && compensator.wanted) select.value = compensator.wanted;
    toggle(select, 'disabled', !mine);
    const other = compensator.mode && compensator.mode !== compensator.wanted;
    write($('compensator-in-force'), other ? `(in force: ${compensator.mode.replaceAll('_', ' ')})` : '');
    toggle($('record'), 'disabled', !this.app.mayRecord());
    set($('record'), 'aria-pressed', String(Boolean(recorder.recording)));
    write($('record'), recorder.recording ? 'Stop recording' : 'Record');
    // What is enabled and not recorded is offered to be.
    set($('record'), 'class', this.app.mine && state.operating_state === 'ENABLED' && !recorder.recording ? 'main' : '');
    toggle($('mark'), 'disabled', !this.app.mayRecord());
  }

  async _order(order, name) {
    const answer = await this.app.orders.give(order);
    this.say(answer.ok ? `${name}: done${answer.why ? `, ${answer.why}` : ''}` : `${name} refused: ${answer.why}`);
    return answer;
  }

  async _calibrate() {
    const answer = await this._order({ op: 'calibrate' }, 'Calibrate');
    this._offersHome = answer.ok || isOfNoClass(this.app.state);
  }

  async _home() {
    this._offersHome = false;
    await this._order({ op: 'state', command: 'home' }, 'Home');
  }

  async _enable() {
    const command = this.app.state?.operating_state === 'PAUSED' ? 'resume' : 'enable';
    const name = command === 'resume' ? 'Resume' : 'Enable';
    const answer = await this._order({ op: 'state', command }, name);
    if (answer.ok && !this.app.state?.recorder?.recording) this.say(`${name}: done. Nothing is recorded: press Record to keep what follows.`);
  }

  async _claim() {
    const { app } = this;
    if (app.mine) {
      app.deadMan.letGo('given back');
      const answer = await this._order({ op: 'release' }, 'Give back');
      if (answer.ok) app.lost('');
      return;
    }
    const from = nameOf(app.state?.lease?.holder, app.state) || played(app.state);
    if (from && !(await this._mayTake(from))) return;
    if (from !== (nameOf(app.state?.lease?.holder, app.state) || played(app.state))) {
      this.say(`${from} has lost the controls meanwhile: ask again.`);
      return;
    }
    // Frames have to come from the start: a page that is silent for 2 s loses the controls, before it knows that it has them.
    app.claiming = true;
    this.render();
    const answer = await this._order({ op: 'claim', take: Boolean(from) }, 'Take the controls');
    app.claiming = false;
    if (answer.ok) app.claimed();
  }

  _mayTake(from) {
    const dialog = $('take');
    write($('take-from'), from);
    dialog.returnValue = 'no';
    dialog.showModal();
    return new Promise((resolve) => {
      dialog.addEventListener('close', () => resolve(dialog.returnValue === 'take'), { once: true });
    });
  }

  async _set(name, value) {
    const answer = await this._order({ op: 'set', [name]: value }, name);
    if (name === 'scale' && !answer.ok) this._scaleAskedAt = -Infinity;
  }

  _stepScale(step) {
    if (this.app.hands.held) {
      this.say('Let go first: the scale changes only while nothing is held.');
      return;
    }
    // What was asked for just now is not in the state yet.
    const fresh = performance.now() - this._scaleAskedAt < SCALE_SETTLES_MS;
    const now = fresh ? this._scaleAsked : this.app.state?.console?.scale;
    if (!Number.isFinite(now)) return;
    this._scaleAsked = SCALES[Math.max(0, Math.min(SCALES.length - 1, nearestScale(now) + step))];
    this._scaleAskedAt = performance.now();
    this._set('scale', this._scaleAsked);
  }

  _buttons() {
    const click = (id, act) => $(id).addEventListener('click', act);
    $('pause').addEventListener('pointerdown', () => this.pause());
    click('pause', (event) => {
      // A click of the pointer has been obeyed when it went down.
      if (event.detail === 0) this.pause();
    });
    click('claim', () => this._claim());
    click('disable', () => {
      this.app.deadMan.letGo('disabled');
      this._order({ op: 'state', command: 'disable' }, 'Disable');
    });
    click('record', () => this._order({ op: 'record', on: !this.app.state?.recorder?.recording }, 'Record'));
    $('keep').addEventListener('submit', (event) => {
      event.preventDefault();
      this._order({ op: 'mark', reason: $('mark-reason').value }, 'Keep');
      $('mark-reason').value = '';
      // Keys bend again.
      document.activeElement?.blur();
    });
    click('mode-position', () => this._mode('position'));
    click('mode-speed', () => this._mode('speed'));
    $('compensator').addEventListener('change', ({ target }) => {
      target.blur();
      this._set('compensator', target.value);
    });
    // What comes from the graph meanwhile must not pull the slider from under the hand.
    $('scale').addEventListener('input', () => {
      this._sliding = performance.now() + SLIDING_MS;
    });
    $('scale').addEventListener('change', ({ target }) => {
      target.blur();
      this._set('scale', SCALES[Number(target.value)]);
    });
    $('rumble').checked = localStorage.getItem(RUMBLE) !== 'off';
    $('rumble').addEventListener('change', ({ target }) => {
      target.blur();
      localStorage.setItem(RUMBLE, target.checked ? 'on' : 'off');
    });
    click('help-open', () => this._help());
  }

  _mode(mode) {
    if (this.app.hands.modes.pad !== mode) this.toggleMode('pad');
  }

  /** The grip is released first: the view is covered. */
  _help() {
    this.app.deadMan.letGo('the help is open');
    $('help').showModal();
    this.render();
  }

  _keys() {
    window.addEventListener('keydown', (event) => {
      // Pausing is never wrong, wherever the cursor stands and whatever else is down.
      if (event.code === 'Escape' && !event.repeat) this.pause();
      if (event.repeat || event.ctrlKey || event.metaKey || event.altKey || keysAreTaken()) return;
      if (event.key === '?') this._help();
      if (!this.app.mine || !this.app.shown()) return;
      this._holds[event.code]?.press(event.code);
      if (event.code === 'KeyM') this.toggleMode('pad');
      if (event.code === 'BracketLeft') this._stepScale(-1);
      if (event.code === 'BracketRight') this._stepScale(1);
    });
    window.addEventListener('keyup', (event) => this._holds[event.code]?.release(event.code));
  }
}

function reasonOf(state) {
  if (state.why) return state.why;
  if (state.operating_state === 'FAULT') return (state.causes ?? []).join('; ');
  return { ENABLED: 'it may move', PAUSED: 'position held', DISABLED: 'motors off' }[state.operating_state] ?? '';
}
