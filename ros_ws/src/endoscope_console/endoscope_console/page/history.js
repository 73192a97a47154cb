/** What the plots and loops show: the last minute of every signal, and paths of actual against wanted. */

export const DEG = 180 / Math.PI;
const FIELDS = 3;

const known = (value) => (Number.isFinite(value) ? value : null);

/** How two values of one field join: the smaller, the larger, the later. */
const JOIN = [Math.min, Math.max, (_, later) => later];

const joined = (field, earlier, later) => {
  if (later === null) return earlier;
  return earlier === null ? later : JOIN[field](earlier, later);
};

/**
 * The last `span` s of pictures in columns as uPlot takes them: time, then min, max and last of each signal;
 * null where nothing came. As many columns as a plot is wide: pictures that fall into one are joined, so that
 * no peak is lost and nothing is drawn twice. A signal that is sampled more seldom than pictures come leaves
 * no holes: its last value stands for `hold` s.
 */
export class History {
  constructor(count, { span = 60, columns = 600, scales = null, hold = 0.12 } = {}) {
    this.count = count;
    this._width = span / columns;
    this._size = columns + 1;
    this._scales = scales ?? new Array(count).fill(1);
    this._hold = hold;
    this.clear();
  }

  clear() {
    this.time = [];
    this.columns = Array.from({ length: FIELDS * this.count }, () => []);
    this._last = new Array(this.count).fill(null);
    this._heard = new Array(this.count).fill(-Infinity);
  }

  /** Take one picture: `ranges` holds min, max and last of each signal. */
  take(stamp, ranges) {
    if (!Number.isFinite(stamp)) return;
    const newest = this.time.at(-1);
    // Time that goes back is another run of the graph.
    if (newest !== undefined && stamp < newest - 1) this.clear();
    else if (newest !== undefined && stamp <= newest) return;
    const column = (t) => Math.floor(t / this._width);
    const same = this.time.length > 0 && column(this.time.at(-1)) === column(stamp);
    if (same) this.time.pop();
    this.time.push(stamp);
    for (let s = 0; s < this.count; s++) {
      const last = known(ranges[FIELDS * s + 2] * this._scales[s]);
      if (last !== null) {
        this._last[s] = last;
        this._heard[s] = stamp;
      }
      const stands = stamp - this._heard[s] <= this._hold ? this._last[s] : null;
      for (let f = 0; f < FIELDS; f++) {
        const values = this.columns[FIELDS * s + f];
        const value = known(ranges[FIELDS * s + f] * this._scales[s]) ?? stands;
        values.push(same ? joined(f, values.pop(), value) : value);
      }
    }
    // Seldom and many at once: each removal from the front moves everything behind it.
    if (this.time.length >= 2 * this._size) {
      for (const values of [this.time, ...this.columns]) values.splice(0, values.length - this._size);
    }
  }

  /** Columns of the last `span` s, time first: of each signal asked for, min, max and last. */
  window(signals, fields = [0, 1, 2]) {
    const from = Math.max(0, this.time.length - this._size);
    const columns = signals.flatMap((s) => fields.map((f) => this.columns[FIELDS * s + f].slice(from)));
    return [this.time.slice(from), ...columns];
  }

  /** Difference of the last values of two signals. */
  difference(a, b) {
    const from = Math.max(0, this.time.length - this._size);
    const [first, second] = [this.columns[FIELDS * a + 2], this.columns[FIELDS * b + 2]];
    const out = [];
    for (let k = from; k < first.length; k++) {
      out.push(first[k] === null || second[k] === null ? null : first[k] - second[k]);
    }
    return out;
  }

  /** Newest value of a signal, or null once it has been silent for `hold` s. */
  last(signal) {
    return this.time.at(-1) - this._heard[signal] <= this._hold ? this._last[signal] : null;
  }
}

/** A path of actual against wanted angle, both in deg; grows only while the wanted one moves, or the
 * other by `least`. */
export class Loop {
  constructor(size = 900, least = Infinity) {
    this._size = size;
    this._least = least;
    this.wanted = [];
    this.actual = [];
  }

  take(wanted, actual) {
    if (wanted === null || actual === null) return false;
    const moved = !this.wanted.length || Math.abs(wanted - this.wanted.at(-1)) >= 0.05;
    if (!moved && Math.abs(actual - this.actual.at(-1)) < this._least) return false;
    this.wanted.push(wanted);
    this.actual.push(actual);
    if (this.wanted.length > this._size) {
      this.wanted.shift();
      this.actual.shift();
    }
    return true;
  }

  /** Root mean square of wanted less actual, in deg; null for less than a second of motion. */
  get rmse() {
    const n = this.wanted.length;
    if (n < 30) return null;
    let sum = 0;
    for (let k = 0; k < n; k++) sum += (this.wanted[k] - this.actual[k]) ** 2;
    return Math.sqrt(sum / n);
  }
}
