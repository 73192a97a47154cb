/** A minute of wanted and actual angles, their differences, the force at the tip and the tensions, on one time axis. */

import { DEG } from './history.js';

const SPAN_S = 60;
/** Which of the plots is the force's. */
const FORCE = 3;
const STEPS_DEG = [10, 20, 30, 45, 60, 90, 120, 180];
const STEPS_ERROR = [2, 5, 10, 20, 45, 90, 180];
const STEPS_N = [20, 40, 60, 80, 120, 200];
const STEPS_FORCE_N = [0.2, 0.5, 1, 2, 5, 10, 20];

/** The smallest of `steps` that holds all of `low` to `high`, so that a scale changes seldom. */
export function holding(steps, low, high) {
  const most = Math.max(Math.abs(low ?? 0), Math.abs(high ?? 0));
  return steps.find((step) => step >= most) ?? most;
}

/** Where an axis that is `room` px high has its ticks: at both ends, and between where there is room. */
export function ticks(low, high, room) {
  const parts = room >= 100 ? 4 : room >= 40 ? 2 : 1;
  return Array.from({ length: parts + 1 }, (_, k) => low + (k * (high - low)) / parts);
}

const around = (steps) => (_, low, high) => {
  const most = holding(steps, low, high);
  return [-most, most];
};
const upwards = (steps) => (_, low, high) => [0, holding(steps, 0, high)];

/** Indices of the plotted signals among those of hello. */
export function places(signals) {
  const at = (topic) => signals.flatMap(({ name }, k) => (name.startsWith(`${topic}:`) ? [k] : []));
  return {
    wanted: at('slave/servo_jp'), actual: at('slave/measured_js'), tensions: at('wires/measured_js'),
    // Along x and y of the tip, its bounds, and whether it is seen; the angles where it was.
    force: at('tip_force/bounds'), along: at('tip_force/angles'),
  };
}

/** Factors from SI to what a person reads: degrees and newtons. */
export const scalesOf = (signals) => signals.map(({ unit }) => (unit === 'rad' ? DEG : 1));

export class Plots {
  /**
   * @param boxes elements for bend_x, bend_y, error, force and tensions, each with a `.plot` and `[data-value]` in its head
   * @param signals as listed in hello
   */
  constructor(boxes, signals) {
    const style = getComputedStyle(document.documentElement);
    this._colour = (name) => style.getPropertyValue(`--${name}`).trim();
    this._places = places(signals);
    this._boxes = boxes;
    this._turn = 0;
    // In grey, or with colour blindness, they are distinguished by their dashes.
    const wires = [['wire-x-pos', []], ['wire-x-neg', [7, 4]], ['wire-y-pos', [2, 3]], ['wire-y-neg', [9, 3, 2, 3]]];
    // What is wanted lies on top: where both agree, its dashes still show.
    const pair = [['actual', [], true], ['wanted', [6, 4], true]];
    const both = [['curve-1', [], false], ['curve-5', [5, 3], false]];
    this._plots = [
      this._plot(boxes[0], pair, around(STEPS_DEG), 'deg', false),
      this._plot(boxes[1], pair, around(STEPS_DEG), 'deg', false),
      this._plot(boxes[2], both, around(STEPS_ERROR), 'deg', false),
      this._plot(boxes[3], both, around(STEPS_FORCE_N), 'N', false),
      this._plot(boxes[4], wires.map(([name, dash]) => [name, dash, true]), upwards(STEPS_N), 'N', true),
    ];
    this._values = boxes.map((box) => [...box.querySelectorAll('[data-value]')]);
    this._sizes = new ResizeObserver(() => this._fit());
    for (const box of boxes) this._sizes.observe(box.querySelector('.plot'));
  }

  destroy() {
    this._sizes.disconnect();
    for (const plot of this._plots) plot.destroy();
  }

  /**
   * Draw two of the five plots, in turn, as the history has them: in the 60 s that are shown, a tenth of a
   * second is less than a pixel.
   */
  draw(history) {
    const { wanted, actual, tensions, force } = this._places;
    const newest = history.time.at(-1);
    if (newest === undefined) return;
    const [time] = history.window([]);
    const x = time.map((t) => t - newest);
    const plot = (k, columns, values) => {
      this._plots[k].setData([x, ...columns]);
      this._write(k, values);
    };
    if (this._turn === 0) {
      [0, 1].forEach((j) => {
        const both = [wanted[j], actual[j]];
        plot(j, history.window(both.toReversed()).slice(1), both.map((s) => history.last(s)));
      });
    } else if (this._turn === 1) {
      const errors = [0, 1].map((j) => history.difference(wanted[j], actual[j]));
      plot(2, errors, errors.map((column) => column.at(-1)));
      const along = force.slice(0, 2);
      plot(3, history.window(along, [2]).slice(1), along.map((s) => history.last(s)));
    } else {
      plot(4, history.window(tensions).slice(1), tensions.map((s) => history.last(s)));
    }
    this._turn = (this._turn + 1) % 3;
  }

  _write(k, values) {
    this._values[k].forEach((element, i) => {
      const text = values[i] === null || values[i] === undefined ? '–' : values[i].toFixed(k === FORCE ? 2 : 1);
      if (element.textContent !== text) element.textContent = text;
    });
  }

  _fit() {
    this._plots.forEach((plot, k) => {
      const { clientWidth: width, clientHeight: height } = this._boxes[k].querySelector('.plot');
      if (width && height) plot.setSize({ width, height });
    });
  }

  /** One plot: `curves` of [colour, dash, whether it comes as min, max, last], their unit, and whether the time axis is labelled. */
  _plot(box, curves, range, unit, labelled) {
    const target = box.querySelector('.plot');
    const [line, quiet] = [this._colour('line'), this._colour('quiet')];
    const font = `11px ${this._colour('sans')}`;
    const series = [{}];
    const bands = [];
    for (const [name, dash, envelope] of curves) {
      const colour = this._colour(name);
      if (envelope) {
        const hidden = { stroke: 'transparent', width: 0, points: { show: false } };
        bands.push({ series: [series.length + 1, series.length], fill: `${colour}55` });
        series.push(hidden, { ...hidden });
      }
      // A line of one pixel costs a third of a wider one.
      series.push({ stroke: colour, width: dash.length ? 1.5 : 1, dash, points: { show: false } });
    }
    return new window.uPlot({
      width: Math.max(target.clientWidth, 100),
      height: Math.max(target.clientHeight, 60),
      padding: [6, 10, labelled ? 0 : 4, 0],
      pxAlign: 0,
      series,
      bands,
      cursor: { show: false },
      legend: { show: false },
      scales: { x: { time: false, range: [-SPAN_S, 0] }, y: { range } },
      axes: [
        {
          stroke: quiet, font, size: labelled ? 18 : 0, gap: 2, space: 80,
          ...(labelled ? { label: 'time', labelFont: font, labelSize: 13, labelGap: -2 } : {}),
          grid: { stroke: line, width: 1 }, ticks: { show: false },
          values: (_, splits) => splits.map((s) => (labelled ? (s === 0 ? 'now' : `${s} s`) : '')),
        },
        {
          stroke: quiet, font, size: 34, gap: 4, label: unit, labelFont: font, labelSize: 16, labelGap: 0,
          splits: ({ bbox }, _, low, high) => ticks(low, high, bbox.height / window.uPlot.pxRatio),
          grid: { stroke: line, width: 1 }, ticks: { show: false },
        },
      ],
    }, [[], ...series.slice(1).map(() => [])], target);
  }
}
