import assert from 'node:assert/strict';
import test from 'node:test';

import { TipForce, inWords, rumble } from '../page/tip_force.js';
import { pushed } from '../page/view3d.js';

const TIP = { why: '', visible: 0.08 };
const SILENT = { why: 'silent', visible: null };
const NONE = new Array(7).fill(null);
const touched = (x, y) => [x, y, x - 0.07, y - 0.05, x + 0.09, y + 0.05, 1];
const free = (x, y) => [x, y, x - 0.07, y - 0.05, x + 0.09, y + 0.05, 0];
const near = (actual, expected) => actual.forEach((value, k) => assert.ok(Math.abs(value - expected[k]) < 1e-9, `${actual}`));

test('a force is shown with its bounds, what would be seen, or why it is not known', () => {
  const now = { size: 0.31, least: 0.22, most: 0.4, seen: true };
  assert.deepEqual(inWords(TIP, now), { size: '0.31 N', between: '(0.22 to 0.40)', why: '' });
  assert.deepEqual(inWords(TIP, { ...now, seen: false }), { size: '', between: 'nothing above 0.08 N', why: '' });
  assert.equal(inWords({ why: 'calibrate with the sinusoid' }, null).why, 'no force: calibrate with the sinusoid');
  for (const [tip, given] of [[null, now], [TIP, null], [SILENT, now]]) assert.equal(inWords(tip, given).why, 'no force: silent');
});

test('bounds of both directions are those of the size', () => {
  const force = new TipForce();
  force.take(1, touched(-0.3, 0.04), TIP);
  near([force.now.size, force.now.least, force.now.most], [Math.hypot(0.3, 0.04), 0.21, Math.hypot(0.37, 0.09)]);
  // Of a joint that the plant does not have, nothing is known.
  force.take(2, [0.2, null, 0.1, null, 0.3, null, 1], TIP);
  near([force.now.size, force.now.least, force.now.most], [0.2, 0.1, 0.3]);
});

test('below what can be seen nothing is drawn, and nothing flickers at its edge', () => {
  const force = new TipForce();
  force.take(1, free(0.05, 0.05), TIP);
  assert.equal(force.arrow, null);
  assert.ok(force.now.size > 0);
  force.take(1.1, touched(0.1, 0), TIP);
  near(force.arrow, [0.1, 0]);
  force.take(1.2, free(0.1, 0), TIP);
  assert.notEqual(force.arrow, null);
  force.take(1.5, free(0.1, 0), TIP);
  assert.equal(force.arrow, null);
});

test('an arrow follows within some tenths of a second, and ends where the force is not known', () => {
  const force = new TipForce();
  force.take(1, touched(0.4, 0), TIP);
  for (let k = 1; k <= 3; k++) force.take(1 + k / 10, touched(0, 0), TIP);
  near(force.arrow, [0.4 * Math.exp(-3), 0]);
  force.take(1.4, touched(0.4, 0), TIP);
  force.take(1.9, NONE, TIP);
  assert.equal(force.now.size, 0.4, 'a picture without a force is none that is silent');
  assert.ok(force.arrow[0] > 0.39);
  force.take(2, NONE, SILENT);
  assert.deepEqual([force.arrow, force.now], [null, null]);
  force.take(2.1, NONE, TIP);
  assert.equal(force.now, null);
  force.take(2.2, touched(0.4, 0), TIP);
  force.take(0.1, free(0, 0), TIP);
  assert.equal(force.arrow, null, 'another run');
});

test('a gamepad rumbles from what would be seen up to the alarm', () => {
  const strength = (size, seen = true, tip = TIP) => rumble(tip, { size, seen }, 0.2);
  near([strength(0.08), strength(0.14), strength(0.9)], [0, 0.5, 1]);
  for (const none of [strength(0.9, false), strength(0.9, true, SILENT), strength(0.9, true, null), rumble(TIP, null, 0.2)]) assert.equal(none, 0);
});

test('an arrow pushes the tip from outside, across its axis, in its own frame', () => {
  const straight = Array.from({ length: 40 }, (_, k) => [0, 0, 0.0005 * k]);
  const { from, to, size } = pushed(straight, { force: [-0.2, 0], alarm: 0.2, level: 'high' });
  assert.equal(size, 0.2);
  near(to, [0.0014, 0, 0.0195]);
  near(from, [0.0084, 0, 0.0195]);
  near(pushed(straight, { force: [0, 9], alarm: 0.2 }).from, [0, -0.0154, 0.0195]);
  // Bent by a right angle towards +x, the tip's x points down.
  const bent = Array.from({ length: 400 }, (_, k) => [0.01 * (1 - Math.cos((k * Math.PI) / 798)), 0, 0.01 * Math.sin((k * Math.PI) / 798)]);
  const push = pushed(bent, { force: [0.2, 0], alarm: 0.2 });
  assert.ok(push.from[2] > push.to[2] && push.to[2] > bent.at(-1)[2]);
});
