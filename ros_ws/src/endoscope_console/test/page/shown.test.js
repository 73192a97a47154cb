import assert from 'node:assert/strict';
import test from 'node:test';

import { pictureAge, standing } from '../page/alarms.js';
import { endedForHim, inWords, lamp, nextStep, stateIsFresh } from '../page/guidance.js';
import { History, Loop } from '../page/history.js';
import { nearestScale } from '../page/operate.js';
import { holding, places, scalesOf, ticks } from '../page/plots.js';
import { Backoff } from '../page/sockets.js';
import { Camera, frames, points, tensionColour } from '../page/view3d.js';

const WELL = { connected: true, everConnected: true, pictureAge: 0.02, gamepadLost: false };

test('alarms stand most urgent first', () => {
  const given = [{ id: 'a', level: 'low' }, { id: 'b', level: 'high' }, { id: 'c', level: 'medium' }];
  assert.deepEqual(standing(given, WELL).map((alarm) => alarm.id), ['b', 'c', 'a']);
});

test('the page itself knows that the picture is old, and shows it once', () => {
  assert.deepEqual(standing([], { ...WELL, pictureAge: 0.29 }), []);
  assert.deepEqual(standing([], { ...WELL, pictureAge: 0.31 }).map((a) => [a.id, a.level]), [['picture', 'medium']]);
  assert.equal(standing([{ id: 'picture', level: 'medium' }], { ...WELL, pictureAge: 0.31 }).length, 1);
});

test('without a connection only that is shown', () => {
  const given = [{ id: 'fault', level: 'high' }];
  assert.deepEqual(standing(given, { ...WELL, connected: false }).map((a) => a.id), ['connection']);
  assert.deepEqual(standing([], { ...WELL, connected: false, everConnected: false }), []);
});

test('a viewer does not see the grip of another, and of an ended graph nothing else is shown', () => {
  const given = [{ id: 'dead_man', level: 'medium' }];
  assert.deepEqual(standing(given, WELL), []);
  assert.deepEqual(standing(given, { ...WELL, mine: true }).map((a) => a.id), ['dead_man']);
  assert.deepEqual(standing([], { ...WELL, lost: 'c2 took the controls' }).map((a) => a.text), ['c2 took the controls']);
  // Two alarms fit beside the controls: a busy machine does not hide who took them.
  const busy = [{ id: 'machine', level: 'medium' }, { id: 'fault', level: 'high' }];
  assert.deepEqual(standing(busy, { ...WELL, lost: 'c2 took the controls' }).map((a) => a.id), ['fault', 'lease', 'machine']);
  assert.deepEqual(standing([{ id: 'graph', level: 'high' }], { ...WELL, pictureAge: 9 }).map((a) => a.id), ['graph']);
});

test('age of a picture counts from its newest sample', () => {
  assert.ok(Math.abs(pictureAge({ age: 0.1, arrived: 5 }, 5.25) - 0.35) < 1e-9);
  assert.equal(pictureAge(null, 5), Infinity);
  assert.equal(pictureAge({ age: NaN, arrived: 5 }, 5), Infinity);
});

const base = { connected: true, current: true, role: 'operator', mine: true, stateAge: 0.1, busy: false, half: false, held: false, touch: false };
const state = (more = {}) => ({ operating_state: 'ENABLED', lease: { holder: '' }, dead_man: { state: 'OPEN', reason: '' }, causes: [], ...more });

const CALIBRATED = { calibration: { result: { class_deg: 30 } } };

test('a stranger is led to the first motion step by step', () => {
  const steps = [
    [{ mine: false }, state({ operating_state: 'DISABLED' }), 1, 'Take the controls'],
    [{ mine: false }, state(), 1, 'nobody operates: take the controls, or press PAUSE'],
    [{ mine: false }, state({ lease: { holder: 'c7', operators: [{ name: 'c7', label: 'operator 7' }] } }), 1, 'operator 7'],
    [{}, state({ operating_state: 'DISABLED' }), 2, 'Hold Enable'],
    [{}, state({ operating_state: 'PAUSED' }), 2, 'Hold Resume'],
    [{}, state({ operating_state: 'DISABLED', investigates: true, prepares: true }), 0, 'being prepared'],
    [{}, state({ operating_state: 'DISABLED', investigates: true, prepares: false }), 2, 'Hold Enable'],
    [{}, state({ investigates: true }), 0, 'the recording begins'],
    [{}, state({ investigates: true, playing: {}, dead_man: { state: 'READY' }, console: { source: 'file' } }), 5, 'and the experiment plays'],
    [{ busy: true }, state(), 4, 'Let go'],
    [{}, state({ dead_man: { state: 'OPEN', reason: 'blind' } }), 4, 'picture too old'],
    [{}, state({ dead_man: { state: 'READY', reason: 'released' }, ...CALIBRATED }), 5, 'Hold Space and press an arrow'],
    [{}, state({ dead_man: { state: 'READY', reason: 'released' } }), 3, 'Hold Calibrate'],
    [{}, state({ dead_man: { state: 'READY' }, calibration: { result: { class_deg: null } } }), 3, 'Hold Calibrate'],
    [{}, state({ dead_man: { state: 'READY' }, calibration: { result: { class_deg: null, none: true } } }), 5, 'Explain or Investigate'],
    [{ home: true }, state({ dead_man: { state: 'READY' }, ...CALIBRATED }), 5, 'Or hold Home'],
    [{ touch: true }, state({ dead_man: { state: 'READY', reason: '' }, ...CALIBRATED }), 5, 'left area'],
    [{ half: true }, state({ dead_man: { state: 'READY', reason: '' } }), 5, 'together'],
    [{}, state({ dead_man: { state: 'ENGAGED' } }), 5, 'Following'],
    [{}, state({ dead_man: { state: 'READY' }, playing: { what: 'file' }, console: { source: 'file' } }), 5, 'the experiment plays'],
  ];
  for (const [more, given, step, words] of steps) {
    const next = nextStep({ ...base, ...more, state: given });
    assert.equal(next.step, step, next.text);
    assert.ok(next.text.includes(words), next.text);
  }
});

test('nothing is promised where nothing can move', () => {
  const cannot = [
    [{ connected: false }, state()], [{ current: false }, state()], [{ role: 'viewer' }, state()], [{ stateAge: 4 }, state()], [{}, null],
    [{}, state({ graph_ended: true })], [{ rests: true }, state({ operating_state: 'FAULT' })],
    [{}, state({ calibration: { running: true } })], [{}, state({ operating_state: 'FAULT', causes: ['no tracker'] })],
  ];
  for (const [more, given] of cannot) assert.equal(nextStep({ ...base, ...more, state: given }).step, 0);
  assert.equal(nextStep({ ...base, state: state({ operating_state: 'FAULT' }) }).step, 2);
});

test('the lamp follows only where the slave does', () => {
  assert.equal(lamp(null), 'OPEN');
  assert.equal(lamp(state()), 'OPEN');
  assert.equal(lamp(state({ dead_man: { state: 'ENGAGED', following: false } })), 'HELD');
  assert.equal(lamp(state({ dead_man: { state: 'ENGAGED', following: true } })), 'FOLLOWING');
});

test('a state that is not repeated does not count for longer than 3.5 s', () => {
  assert.equal(stateIsFresh(state(), 3.5), true);
  assert.equal(stateIsFresh(state(), 3.6), false);
  assert.equal(stateIsFresh(null, 0), false);
  assert.equal(stateIsFresh(state({ graph_ended: true }), 0), false);
});

test('reasons are words, and unknown ones come as they are', () => {
  assert.equal(inWords('silent'), 'no sign of the hand for 0.1 s');
  assert.equal(inWords('of its own'), 'of its own');
  assert.equal(inWords(null), '');
  assert.deepEqual(['released', '', 'silent'].map(endedForHim), [false, false, true]);
});

test('history joins pictures of one column and loses no peak', () => {
  const history = new History(1, { span: 60, columns: 600 });
  history.take(10.01, [1, 2, 1.5]);
  history.take(10.04, [-7, 9, 3]);
  history.take(10.11, [0, 1, 0.5]);
  assert.deepEqual(history.window([0]), [[10.04, 10.11], [-7, 0], [9, 1], [3, 0.5]]);
  assert.equal(history.last(0), 0.5);
});

test('history keeps a minute, forgets another run, and takes no picture twice', () => {
  const history = new History(2, { span: 1, columns: 10 });
  for (let k = 0; k < 1000; k++) history.take(100 + k / 30, [k, k, k, 0, 0, 0]);
  const [time, low] = history.window([0]);
  assert.equal(time.length, 11);
  assert.ok(time.at(-1) - time[0] <= 1.1);
  assert.equal(low.length, time.length);
  assert.ok(history.time.length <= 22);
  history.take(time.at(-1), [5, 5, 5, 0, 0, 0]);
  assert.equal(history.last(0), 999);
  history.take(3, [5, 5, 5, 0, 0, 0]);
  assert.deepEqual(history.time, [3]);
});

test('a slow signal leaves no holes, a silent one does', () => {
  const history = new History(1, { span: 60, columns: 6000, scales: [2], hold: 0.1 });
  history.take(1, [1, 1, 1]);
  history.take(1.05, [NaN, NaN, NaN]);
  assert.equal(history.last(0), 2);
  history.take(1.2, [NaN, NaN, NaN]);
  assert.equal(history.last(0), null);
  assert.deepEqual(history.window([0], [2])[1], [2, 2, null]);
});

test('differences are of what is known of both', () => {
  const history = new History(2, { hold: 0 });
  history.take(1, [3, 3, 3, 1, 1, 1]);
  history.take(2, [3, 3, 3, NaN, NaN, NaN]);
  assert.deepEqual(history.difference(0, 1), [2, null]);
});

test('a loop grows while the wanted angle moves, and shows its error', () => {
  const loop = new Loop(50);
  for (let k = 0; k < 200; k++) loop.take(k, k - 3);
  assert.equal(loop.wanted.length, 50);
  assert.equal(loop.take(199.01, 0), false);
  assert.equal(loop.take(null, 1), false);
  assert.ok(Math.abs(loop.rmse - 3) < 1e-9);
  assert.equal(new Loop().rmse, null);
});

test('scales of plots hold all values in steps', () => {
  assert.equal(holding([10, 20, 45], -12, 3), 20);
  assert.equal(holding([10, 20], 0, 70), 70);
  assert.equal(holding([10, 20], null, null), 10);
});

test('an axis has ticks at both ends, however low it is', () => {
  assert.deepEqual(ticks(-10, 10, 20), [-10, 10]);
  assert.deepEqual(ticks(-10, 10, 50), [-10, 0, 10]);
  assert.deepEqual(ticks(0, 20, 130), [0, 5, 10, 15, 20]);
});

test('signals are found by the names in hello', () => {
  const signals = ['slave/servo_jp:bend_x', 'slave/measured_js:bend_x', 'slave/servo_jp:bend_y', 'wires/measured_js:wire_x_pos']
    .map((name) => ({ name, unit: name.startsWith('wires') ? 'N' : 'rad' }));
  assert.deepEqual(places(signals), { wanted: [0, 2], actual: [1], tensions: [3], force: [], along: [] });
  assert.deepEqual(scalesOf(signals).map(Math.round), [57, 57, 57, 1]);
});

test('pauses between attempts double up to 5 s, a quarter to either side', () => {
  const low = new Backoff(() => 0);
  const high = new Backoff(() => 1);
  assert.deepEqual(Array.from({ length: 7 }, () => low.pause()), [0.25, 0.5, 1, 2, 4, 5, 5].map((s) => 0.75 * s));
  assert.deepEqual(Array.from({ length: 7 }, () => high.pause()), [0.25, 0.5, 1, 2, 4, 5, 5].map((s) => 1.25 * s));
  low.succeeded();
  assert.equal(low.pause(), 0.1875);
});

test('positive bending goes to the right and away, and farther is smaller', () => {
  const camera = new Camera(760, 640);
  const [x0, y0] = camera.project([0, 0, 0]);
  assert.ok(camera.project([0.01, 0, 0])[0] > x0);
  assert.ok(camera.project([0, 0.01, 0])[1] < y0);
  assert.ok(camera.project([0, 0, 0.01])[1] < y0);
  assert.ok(camera.project([0, 0.01, 0])[2] < camera.project([0, -0.01, 0])[2]);
});

test('the section fits into the picture wherever it bends', () => {
  for (const [width, height] of [[760, 640], [664, 440]]) {
    const camera = new Camera(width, height);
    for (let turn = 0; turn < 6.3; turn += 0.3) {
      for (const angle of [0.01, 0.8, 1.75]) {
        const side = (0.02 / angle) * (1 - Math.cos(angle));
        const [x, y] = camera.project([side * Math.cos(turn), side * Math.sin(turn), (0.02 / angle) * Math.sin(angle)]);
        assert.ok(x > 30 && x < width - 30 && y > 30 && y < height - 60, `${width}: ${x}, ${y}`);
      }
    }
  }
});

test('directions along an arc stay square, and keep their plane', () => {
  const arc = Array.from({ length: 40 }, (_, k) => {
    const a = (1.5 * k) / 39;
    return [0.013 * (1 - Math.cos(a)), 0, 0.013 * Math.sin(a)];
  });
  for (const { tangent, x, y } of frames(arc)) {
    const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
    for (const product of [dot(tangent, x), dot(tangent, y), dot(x, y)]) assert.ok(Math.abs(product) < 1e-9);
    assert.ok(Math.abs(y[1] - 1) < 1e-9, 'bending in x turns y nowhere');
  }
});

test('an unknown centre line is not drawn', () => {
  assert.deepEqual(points([0, 0, 0, NaN, 0, 0]), []);
  assert.deepEqual(points(new Float32Array([1, 2, 3])), [[1, 2, 3]]);
});

test('colours of tension run from one end of the scale to the other', () => {
  const scale = [[0, 0, 0], [100, 100, 100]];
  assert.equal(tensionColour(0, 60, scale), 'rgb(0 0 0)');
  assert.equal(tensionColour(600, 60, scale), 'rgb(100 100 100)');
  assert.equal(tensionColour(15, 60, scale), 'rgb(50 50 50)');
  assert.notEqual(tensionColour(NaN, 60, scale), tensionColour(0, 60, scale));
});

test('the slider stands at the nearest scale', () => {
  assert.equal(nearestScale(0.5), 3);
  assert.equal(nearestScale(0.01), 0);
  assert.equal(nearestScale(10), 8);
});
