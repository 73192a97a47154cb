/** The page as a whole: sockets, hands and what is shown of both. */

import { BLIND_S, SILENT_CONSOLE_S, pictureAge } from './alarms.js';
import { DeadMan } from './dead_man.js';
import { $, set, toggle, write } from './elements.js';
import { Explain } from './explain.js';
import { decodeTelemetry, encodeInput } from './frames.js';
import { Hands } from './hands.js';
import { History } from './history.js';
import { Loops } from './loops.js';
import { Operate } from './operate.js';
import { Plots, places, scalesOf } from './plots.js';
import { See } from './see.js';
import { Orders, Socket } from './sockets.js';
import { TipForce, rumble, showForce } from './tip_force.js';
import { View3d } from './view3d.js';

const LOST = 'The controls are lost.';
const TOKEN = 'endoscope token';
/** A state that was under way when the controls were taken does not show it yet. */
const CLAIM_SETTLES_MS = 500;
const WORDS_MS = 150;
const LOOPS_EVERY = 3;

/** The key out of the address, kept for this tab alone. */
function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get('token');
  if (given) {
    sessionStorage.setItem(TOKEN, given);
    history.replaceState(null, '', location.pathname + location.search);
  }
  return sessionStorage.getItem(TOKEN) ?? '';
}

const token = takeToken();
const telemetry = new Socket('/telemetry', token);
const command = new Socket('/command', token);
const now = () => performance.now() / 1000;

const app = {
  hands: new Hands(), deadMan: null, orders: new Orders(command),
  state: null, picture: null, signals: [], modes: [], limits: { tension_ceiling: 60, force: 1, force_alarm: 1 }, tipForce: new TipForce(), you: null, role: null,
  mine: false, claiming: false, connected: false, everConnected: false, endedHere: '', endedGrip: 0, pictures: 0, picturesLost: 0,
  touch: matchMedia('(pointer: coarse)').matches,
  whyClosed: '', whyLost: '', lostAt: -Infinity, claimedAt: 0, stateArrived: 0, tab: 'operate',
  sinceState: () => now() - app.stateArrived,
  stateAge: () => (app.state?.state_age ?? Infinity) + app.sinceState(),
  pictureAge: () => pictureAge(app.picture, now()),
  current: () => app.connected && app.state !== null && app.sinceState() < SILENT_CONSOLE_S,
  sees: () => app.connected && app.pictureAge() < BLIND_S,
  shown: () => app.tab === 'operate' && document.querySelector('dialog[open]') === null,
  mayHalt: () => app.connected && app.role === 'operator',
  mayRecord: () => app.mine || (app.connected && app.role === 'operator' && !app.state?.lease?.holder),
  show,
  claimed() {
    app.mine = true;
    app.claimedAt = performance.now();
    app.endedHere = '';
    app.deadMan.send();
    render();
  },
  lost(reason) {
    if (!app.mine) return;
    app.deadMan.letGo(reason || 'given back');
    app.mine = false;
    if (reason) {
      operate.say(reason);
      [app.whyLost, app.lostAt] = [reason, performance.now()];
    }
    render();
  },
};

const operate = new Operate(app);
const see = new See(app);
const explain = new Explain(app);
const view = new View3d($('space'), $('view-reset'));
const loops = new Loops([...document.querySelectorAll('#loops figure')], $('loops-force'));
let plots = null;
let past = null;
let at = null;
let fresh = false;
let drawn = 0;
let frames = 0;
let spotted = '';

app.deadMan = new DeadMan(app.hands, { pad: $('pad'), thumb: $('thumb') }, {
  mine: () => app.mine,
  speaks: () => app.mine || app.claiming,
  shown: app.shown,
  seen: () => drawn,
  send: (frame) => command.send(encodeInput(frame)),
  asked: (what) => operate.gamepadAsked(what),
  rumble: () => (app.mine && app.shown() && app.sees() && $('rumble').checked ? rumble(app.state?.tip, app.tipForce.now, app.limits.force_alarm) : 0),
  ended(reason) {
    app.endedHere = reason;
    app.endedGrip = app.hands.grips;
    operate.say(`Let go: ${reason}.`);
    render();
  },
});

function render() {
  operate.render();
  set(document.body, 'data-stale', String(!app.sees()));
  set(document.body, 'data-connected', String(app.connected));
  if (!app.sees()) readings([]);
  if (app.tab === 'see') see.render();
  if (app.tab === 'explain') explain.render();
  explain.ask();
}

function connection() {
  app.connected = telemetry.ready && command.ready;
  app.everConnected ||= app.connected;
  render();
}

command.addEventListener('hello', ({ detail }) => {
  app.you = detail.you;
  app.role = detail.role;
  app.modes = detail.modes ?? [];
  app.hands.countFrom(detail.grips ?? 0);
  connection();
});
command.addEventListener('closed', ({ detail }) => {
  app.whyClosed = detail;
  app.lost('The connection was lost, and the controls with it.');
  connection();
});
command.addEventListener('message', ({ detail }) => {
  if (detail.op !== 'lost') return;
  const why = `The controls are lost: ${detail.why || detail.by}.`;
  if (app.mine) return app.lost(why);
  // The state comes by another socket: it may have been quicker, and does not know who took them.
  if (app.whyLost !== LOST) return;
  app.whyLost = why;
  operate.say(why);
  render();
});
telemetry.addEventListener('hello', ({ detail }) => {
  app.signals = detail.signals;
  app.limits = detail.limits;
  $('highest-bar').max = app.limits.tension_ceiling;
  app.tipForce.clear();
  loops.clear();
  past = new History(detail.signals.length, { scales: scalesOf(detail.signals) });
  at = places(detail.signals);
  plots?.destroy();
  plots = new Plots([...document.querySelectorAll('#plots figure')], detail.signals);
  connection();
});
telemetry.addEventListener('closed', () => {
  app.state = null;
  connection();
});
telemetry.addEventListener('frame', ({ detail }) => {
  const picture = decodeTelemetry(detail);
  picture.arrived = now();
  app.pictures += 1;
  if (app.picture && picture.seq > app.picture.seq) app.picturesLost += picture.seq - app.picture.seq - 1;
  app.picture = picture;
  past.take(picture.stamp, picture.ranges);
  at.wanted.forEach((wanted, joint) => {
    loops.take(joint, app.state?.compensator?.mode, past.last(wanted), past.last(at.actual[joint]));
  });
  const force = at.force.map((s) => past.last(s));
  app.tipForce.take(picture.stamp, force, app.state?.tip);
  at.along.forEach((place, joint) => loops.takeForce(joint, past.last(place), force[joint]));
  fresh = true;
});
telemetry.addEventListener('message', ({ detail }) => {
  if (detail.op !== 'state') return;
  app.state = detail;
  app.stateArrived = now();
  see.take(detail);
  const settled = performance.now() - app.claimedAt > CLAIM_SETTLES_MS;
  if (app.mine && settled && detail.lease?.holder !== app.you) {
    app.lost(LOST);
  }
  // Once the server reports another grip, the end of the last one here is out of date. It may still
  // report that one: states that it sent before its end are under way.
  const { state, grips } = detail.dead_man;
  if (state === 'ENGAGED' && (detail.lease.holder !== app.you || grips > app.endedGrip)) app.endedHere = '';
  render();
});
for (const socket of [telemetry, command]) {
  socket.addEventListener('refused', ({ detail }) => {
    write($('token-why'), token ? `The server refused this page: ${detail || 'its key is not known'}. One that was started anew has another key: put the address here that endoscope console has printed.`
      : 'Put the address here that the command endoscope console has printed: it ends with #token= and a key.');
    if (!$('token').open) $('token').showModal();
  });
}
$('token').addEventListener('close', () => {
  const given = $('token-address').value.trim();
  if (URL.canParse(given) && /^https?:.*#token=/.test(given)) {
    // With another key alone the page is loaded anew by its own listener of the hash.
    location.assign(given);
    return;
  }
  telemetry.open();
  command.open();
});

function tensionsNow() {
  return at.tensions.map((s) => past.last(s) ?? NaN);
}

/** Draw what is new, in the browser's own rhythm: pictures that came in between are passed over. */
function draw() {
  requestAnimationFrame(draw);
  spot();
  if (!fresh || document.visibilityState !== 'visible') return;
  fresh = false;
  const { picture } = app;
  frames += 1;
  if (app.tab === 'operate') {
    const tensions = tensionsNow();
    const level = app.state?.alarms?.find(({ id }) => id === 'force')?.level;
    view.draw({ ...picture, tensions, ceiling: app.limits.tension_ceiling, push: { force: app.tipForce.arrow, alarm: app.limits.force_alarm, level } });
    drawn = picture.seq;
    readings(tensions);
  }
  if ($('plots').offsetParent !== null) {
    plots.draw(past);
    if (frames % LOOPS_EVERY === 0) loops.draw();
  }
}

/** Show on the pad where the hand asks to go. */
function spot() {
  const { x, y } = app.hands.motion;
  const at = [x, -y].map((value) => `${50 + 40 * Math.max(-1, Math.min(1, value))}%`).join(' ');
  if (at === spotted) return;
  spotted = at;
  const [left, top] = at.split(' ');
  $('pad').style.setProperty('--x', left);
  $('pad').style.setProperty('--y', top);
}

function readings(tensions) {
  const [wx, wy, x, y] = app.sees() ? [...at.wanted, ...at.actual].map((s) => past.last(s)) : [null];
  const off = [wx, wy, x, y].includes(null) ? null : Math.hypot(wx - x, wy - y);
  write($('off'), off === null ? '–' : `${off.toFixed(1)}°`);
  const highest = Math.max(...tensions);
  showForce(app.sees() ? app.state?.tip : null, app.tipForce.now, app.limits);
  write($('highest'), Number.isFinite(highest) ? `${highest.toFixed(1)} N` : '–');
  $('highest-bar').value = Number.isFinite(highest) ? highest : 0;
}

const TABS = ['operate', 'plots', 'see', 'explain'];

/** Bring one of the pages to the front; the grip is released, since the section is out of sight. */
function show(tab) {
  if (app.tab === tab) return;
  app.tab = tab;
  if (!app.shown()) app.deadMan.letGo('the section is out of sight');
  set(document.body, 'data-tab', tab);
  for (const name of TABS) {
    set($(`tab-${name}`), 'aria-selected', String(name === tab));
    $(`tab-${name}`).tabIndex = name === tab ? 0 : -1;
  }
  toggle($('operate'), 'hidden', tab !== 'operate' && tab !== 'plots');
  toggle($('see'), 'hidden', tab !== 'see');
  toggle($('explain'), 'hidden', tab !== 'explain');
  if (tab === 'explain') explain.shown();
  render();
}

for (const name of TABS) {
  $(`tab-${name}`).addEventListener('click', ({ detail, target }) => {
    show(name);
    // Arrows bend, unless somebody goes by keys from page to page.
    if (detail) target.blur();
  });
  $(`tab-${name}`).addEventListener('keydown', (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step || app.hands.held) return;
    const visible = TABS.filter((tab) => $(`tab-${tab}`).offsetParent !== null);
    const next = visible[(visible.indexOf(name) + step + visible.length) % visible.length];
    $(`tab-${next}`).focus();
    show(next);
  });
}

// The plots have a page of their own only where there is no room beside the view.
matchMedia('(min-width: 1280px), (max-width: 700px)').addEventListener('change', ({ matches }) => {
  if (matches && app.tab === 'plots') show('operate');
});

// A key that is put into the address of a page that is open.
window.addEventListener('hashchange', () => location.reload());
window.addEventListener('pagehide', () => {
  telemetry.close();
  command.close();
});
window.addEventListener('pageshow', ({ persisted }) => {
  if (!persisted) return;
  telemetry.open();
  command.open();
});

setInterval(render, WORDS_MS);

render();
requestAnimationFrame(draw);
telemetry.open();
command.open();
