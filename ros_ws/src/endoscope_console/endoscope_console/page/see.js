/** Health of all nodes, counters, states and connected operators. */

import { $, each, make, set, write } from './elements.js';

const LEVELS = { ok: ['good', 'ok'], warning: ['warning', '! warning'], error: ['error', '!!! error'], stale: ['stale', 'stale'] };
const STATES_KEPT = 200;
const LATE_S = 3.5;

const seconds = (age) => (Number.isFinite(age) ? `${age.toFixed(age < 10 ? 1 : 0)} s ago` : '–');

export class See {
  constructor(app) {
    this._app = app;
    this._states = [];
  }

  /** Take note of a state; done also while the page is not shown. */
  take(state) {
    const last = this._states[0];
    const text = `${state.operating_state}${state.why ? `: ${state.why}` : ''}`;
    if (last?.text === text) return;
    this._states.unshift({ text, at: new Date(), key: (last?.key ?? 0) + 1 });
    this._states.length = Math.min(this._states.length, STATES_KEPT);
  }

  render() {
    const { state } = this._app;
    if (!state) return;
    const since = this._app.sinceState();
    each($('nodes'), state.nodes ?? [], (node) => node.name, () => make('tr', {},
      make('td', { class: 'l health' }), make('td', { class: 'l' }), make('td', { class: 'l w' }), make('td')),
    (row, node) => {
      const age = node.age + since;
      const [kind, word] = age > LATE_S ? ['stale', 'silent'] : LEVELS[node.level] ?? LEVELS.stale;
      set(row, 'data-health', kind);
      [word, node.name, node.message, seconds(age)].forEach((text, k) => write(row.children[k], text));
    });
    const ended = Object.entries(state.dead_man?.counts ?? {}).map(([reason, count]) => [`grips ended: ${reason}`, count]);
    facts($('counters'), [...Object.entries(state.counters ?? {}), ...ended]);
    each($('states'), this._states, (entry) => entry.key, (entry) =>
      make('li', {}, make('time', { class: 'number' }, entry.at.toLocaleTimeString()), ` ${entry.text}`), () => {});
    const { lease = {}, recorder = {} } = state;
    const operators = (lease.operators ?? []).map((o) => [
      o.name, `${o.label ?? ''}${o.name === this._app.you ? ' (this page)' : ''}${o.name === lease.holder ? ' has the controls' : ''}`.trim() || 'connected',
    ]);
    facts($('clients'), [
      ...operators,
      ['role here', this._app.role ?? '–'],
      ['session', state.session || 'none'],
      ['time', state.time || '–'],
      ['recorder', recorder.recording ? `${recorder.message}: ${recorder.bag}, ${recorder.messages} messages` : recorder.message],
      ['pictures', `${this._app.picturesLost} lost on the way of ${this._app.pictures}`],
    ]);
  }
}

function facts(list, pairs) {
  each(list, pairs.flatMap(([name, value]) => [{ key: `${name} t`, tag: 'dt', text: name }, { key: `${name} d`, tag: 'dd', text: String(value) }]),
    (item) => item.key, (item) => make(item.tag), (element, item) => write(element, item.tag === 'dt' ? item.text.replaceAll('_', ' ') : item.text));
}
