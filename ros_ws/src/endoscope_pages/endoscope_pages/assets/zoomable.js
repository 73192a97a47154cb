/* Plots of a self-contained page: drag zooms, Shift and drag moves, a double click shows all again.

   What is drawn stands in the page as JSON (zoomable.py writes it). uPlot does axes, selection and cursor; in its
   mode 2, in which every curve has positions of its own, drawing (drawing.js) and reading out are left to the page. */
'use strict';
{
  const {colour, drawCurve, drawBehind} = drawing;
  const figures = [];
  const clamp = (value, least, greatest) => Math.min(Math.max(value, least), greatest);

  /* Index of the element of a sorted array that is nearest to a value. */
  function nearest(sorted, value) {
    let low = 0, high = sorted.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (sorted[middle] < value) low = middle; else high = middle;
    }
    return value - sorted[low] <= sorted[high] - value ? low : high;
  }

  /* A value with the digits that its axis resolves at this zoom. */
  function shown(value, {min, max, distr}) {
    if (value == null) return '–';
    if (distr === 3) return String(Number(value.toPrecision(3)));
    return value.toFixed(clamp(3 - Math.floor(Math.log10(max - min)), 0, 9));
  }

  const unitOf = (label) => label.match(/\(([^)]*)\)$/)?.[1] ?? '';

  function prepared(spec, target) {
    const curves = spec.curves.map((c) => {
      const edges = spec.x[c.x];
      const low = c.low ?? c.y, high = c.high ?? c.y, y = c.y ?? c.low.map((v, k) => v == null ? null : (v + c.high[k]) / 2);
      const stepped = edges.length > y.length;
      const x = stepped ? y.map((_, k) => (edges[k] + edges[k + 1]) / 2) : edges;
      return {...c, edges, x, y, low, high, stepped, time: c.t == null ? x : spec.x[c.t], on: true};
    });
    return {spec, curves, target, element: target.closest('.plot'), x: spec.range_x, y: spec.range_y};
  }

  /* Zooming: plots of a figure with the same quantity across show the same range of it. */

  const alike = (plot) => plot.figure.plots.filter((p) => p.spec.x_label === plot.spec.x_label);
  const isWhole = (plot) => plot.x[0] <= plot.spec.range_x[0] && plot.x[1] >= plot.spec.range_x[1];

  function zoom(plot, first, last, y = null) {
    const [begin, end] = plot.spec.range_x, whole = end - begin;
    const span = clamp(last - first, 1e-4 * whole, whole);
    first = span === whole ? begin : clamp((first + last - span) / 2, begin, end - span);
    last = span === whole ? end : first + span;
    for (const one of alike(plot)) {
      one.x = [first, last];
      one.y = (one === plot && y) || (isWhole(one) ? one.spec.range_y : rangeOfVisible(one));
      one.element.dataset.across = one.x.join(' ');
      apply(one);
    }
    const {figure} = plot;
    figure.zoomed = figure.plots.some((p) => !isWhole(p) || p.y !== p.spec.range_y);
    if (!plot.spec.loop) {
      figure.window = isWhole(plot) ? null : plot.x;
      for (const one of figure.plots) if (one.spec.loop) one.u.redraw();
    }
    for (const button of figure.buttons) {
      if (['all', 'left', 'right'].includes(button.dataset.do)) button.disabled = !figure.zoomed;
    }
  }

  function apply({u, x, y}) {
    u.batch(() => {
      u.setScale('x', {min: x[0], max: x[1]});
      u.setScale('y', {min: y[0], max: y[1]});
    });
  }

  function rangeOfVisible(plot) {
    let least = Infinity, greatest = -Infinity;
    for (const c of plot.curves) {
      if (!c.on) continue;
      for (let k = 0; k < c.x.length; k++) {
        if (c.low[k] == null || c.x[k] < plot.x[0] || c.x[k] > plot.x[1]) continue;
        least = Math.min(least, c.low[k]);
        greatest = Math.max(greatest, c.high[k]);
      }
    }
    if (least > greatest) return plot.spec.range_y;
    if (plot.spec.log) return [Math.max(least / 1.3, plot.spec.range_y[0]), greatest * 1.3];
    const margin = 0.08 * (greatest - least) || 0.02 * (plot.spec.range_y[1] - plot.spec.range_y[0]);
    return [least - margin, greatest + margin];
  }

  function showAll(figure) {
    const done = new Set();
    for (const plot of figure.plots) {
      if (done.has(plot.spec.x_label)) continue;
      done.add(plot.spec.x_label);
      zoom(plot, ...plot.spec.range_x);
    }
  }

  const move = (plot, share) => {
    const by = share * (plot.x[1] - plot.x[0]);
    zoom(plot, plot.x[0] + by, plot.x[1] + by);
  };

  const scale = (plot, factor, about = (plot.x[0] + plot.x[1]) / 2) =>
    zoom(plot, about + (plot.x[0] - about) * factor, about + (plot.x[1] - about) * factor);

  const ACTIONS = {
    in: (plot) => scale(plot, 0.5),
    out: (plot) => scale(plot, 2),
    left: (plot) => move(plot, -0.25),
    right: (plot) => move(plot, 0.25),
    all: (plot) => showAll(plot.figure),
  };

  /* Reading out: all plots of a figure show the same instant. */

  function read(plot, left, top) {
    if (left == null || left < 0) return readAt(plot.figure, null, null);
    const {u, spec} = plot;
    if (!spec.loop) return readAt(plot.figure, spec.x_label, u.posToVal(left, 'x'));
    let best = Infinity, at = null;
    for (const curve of plot.curves) {
      if (!curve.on) continue;
      for (let k = 0; k < curve.x.length; k++) {
        if (curve.y[k] == null) continue;
        const far = Math.hypot(u.valToPos(curve.x[k], 'x') - left, u.valToPos(curve.y[k], 'y') - top);
        if (far < best) { best = far; at = curve.time[k]; }
      }
    }
    readAt(plot.figure, null, best < 40 ? at : null);
  }

  /* Which quantity the instant is of: null is time, which loops have, too. */
  function readAt(figure, quantity, at) {
    for (const plot of figure.plots) {
      const {spec} = plot, mine = at != null && (spec.loop || quantity == null || spec.x_label === quantity);
      for (const curve of plot.curves) {
        curve.index = mine && curve.on ? nearest(curve.time, at) : null;
        place(plot, curve);
      }
      const first = plot.curves.find((c) => c.index != null);
      stretch(plot, first);
      readOut(plot, first);
    }
    figure.at = at;
  }

  function readOut(plot, first) {
    const {readout, u, spec} = plot, {x, y} = u.scales;
    readout.hidden = !first;
    if (!first) return;
    const across = first.x[first.index];
    readout.classList.toggle('on-the-right', u.valToPos(across, 'x') < u.over.clientWidth / 2);
    readout.firstChild.textContent = `${shown(across, x)} ${unitOf(spec.x_label)}`;
    plot.curves.forEach((curve, k) => {
      const low = curve.low[curve.index], high = curve.high[curve.index], cell = readout.children[k + 1];
      cell.hidden = curve.index == null;
      cell.lastChild.textContent = low === high ? shown(low, y) : `${shown(low, y)} … ${shown(high, y)}`;
    });
  }

  function stretch({u, spec, hair}, first) {
    const across = first && !spec.loop ? u.valToPos(first.x[first.index], 'x') : -1;
    hair.style.transform = `translateX(${across}px)`;
    hair.hidden = across < 0 || across > u.over.clientWidth;
  }

  function place(plot, curve) {
    const {u} = plot, k = curve.index, dot = curve.dot;
    dot.hidden = k == null || curve.y[k] == null;
    if (dot.hidden) return;
    const left = u.valToPos(curve.x[k], 'x'), top = u.valToPos(curve.y[k], 'y');
    dot.hidden = left < 0 || top < 0 || left > u.over.clientWidth || top > u.over.clientHeight;
    dot.style.transform = `translate(${left}px, ${top}px)`;
  }

  /* Hands: mouse, touch, keys. */

  function drag(plot, event) {
    const from = event.clientX, [first, last] = plot.x, width = plot.u.over.clientWidth;
    const by = (e) => (e.clientX - from) / width * (last - first);
    const moved = (e) => zoom(plot, first - by(e), last - by(e));
    const ended = () => {
      document.removeEventListener('mousemove', moved);
      document.removeEventListener('mouseup', ended);
    };
    document.addEventListener('mousemove', moved);
    document.addEventListener('mouseup', ended);
  }

  function touch(plot, over) {
    const fingers = new Map();
    const values = () => [...fingers.values()].map((f) => f.x / over.clientWidth).sort((a, b) => a - b);
    let held = null;
    const hold = () => { held = {x: [...plot.x], at: values()}; };
    over.addEventListener('pointerdown', (e) => {
      if (e.pointerType !== 'touch') return;
      fingers.set(e.pointerId, {x: e.clientX});
      hold();
    });
    over.addEventListener('pointermove', (e) => {
      if (!fingers.has(e.pointerId)) return;
      fingers.set(e.pointerId, {x: e.clientX});
      const [first, last] = held.x, span = last - first, now = values();
      if (now.length === 1 && !isWhole(plot)) {
        const by = (held.at[0] - now[0]) * span;
        zoom(plot, first + by, last + by);
      } else if (now.length === 2) {
        const wide = span * (held.at[1] - held.at[0]) / Math.max(now[1] - now[0], 0.02);
        const begin = first + held.at[0] * span - now[0] * wide;
        zoom(plot, begin, begin + wide);
      }
    });
    for (const end of ['pointerup', 'pointercancel']) {
      over.addEventListener(end, (e) => { if (fingers.delete(e.pointerId)) hold(); });
    }
  }

  function wheel(plot, event) {
    const over = plot.u.over, box = over.getBoundingClientRect();
    const sideways = event.shiftKey ? event.deltaY || event.deltaX : event.deltaX;
    if (event.ctrlKey || event.metaKey) {
      scale(plot, Math.exp(0.004 * event.deltaY), plot.u.posToVal(event.clientX - box.left, 'x'));
    } else if (!isWhole(plot) && Math.abs(sideways) >= Math.abs(event.shiftKey ? 0 : event.deltaY)) {
      move(plot, sideways / over.clientWidth);
    } else {
      return;
    }
    event.preventDefault();
  }

  function key(plot, event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target !== plot.element) return;
    const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    const action = {'+': 'in', '=': 'in', '-': 'out', 0: 'all', Escape: 'all'}[event.key];
    if (step && event.shiftKey) move(plot, 0.1 * step);
    else if (step) {
      const {time} = plot.curves[0];
      const now = plot.figure.at ?? (plot.spec.loop ? time[0] : (plot.x[0] + plot.x[1]) / 2);
      const k = clamp(nearest(time, now) + step, 0, time.length - 1);
      readAt(plot.figure, plot.spec.loop ? null : plot.spec.x_label, time[k]);
    } else if (action) ACTIONS[action](plot);
    else return;
    event.preventDefault();
  }

  /* Making a plot */

  /* Places on an axis with as many digits as their step has: 1e-4 is not 0. */
  function ticks(u, places) {
    const known = places.filter((v) => v != null);
    const step = Math.min(...known.slice(1).map((v, k) => Math.abs(v - known[k])));
    const digits = Number.isFinite(step) && step > 0 ? clamp(1 + Math.ceil(-Math.log10(step)), 0, 9) : 3;
    return places.map((v) => v == null ? v : v.toLocaleString('en', {maximumFractionDigits: digits, useGrouping: false, signDisplay: 'negative'}));
  }

  const powers = (u, places) => places.map((v) => v > 0 && Math.abs(Math.log10(v) % 1) < 1e-9 ? v : null);

  function axis(label, size, gap) {
    const ink = () => colour('quiet');
    return {
      stroke: ink, label, labelSize: label ? 16 : 0, labelGap: 0, labelFont: '11px system-ui, sans-serif', font: '11px system-ui, sans-serif', size, gap,
      grid: {stroke: () => colour('line'), width: 1}, ticks: {show: false},
    };
  }

  function heightOf(plot, width) {
    return plot.spec.square ? Math.round(Math.min(width, 460)) : plot.spec.height + (plot.spec.labelled ? 40 : 4);
  }

  function make(plot) {
    const {spec, target} = plot;
    const facets = [{scale: 'x', auto: false}, {scale: 'y', auto: false}];
    const width = target.clientWidth;
    const options = {
      mode: 2, width, height: heightOf(plot, width), legend: {show: false}, padding: [8, 10, 0, 0],
      scales: {
        x: {time: false, auto: false, range: (u, least, greatest) => least == null ? spec.range_x : [least, greatest]},
        y: {auto: false, distr: spec.log ? 3 : 1, log: 10, range: (u, least, greatest) => least == null ? spec.range_y : [least, greatest]},
      },
      series: [{}, ...plot.curves.map((curve) => ({facets, paths: () => { drawCurve(plot, curve); return null; }, points: {show: false}}))],
      axes: [
        spec.labelled ? {...axis(spec.x_label, 24, 4), space: 60, values: ticks} : {...axis('', 4, 0), space: 60, values: (u, places) => places.map(() => '')},
        {...axis('', 46, 4), space: 22, values: ticks, ...(spec.log ? {filter: powers, grid: {stroke: () => colour('line'), width: 1, filter: powers}} : {})},
      ],
      cursor: {
        x: false, y: false, points: {show: false}, drag: {x: true, y: spec.loop, setScale: false, dist: 4, uni: spec.loop ? 12 : null},
        bind: {
          mousedown: (u, over, begin) => (e) => { if (e.shiftKey) drag(plot, e); else begin(e); return null; },
          dblclick: () => () => { showAll(plot.figure); return null; },
        },
      },
      hooks: {
        drawClear: [(u) => drawBehind(u, plot)],
        draw: [() => {
          if (!plot.hair) return;
          stretch(plot, plot.curves.find((c) => c.index != null));
          for (const curve of plot.curves) place(plot, curve);
        }],
        setCursor: [(u) => read(plot, u.cursor.left, u.cursor.top)],
        setSelect: [(u) => {
          const {left, top, width: wide, height: high} = u.select;
          if (wide > 0) {
            const boxed = spec.loop && high > 0 && high < u.over.clientHeight;
            const y = boxed ? [u.posToVal(top + high, 'y'), u.posToVal(top, 'y')] : null;
            zoom(plot, u.posToVal(left, 'x'), u.posToVal(left + wide, 'x'), y);
          } else if (high > 0) {
            zoom(plot, ...plot.x, [u.posToVal(top + high, 'y'), u.posToVal(top, 'y')]);
          }
          u.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
        }],
      },
    };
    plot.u = new uPlot(options, [null, ...plot.curves.map((c) => [c.x, c.y])], target);
    const {over} = plot.u;
    plot.hair = document.createElement('div');
    plot.hair.className = 'plot-hair';
    plot.hair.hidden = true;
    over.append(plot.hair);
    plot.readout = document.createElement('div');
    plot.readout.className = 'plot-read';
    plot.readout.hidden = true;
    plot.readout.append(document.createElement('span'));
    plot.element.querySelectorAll('.plot-key svg').forEach((sign) => {
      const cell = document.createElement('div');
      cell.append(sign.cloneNode(true), '');
      plot.readout.append(cell);
    });
    over.append(plot.readout);
    for (const curve of plot.curves) {
      curve.dot = document.createElement('div');
      curve.dot.className = 'plot-dot';
      curve.dot.style.background = `var(--${curve.colour})`;
      curve.dot.hidden = true;
      over.append(curve.dot);
    }
    touch(plot, over);
    over.addEventListener('wheel', (e) => wheel(plot, e), {passive: false});
    plot.element.addEventListener('keydown', (e) => key(plot, e));
    plot.element.addEventListener('blur', () => readAt(plot.figure, null, null));
    plot.element.addEventListener('focus', () => { plot.figure.active = plot; });
    new ResizeObserver(() => {
      const wide = target.clientWidth;
      if (wide && wide !== plot.u.width) plot.u.setSize({width: wide, height: heightOf(plot, wide)});
    }).observe(target);
  }

  function begin(element) {
    const data = JSON.parse(element.querySelector('.plot-data').textContent);
    const targets = [...element.querySelectorAll('.plot-canvas')];
    const figure = {element, buttons: [...element.querySelectorAll('button[data-do]')], window: null, zoomed: false, at: null};
    figure.plots = data.plots.map((spec, k) => {
      const [begins, ends] = [0, 1].map((end) => data.plots.filter((p) => p.x_label === spec.x_label).map((p) => p.range_x[end]));
      return prepared({...spec, range_x: [Math.min(...begins), Math.max(...ends)], x: data.x}, targets[k]);
    });
    figure.active = figure.plots.find((p) => !p.spec.loop) ?? figure.plots[0];
    for (const plot of figure.plots) {
      plot.figure = figure;
      make(plot);
      plot.element.querySelectorAll('.plot-key').forEach((button, k) => {
        button.addEventListener('click', () => {
          const curve = plot.curves[k];
          curve.on = !curve.on;
          button.setAttribute('aria-pressed', String(curve.on));
          plot.u.series[k + 1].show = curve.on;
          plot.u.redraw();
        });
      });
    }
    for (const button of figure.buttons) button.addEventListener('click', () => ACTIONS[button.dataset.do](figure.active));
    element.classList.add('is-drawn');
    figures.push(figure);
  }

  const redraw = () => { for (const figure of figures) for (const plot of figure.plots) plot.u.redraw(); };
  document.querySelectorAll('.plots').forEach(begin);
  for (const what of ['(prefers-color-scheme: light)', 'print']) matchMedia(what).addEventListener('change', redraw);
}
