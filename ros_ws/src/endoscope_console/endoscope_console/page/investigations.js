/** Investigations of the rig: begun, followed sentence by sentence, and each motion consented to. */

import { $, each, make, toggle, write } from './elements.js';

export class Investigations {
  /** @param app state of the page, see main.js; `open` shows a report, `adopt` puts a plant into force */
  constructor(app, open, adopt) {
    this._app = app;
    this._open = open;
    this._adopt = adopt;
    this._followed = new Set();
    this._asked = '';
    $('investigating').addEventListener('submit', (event) => {
      event.preventDefault();
      this._begin({ plant: $('plant').value || null });
    });
    $('consent').addEventListener('close', () => this._answer($('consent').returnValue === 'go'));
  }

  render() {
    const { state, mine, role } = this._app;
    const all = state?.investigations ?? [];
    const busy = all.some((one) => one.running);
    toggle($('investigate'), 'disabled', !mine || busy);
    const held = role === 'operator' ? 'It moves the rig: take the controls on the page Operate first.' : 'This page looks on: an operator investigates.';
    write($('investigate-why'), busy ? 'One investigation at a time: this one first.' : mine ? '' : held);
    each($('investigations'), all, (one) => one.id, (one) => this._card(one), (card, one) => this._fill(card, one, busy));
    for (const one of all) {
      if (one.running) this._followed.add(one.id);
      else if (this._followed.delete(one.id) && one.report) this._open(one.report);
    }
  }

  /** Ask for consent, wherever the operator is on the page; not under a hand that holds. */
  ask() {
    const { state, mine, hands, deadMan } = this._app;
    const question = (state?.investigations ?? []).map((one) => one.question).find(Boolean);
    const dialog = $('consent');
    if (dialog.open && (!mine || question?.id !== this._asked)) {
      // It was answered elsewhere, or the controls are another's.
      this._asked = '';
      dialog.close();
    }
    if (!question || !mine || hands.held || this._asked === question.id || document.querySelector('dialog[open]')) return;
    this._asked = question.id;
    deadMan.letGo('a motion is asked for');
    write($('consent-words'), question.words);
    write($('consent-why'), `Why: ${question.why}`);
    dialog.returnValue = '';
    dialog.showModal();
  }

  async _answer(go) {
    const question = this._asked;
    if (!question) return;
    const answer = await this._app.orders.give({ op: 'consent', question, go });
    if (!answer.ok) {
      write($('investigate-answer'), `Refused: ${answer.why}`);
      this._asked = '';
    } else if (go) {
      // What moves has to be seen, and is enabled there.
      this._app.show('operate');
    }
  }

  async _begin(order) {
    const experiments = Number($('experiments').value);
    const answer = await this._app.orders.give({ op: 'investigate', experiments, ...order });
    write($('investigate-answer'), answer.ok ? 'It is looked up what is safe; then the first motion is asked for.' : `Refused: ${answer.why}`);
  }

  _card({ id }) {
    const button = (name, text, act) => {
      const element = make('button', { class: name }, text);
      element.addEventListener('click', act);
      return element;
    };
    const give = async (order) => {
      const answer = await this._app.orders.give(order);
      write($('investigate-answer'), answer.ok ? '' : `Refused: ${answer.why}`);
    };
    return make('li', { class: 'explanation' },
      make('b'), make('ol', { class: 'sentences', role: 'log' }), make('p', { class: 'sentence', role: 'status' }),
      make('div', { class: 'row' },
        button('open', 'Open the page', ({ target }) => this._open(target.dataset.report)),
        button('adopt', 'Adopt the plant', ({ target }) => this._adopt(target.dataset.plant)),
        button('go-on', 'Continue', () => this._begin({ investigation: id })),
        button('stop', 'Stop', () => give({ op: 'stop', investigation: id }))));
  }

  _fill(card, one, busy) {
    const { role, mine } = this._app;
    write(card.querySelector('b'), one.name);
    const log = card.querySelector('.sentences');
    const last = log.children.length;
    toggle(log, 'hidden', !one.sentences.length);
    each(log, one.sentences.map((text, k) => ({ k, text })), (item) => item.k, () => make('li'), (item, { text }) => write(item, text));
    if (log.children.length !== last) log.scrollTop = log.scrollHeight;
    const asks = one.question ? `Asks: ${one.question.words}` : one.plays ? 'A motion is played: enable, and hold on.' : one.step;
    write(card.querySelector('.sentence'), one.error || (one.running ? asks : one.sentence) || '');
    const shown = (name, on) => toggle(card.querySelector(name), 'hidden', !on);
    shown('.open', Boolean(one.report));
    shown('.adopt', Boolean(one.improved) && !one.running);
    shown('.go-on', one.goes_on && !one.running);
    shown('.stop', one.running);
    toggle(card.querySelector('.adopt'), 'disabled', !mine);
    toggle(card.querySelector('.go-on'), 'disabled', !mine || busy);
    toggle(card.querySelector('.stop'), 'disabled', role !== 'operator');
    card.querySelector('.open').dataset.report = one.report ?? '';
    card.querySelector('.adopt').dataset.plant = one.improved;
  }
}
