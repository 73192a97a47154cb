/** Explanations of recordings of this machine: asked for, followed, read, and their next experiment played. */

import { $, each, make, set, toggle, write } from './elements.js';
import { Investigations } from './investigations.js';

export class Explain {
  constructor(app) {
    this._app = app;
    this._report = null;
    this._investigations = new Investigations(app, (path) => this._open(path), (plant) => this._adopt(plant));
    $('undo').addEventListener('click', () => this._adopt(null));
    $('ask').addEventListener('submit', (event) => {
      event.preventDefault();
      this._ask();
    });
    $('ask-again').addEventListener('click', () => this._look());
    $('stop-and-explain').addEventListener('click', () => this._stopAndAsk());
  }

  /** The page comes into view. */
  shown() {
    this._look();
  }

  /** What is asked on any of the pages. */
  ask() {
    this._investigations.ask();
  }

  render() {
    const { state, mine, role } = this._app;
    this._investigations.render();
    const adopted = state?.adopted;
    write($('in-force').querySelector('p'), adopted ? adopted.words : 'no compensator says which');
    toggle($('undo'), 'disabled', !mine || !adopted?.undo);
    const mayAsk = role === 'operator';
    const { recording = false, bag = '' } = state?.recorder ?? {};
    const none = recording ? '' : 'There is no recording yet. Press Record on the page Operate, and move.';
    toggle($('ask-go'), 'disabled', !mayAsk || !$('bag').options.length);
    write($('ask-why'), mayAsk ? ($('bag').options.length ? '' : none) : 'This page looks on: an operator explains.');
    toggle($('being-recorded'), 'hidden', !recording);
    write($('being-recorded').querySelector('p'), `${nameOfBag(bag)} is being recorded.`);
    toggle($('stop-and-explain'), 'disabled', !mayAsk || !this._app.mayRecord());
    set($('stop-and-explain'), 'title', this._app.mayRecord() ? '' : 'Who operates ends the recording');
    const explanations = state?.explanations ?? [];
    each($('explanations'), explanations, (e) => e.id, (e) => this._card(e), (card, e) => {
      write(card.querySelector('b'), e.bag);
      write(card.querySelector('.note'), e.plant && `by ${e.plant}`);
      write(card.querySelector('.sentence'), e.error || e.sentence || e.step || '');
      const progress = card.querySelector('progress');
      toggle(progress, 'hidden', !e.running);
      progress.value = e.progress ?? 0;
      toggle(card.querySelector('.open'), 'hidden', !e.report);
      toggle(card.querySelector('.cancel'), 'hidden', !e.running);
      toggle(card.querySelector('.cancel'), 'disabled', !mayAsk);
      toggle(card.querySelector('.play'), 'hidden', !e.experiment);
      toggle(card.querySelector('.play'), 'disabled', !mine);
      card.querySelector('.open').dataset.report = e.report ?? '';
      toggle(card.querySelector('.adopt'), 'hidden', !e.improved);
      toggle(card.querySelector('.adopt'), 'disabled', !mine);
      card.querySelector('.adopt').dataset.plant = e.improved;
    });
    const newest = explanations.find((e) => e.report);
    // A report is large: it is fetched when it can be seen.
    if (this._report === null && newest && $('report').checkVisibility()) this._open(newest.report);
  }

  async _look() {
    const answer = await this._app.orders.give({ op: 'bags' });
    if (!answer.ok) {
      write($('ask-answer'), `No recordings: ${answer.why}`);
      return;
    }
    const bags = answer.bags ?? [];
    const options = (first) => [...first, ...bags.map((bag) => ({ value: bag.name, text: nameOf(bag) }))];
    const fill = (id, items) =>
      each($(id), items, (item) => item.value, (item) => make('option', { value: item.value }), (option, item) => write(option, item.text));
    fill('bag', options([]));
    fill('baseline', options([{ value: '', text: 'none' }]));
    fill('validate', options([{ value: '', text: 'the end of the recording itself' }]));
    fill('plants', (answer.plants ?? []).map((plant) => ({ value: plant, text: plant })));
    set($('plant'), 'placeholder', answer.own_plant ? `this graph's own: ${answer.own_plant}` : 'a plant.yaml');
    write($('ask-answer'), '');
    this.render();
  }

  /** End the recording that is under way, and have it explained. */
  async _stopAndAsk() {
    const name = nameOfBag(this._app.state?.recorder?.bag ?? '');
    const answer = await this._app.orders.give({ op: 'record', on: false });
    if (!answer.ok) {
      write($('ask-answer'), `Refused: ${answer.why}`);
      return;
    }
    await this._look();
    $('bag').value = name;
    await this._ask(name);
  }

  async _ask(bag = $('bag').value) {
    const value = (id) => $(id).value || null;
    const answer = await this._app.orders.give({
      op: 'explain', bag: bag || null, plant: value('plant'), baseline: value('baseline'), validate: value('validate'),
    });
    write($('ask-answer'), answer.ok ? 'Being explained; it may take some minutes.' : `Refused: ${answer.why}`);
  }

  _card(explanation) {
    const button = (name, text, act) => {
      const element = make('button', { class: name }, text);
      element.addEventListener('click', act);
      return element;
    };
    const { id } = explanation;
    return make('li', { class: 'explanation' },
      make('b'), make('span', { class: 'note' }), make('p', { class: 'sentence', role: 'status' }), make('progress', { max: '1', 'aria-label': 'How far it is' }),
      make('div', { class: 'row' },
        button('open', 'Open the report', ({ target }) => this._open(target.dataset.report)),
        button('play', 'Play the next experiment', () => this._play(id)),
        button('adopt', 'Adopt the plant', ({ target }) => this._adopt(target.dataset.plant)),
        button('cancel', 'Cancel', () => this._app.orders.give({ op: 'cancel', explanation: id }))));
  }

  async _play(id) {
    const answer = await this._app.orders.give({ op: 'play', explanation: id });
    write($('ask-answer'), answer.ok ? '' : `Refused: ${answer.why}`);
    // What moves has to be seen: the dead-man counts only there.
    if (answer.ok) this._app.show('operate');
  }

  /** Have the compensator invert a plant that was found, or the one before. */
  async _adopt(plant) {
    write($('adopt-answer'), plant ? 'The plant is being tried …' : '');
    const answer = await this._app.orders.give({ op: 'adopt', plant });
    const code = answer.code ? ` (${answer.code.replaceAll('_', ' ')})` : '';
    const done = plant ? '' : answer.why;
    write($('adopt-answer'), answer.ok ? done : `Refused${code}: ${answer.why}`);
  }

  _open(path) {
    this._report = path;
    $('report').replaceChildren(make('iframe', { src: path, sandbox: 'allow-scripts', title: 'Report of the explanation' }));
  }
}

const nameOfBag = (path) => path.split('/').at(-1);

function nameOf(bag) {
  const parts = [bag.name];
  if (Number.isFinite(bag.duration)) parts.push(`${bag.duration.toFixed(0)} s`);
  if (Number.isFinite(bag.size)) parts.push(`${(bag.size / 1e6).toFixed(0)} MB`);
  return parts.join(' · ');
}
