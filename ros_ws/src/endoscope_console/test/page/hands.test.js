import assert from 'node:assert/strict';
import test from 'node:test';

import { SOURCE } from '../page/frames.js';
import { DEAD_ZONE, Hands, deflection, PIXELS_PER_RADIAN } from '../page/hands.js';

const LOOKS = { visible: true, focused: true, seen: 7 };
const frame = (hands) => hands.frame(1.5, LOOKS);
const pad = (pressed = [], axes = [0, 0]) => ({ axes, buttons: Array.from({ length: 17 }, (_, k) => pressed.includes(k)) });

test('Space holds, arrows bend, and a release ends it', () => {
  const hands = new Hands();
  hands.keyDown('Space', false);
  hands.keyDown('ArrowRight', false);
  hands.keyDown('KeyW', false);
  assert.deepEqual(frame(hands), {
    pressed: true, turbo: false, visible: true, focused: true, position: false, source: SOURCE.keyboard,
    seq: 1, grip: 1, seen: 7, t: 1.5, x: 1, y: 1,
  });
  hands.keyDown('ArrowLeft', false);
  assert.equal(frame(hands).x, 0);
  hands.keyUp('Space');
  const after = frame(hands);
  assert.equal(after.pressed, false);
  assert.equal(after.y, 1, 'an arrow that is still down is reported, so that the server waits for it');
  assert.equal(hands.busy, true);
  assert.equal(hands.reason, 'let go');
});

test('Shift makes it fast, and only while held', () => {
  const hands = new Hands();
  hands.keyDown('ShiftLeft', false);
  assert.equal(frame(hands).turbo, false);
  hands.keyDown('Space', false);
  assert.equal(frame(hands).turbo, true);
  hands.keyUp('ShiftLeft');
  assert.equal(frame(hands).turbo, false);
  assert.equal(hands.held, true);
});

test('repeats of a key are no presses', () => {
  const hands = new Hands();
  assert.equal(hands.keyDown('Space', true), false);
  assert.equal(hands.held, false);
  hands.keyDown('Space', false);
  hands.letGo('this page is not in front');
  hands.keyDown('Space', true);
  assert.equal(hands.held, false, 'a key that was held all along does not engage again');
  hands.keyUp('Space');
  hands.keyDown('Space', false);
  assert.equal(hands.held, true);
});

test('grips are numbered above those of the server', () => {
  const hands = new Hands();
  hands.countFrom(41);
  hands.keyDown('Space', false);
  assert.equal(frame(hands).grip, 42);
  hands.keyUp('Space');
  hands.countFrom(3);
  hands.keyDown('Space', false);
  assert.equal(frame(hands).grip, 43);
});

test('a mouse holds by the pad alone, and drags an angle from where it went down', () => {
  const hands = new Hands();
  hands.pointerDown('pad', 1, 'mouse', 100, 100);
  hands.pointerMove('pad', 1, 100 + PIXELS_PER_RADIAN, 100 - PIXELS_PER_RADIAN / 2);
  const { pressed, position, source, x, y } = frame(hands);
  assert.deepEqual({ pressed, position, source, x, y }, { pressed: true, position: true, source: SOURCE.pad, x: 1, y: 0.5 });
  hands.pointerMove('pad', 2, 0, 0);
  assert.equal(frame(hands).x, 1, 'another pointer moves nothing');
  hands.pointerUp('pad', 1);
  assert.equal(frame(hands).pressed, false);
});

test('fingers hold only by both areas together, and the drag begins when both are down', () => {
  const hands = new Hands();
  hands.pointerDown('pad', 1, 'touch', 0, 0);
  hands.pointerMove('pad', 1, 50, 0);
  assert.equal(hands.held, false);
  assert.equal(hands.half, true);
  hands.pointerDown('thumb', 2, 'touch', 0, 0);
  assert.equal(hands.held, true);
  assert.equal(frame(hands).x, 0);
  hands.pointerMove('pad', 1, 100, 0);
  assert.equal(frame(hands).x, 50 / PIXELS_PER_RADIAN);
  hands.pointerUp('thumb', 2);
  assert.equal(hands.held, false);
  hands.pointerMove('pad', 1, 120, 0);
  assert.equal(hands.held, false);
});

test('a pad that asks for a speed is clipped to all of it', () => {
  const hands = new Hands();
  assert.equal(hands.toggleMode('pad'), true);
  hands.pointerDown('pad', 1, 'mouse', 0, 0);
  hands.pointerMove('pad', 1, 1000, 0);
  const { position, x } = frame(hands);
  assert.deepEqual({ position, x }, { position: false, x: 1 });
  assert.equal(hands.toggleMode('pad'), false, 'nothing changes its meaning while it is held');
});

test('the stick has a dead zone, and up is up', () => {
  assert.equal(deflection(DEAD_ZONE), 0);
  assert.equal(deflection(-1), -1);
  assert.ok(Math.abs(deflection(0.55) - 0.5) < 1e-12);
  for (const bad of [NaN, undefined, Infinity]) assert.equal(deflection(bad), 0);
  const hands = new Hands();
  hands.gamepad(pad());
  hands.gamepad(pad([5], [0, -1]));
  const { pressed, turbo, source, y } = frame(hands);
  assert.deepEqual({ pressed, turbo, source, y }, { pressed: true, turbo: false, source: SOURCE.gamepad, y: 1 });
  hands.gamepad(pad([4], [0, 0]));
  assert.equal(frame(hands).turbo, true);
});

test('a gamepad whose button is down when it comes holds nothing', () => {
  const hands = new Hands();
  hands.gamepad(pad([5]));
  assert.equal(hands.held, false);
  hands.gamepad(pad([]));
  hands.gamepad(pad([5]));
  assert.equal(hands.held, true);
});

test('a gamepad that goes lets go, and the frame says so by naming another device', () => {
  const hands = new Hands();
  hands.gamepad(pad());
  hands.gamepad(pad([5]));
  hands.gamepad(null);
  const { pressed, source } = frame(hands);
  assert.deepEqual({ pressed, source }, { pressed: false, source: SOURCE.keyboard });
  assert.equal(hands.reason, 'the gamepad was unplugged');
  hands.gamepad(pad([5]));
  assert.equal(hands.held, false, 'it comes back with its button down');
});

test('a button that was held through a release of another kind does not engage again', () => {
  const hands = new Hands();
  hands.gamepad(pad());
  hands.gamepad(pad([5]));
  hands.letGo('this page was hidden');
  hands.gamepad(pad([5]));
  assert.equal(hands.held, false);
  hands.gamepad(pad());
  hands.gamepad(pad([5]));
  assert.equal(hands.held, true);
});

test('what is pressed while another device holds never takes its grip over', () => {
  const hands = new Hands();
  hands.gamepad(pad());
  hands.keyDown('Space', false);
  hands.gamepad(pad([5]));
  hands.pointerDown('pad', 1, 'mouse', 0, 0);
  assert.equal(frame(hands).source, SOURCE.keyboard);
  hands.keyUp('Space');
  hands.gamepad(pad([5]));
  assert.equal(hands.held, false);
  assert.equal(hands.busy, true);
});

test("a gamepad's other buttons act when they go down, Start for as long as it is", () => {
  const hands = new Hands();
  assert.deepEqual(hands.gamepad(pad([8])), [], 'what is down at first was not pressed');
  hands.gamepad(pad());
  assert.deepEqual(hands.gamepad(pad([8, 3, 12, 9])), ['pause', 'mode', 'faster', 'enable', 'enable down']);
  assert.deepEqual(hands.gamepad(pad([8, 9])), ['enable down']);
  assert.deepEqual(hands.gamepad(pad([1, 13])), ['pause', 'slower']);
});

test('whatever happens, a grip begins by a press of its own device and by nothing else', () => {
  let seed = 1;
  const random = (n) => {
    seed = (seed * 1103515245 + 12345) % 2147483648;
    return Math.floor((seed / 2147483648) * n);
  };
  for (let run = 0; run < 300; run++) {
    const hands = new Hands();
    let grip = 0;
    let stick = [];
    for (let step = 0; step < 80; step++) {
      const before = hands.held;
      let press = false;
      const kind = random(9);
      const area = ['pad', 'thumb'][random(2)];
      if (kind === 0) {
        const repeat = random(2) === 1;
        press = !repeat;
        hands.keyDown('Space', repeat);
      } else if (kind === 1) hands.keyUp('Space');
      else if (kind === 2) hands.keyDown(['ArrowUp', 'KeyA', 'ShiftLeft', 'KeyQ'][random(4)], false);
      else if (kind === 3) {
        press = true;
        hands.pointerDown(area, random(2), ['mouse', 'touch'][random(2)], random(99), random(99));
      } else if (kind === 4) hands.pointerUp(area, random(2));
      else if (kind === 5) hands.pointerMove(area, random(2), random(99), random(99));
      else if (kind === 6) {
        const next = random(2) ? [5] : [];
        press = next.length > stick.length;
        stick = next;
        hands.gamepad(pad(next, [random(3) - 1, 0]));
      } else if (kind === 7) hands.letGo('blur');
      else {
        hands.gamepad(null);
        stick = [5];
      }
      if (hands.held && !before) assert.ok(press, `run ${run}, step ${step}: held by an event that presses nothing`);
      if (kind === 7) assert.equal(hands.held, false);
      const sent = frame(hands);
      assert.ok(Number.isFinite(sent.x) && Number.isFinite(sent.y));
      if (hands.held && !before) assert.ok(sent.grip > grip);
      if (hands.held) grip = sent.grip;
    }
  }
});
