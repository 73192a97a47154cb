/* How the curves of a plot are drawn on uPlot's axes, and what is marked behind them. */
'use strict';
const drawing = (() => {
  const root = getComputedStyle(document.documentElement);
  const colour = (name) => root.getPropertyValue(`--${name}`).trim();

  function drawCurve(plot, curve) {
    const {u, spec} = plot, {ctx, bbox} = u;
    const across = (v) => u.valToPos(v, 'x', true), up = (v) => u.valToPos(v, 'y', true);
    const ink = colour(curve.colour), ratio = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineJoin = 'round';
    ctx.strokeStyle = ink;
    ctx.lineWidth = curve.width * ratio;
    ctx.setLineDash(curve.dash.map((d) => d * ratio));
    if (curve.to != null) {
      ctx.fillStyle = `${ink}40`;
      ctx.fill(outline(curve.x, curve.y, plot.curves[curve.to].y, across, up));
    }
    if (curve.stepped) {
      const box = outlineOfSteps(curve, across, up);
      if (curve.low !== curve.high) {
        ctx.fillStyle = ink;
        ctx.fill(box);
      }
      ctx.stroke(box);
    } else {
      if (curve.low !== curve.high) {
        ctx.fillStyle = `${ink}38`;
        ctx.fill(outline(curve.x, curve.low, curve.high, across, up));
      }
      const window = spec.loop && plot.figure.window;
      if (window) {
        const [first, last] = window;
        ctx.globalAlpha = 0.18;
        ctx.stroke(line(curve.x, curve.y, across, up));
        ctx.globalAlpha = 1;
        ctx.stroke(line(curve.x, curve.y, across, up, (k) => curve.time[k] >= first && curve.time[k] <= last));
      } else {
        ctx.stroke(line(curve.x, curve.y, across, up));
      }
    }
    ctx.restore();
  }

  function line(x, y, across, up, wanted = () => true) {
    const path = new Path2D();
    let pen = false;
    for (let k = 0; k < x.length; k++) {
      if (y[k] == null || x[k] == null || !wanted(k)) { pen = false; continue; }
      if (pen) path.lineTo(across(x[k]), up(y[k])); else path.moveTo(across(x[k]), up(y[k]));
      pen = true;
    }
    return path;
  }

  function outline(x, low, high, across, up) {
    const path = new Path2D();
    runs(low, (first, last) => {
      path.moveTo(across(x[first]), up(low[first]));
      for (let k = first + 1; k < last; k++) path.lineTo(across(x[k]), up(low[k]));
      for (let k = last - 1; k >= first; k--) path.lineTo(across(x[k]), up(high[k]));
      path.closePath();
    });
    return path;
  }

  function outlineOfSteps({edges, low, high}, across, up) {
    const path = new Path2D();
    runs(low, (first, last) => {
      path.moveTo(across(edges[first]), up(low[first]));
      for (let k = first; k < last; k++) {
        path.lineTo(across(edges[k]), up(low[k]));
        path.lineTo(across(edges[k + 1]), up(low[k]));
      }
      if (low === high) return;
      for (let k = last - 1; k >= first; k--) {
        path.lineTo(across(edges[k + 1]), up(high[k]));
        path.lineTo(across(edges[k]), up(high[k]));
      }
      path.closePath();
    });
    return path;
  }

  /* Calls take(first, last) for each stretch of an array that has no gap. */
  function runs(values, take) {
    let first = 0;
    for (let k = 0; k <= values.length; k++) {
      if (k < values.length && values[k] != null) continue;
      if (k > first) take(first, k);
      first = k + 1;
    }
  }

  function drawBehind(u, plot) {
    const {ctx, bbox} = u, {spec} = plot, ratio = devicePixelRatio;
    const across = (v) => Math.min(Math.max(u.valToPos(v, 'x', true), bbox.left), bbox.left + bbox.width);
    ctx.save();
    ctx.fillStyle = colour('finding-shade');
    for (const [begin, end] of spec.shaded) {
      const left = across(begin), right = across(end);
      if (right > bbox.left && left < bbox.left + bbox.width) ctx.fillRect(left, bbox.top, Math.max(right - left, ratio), bbox.height);
    }
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineWidth = ratio;
    ctx.strokeStyle = colour('finding');
    for (const mark of spec.marks) straight(ctx, u, mark, u.scales.y.min, mark, u.scales.y.max);
    ctx.strokeStyle = colour('reference');
    ctx.setLineDash([2 * ratio, 3 * ratio]);
    if (spec.diagonal) {
      const least = Math.min(u.scales.x.min, u.scales.y.min), greatest = Math.max(u.scales.x.max, u.scales.y.max);
      straight(ctx, u, least, least, greatest, greatest);
    }
    if (spec.level) {
      const [value, word] = spec.level;
      straight(ctx, u, u.scales.x.min, value, u.scales.x.max, value);
      ctx.fillStyle = colour('quiet');
      ctx.font = `${11 * ratio}px system-ui, sans-serif`;
      ctx.textAlign = 'right';
      ctx.fillText(word, bbox.left + bbox.width - 4 * ratio, u.valToPos(value, 'y', true) - 4 * ratio);
    }
    ctx.restore();
  }

  function straight(ctx, u, x0, y0, x1, y1) {
    ctx.beginPath();
    ctx.moveTo(u.valToPos(x0, 'x', true), u.valToPos(y0, 'y', true));
    ctx.lineTo(u.valToPos(x1, 'x', true), u.valToPos(y1, 'y', true));
    ctx.stroke();
  }

  return {colour, drawCurve, drawBehind};
})();
