/**
 * Binary frames of the two sockets, little-endian.
 *
 * Input, 32 bytes: kind u8 = 2, flags u8, source u16, seq u32, grip u32, seen u32, t f64 s, x f32, y f32.
 * Telemetry: kind u8 = 1, version u8 = 1, count u16, seq u32, stamp f64 s, age f64 s, then count times
 * (min, max, last) f32, then the wanted and the actual centre line, 40 x 3 f32 in m each.
 */

export const FLAG = { pressed: 1, turbo: 2, visible: 4, focused: 8, position: 16 };
export const SOURCE = { keyboard: 0, pad: 1, gamepad: 2 };
export const POINTS = 40;

const INPUT_BYTES = 32;
const HEAD_BYTES = 24;

/** Encode what the hands do; `frame` has the fields of the layout, its flags as booleans. */
export function encodeInput(frame) {
  const view = new DataView(new ArrayBuffer(INPUT_BYTES));
  let flags = 0;
  for (const [name, bit] of Object.entries(FLAG)) {
    if (frame[name]) flags |= bit;
  }
  view.setUint8(0, 2);
  view.setUint8(1, flags);
  view.setUint16(2, frame.source, true);
  view.setUint32(4, frame.seq, true);
  view.setUint32(8, frame.grip, true);
  view.setUint32(12, frame.seen, true);
  view.setFloat64(16, frame.t, true);
  view.setFloat32(24, frame.x, true);
  view.setFloat32(28, frame.y, true);
  return view.buffer;
}

/** Decode one picture; throws RangeError where the bytes are not one. NaN stands where nothing is known. */
export function decodeTelemetry(buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength < HEAD_BYTES || view.getUint8(0) !== 1 || view.getUint8(1) !== 1) {
    throw new RangeError('not a telemetry frame of version 1');
  }
  const count = view.getUint16(2, true);
  const expected = HEAD_BYTES + 12 * count + 24 * POINTS;
  if (buffer.byteLength !== expected) {
    throw new RangeError(`a telemetry frame of ${buffer.byteLength} bytes, not ${expected}`);
  }
  let at = HEAD_BYTES;
  const floats = (n) => {
    const values = new Float32Array(n);
    for (let k = 0; k < n; k++, at += 4) values[k] = view.getFloat32(at, true);
    return values;
  };
  return {
    seq: view.getUint32(4, true),
    stamp: view.getFloat64(8, true),
    age: view.getFloat64(16, true),
    ranges: floats(3 * count),
    wanted: floats(3 * POINTS),
    actual: floats(3 * POINTS),
  };
}
