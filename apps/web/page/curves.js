// Curves over time, and the response over frequency.
import {begin, colour, line, modeColour, modeDash, say, tickText, ticks} from '/draw.js';

const kLeft = 54, kRight = 10, kTop = 18, kBottom = 20;

/// Axes with grid; returns the map from values to pixels, or null if there is nothing to show.
function axes(frame, x, y, title, options = {}) {
  const {c, w, h} = frame;
  const bottom = options.bare ? 6 : kBottom;
  const toX = (v) => kLeft + (w - kLeft - kRight) * (v - x[0]) / (x[1] - x[0]);
  const toY = (v) => h - bottom - (h - bottom - kTop) * (v - y[0]) / (y[1] - y[0]);
  c.fillStyle = colour('soft');
  c.strokeStyle = colour('grid');
  c.textAlign = 'right';
  for (const v of options.power ? decades(y) : options.degrees ? angles(y) : ticks(y[0], y[1], (h - bottom - kTop) / 34)) {
    line(c, kLeft, toY(v), w - kRight, toY(v));
    c.fillText(options.power ? `10${superscript(Math.round(v))}` : tickText(v), kLeft - 6, toY(v) + 4);
  }
  c.textAlign = 'center';
  for (const v of options.decades ? decades(x) : ticks(x[0], x[1], (w - kLeft) / 80)) {
    line(c, toX(v), kTop, toX(v), h - bottom);
    if (!options.bare) c.fillText(options.decades ? tickText(10 ** v) : tickText(v), Math.min(toX(v), w - 16), h - 5);
  }
  c.textAlign = 'left';
  c.fillStyle = colour('ink');
  c.fillText(title, kLeft, 12);
  return {toX, toY, bottom};
}
const superscript = (n) => String(n).replace('-', '⁻').replace(/\d/g, (d) => '⁰¹²³⁴⁵⁶⁷⁸⁹'[d]);
const decades = ([a, b]) => Array.from({length: Math.floor(b) - Math.ceil(a) + 1}, (_, i) => Math.ceil(a) + i);

// Every 90 degrees, or as many as there is room for.
const angles = ([a, b]) => {
  const step = 90 * Math.ceil((b - a) / 450);
  return Array.from({length: Math.floor(b / step) - Math.ceil(a / step) + 1}, (_, i) => (Math.ceil(a / step) + i) * step);
};

function trace(c, xs, ys, toX, toY) {
  c.beginPath();
  let on = false;
  for (let i = 0; i < xs.length; ++i) {
    const y = ys[i];
    if (y === null || y === undefined || !Number.isFinite(y)) {  // a gap stays one
      on = false;
      continue;
    }
    c[on ? 'lineTo' : 'moveTo'](toX(xs[i]), toY(y));
    on = true;
  }
  c.stroke();
}

/// `series` is {time, modes: Map(label -> {key: [...]})}; `marks` are levels with a text.
export function drawModes(canvas, series, key, title, now, marks, shown, chosen) {
  const frame = begin(canvas), {c, w, h} = frame;
  const values = [];
  for (const curves of series.modes.values()) for (const v of curves[key]) if (Number.isFinite(v) && v !== null) values.push(v);
  if (!values.length) return say(c, w, h, `${title}: no modes`);
  let high = Math.max(...marks.map((m) => m.level));
  for (const v of values) high = Math.max(high, v);
  const {toX, toY} = axes(frame, shown, [0, high * 1.08 || 1], title);
  c.save();
  c.beginPath();
  c.rect(kLeft, 0, w - kLeft - kRight, h);
  c.clip();
  for (const {level, text} of marks) {
    c.strokeStyle = colour('accent');
    c.setLineDash([5, 4]);
    line(c, kLeft, toY(level), w, toY(level));
    c.fillStyle = colour('accent');
    c.textAlign = 'right';
    c.fillText(text, w - kRight - 4, toY(level) - 4);
  }
  for (const [label, curves] of series.modes) {
    c.strokeStyle = modeColour(label);
    c.setLineDash(modeDash(label));
    c.lineWidth = label === chosen ? 3 : 1.6;
    trace(c, series.time, curves[key], toX, toY);
  }
  c.setLineDash([]);
  cursor(c, toX(now), h);
  c.restore();
}

function cursor(c, x, h) {
  c.strokeStyle = colour('ink');
  c.lineWidth = 1;
  line(c, x, kTop, x, h - kBottom);
}

export function drawTicks(canvas, series, now, shown, period) {
  const frame = begin(canvas), {c, w, h} = frame;
  if (!series.tick.length) return say(c, w, h, 'no states');
  let high = 1;
  for (const v of series.tick) high = Math.max(high, v || 0);
  const over = period && high > 0.5e6 * period ? `, period ${tickText(1e6 * period)} µs` : '';
  const {toX, toY} = axes(frame, shown, [0, high * 1.1], `tick, µs${over}; strip: status, orange if not ok; time, s`);
  c.save();
  c.beginPath();
  c.rect(kLeft, 0, w - kLeft - kRight, h);
  c.clip();
  c.strokeStyle = colour('accent');
  c.lineWidth = 1;
  trace(c, series.time, series.tick, toX, toY);
  for (let i = 0; i < series.time.length; ++i) {
    c.fillStyle = colour(series.status[i] ? 'bad' : 'good');
    const x = toX(series.time[i]), next = i + 1 < series.time.length ? toX(series.time[i + 1]) : x + 2;
    c.fillRect(x, h - kBottom - 5, Math.max(next - x + 0.5, 1), 5);
  }
  cursor(c, toX(now), h);
  c.restore();
}

export function drawResponse(magnitude, phase, response, note) {
  const views = [begin(magnitude), begin(phase)];
  if (!response) {
    for (const {c, w, h} of views.slice(0, 1)) say(c, w, h, note);
    return;
  }
  const x = response.omega.map((w) => Math.log10(w)), span = [x[0], x[x.length - 1]];
  const size = response.magnitude.map((v) => (v > 0 ? Math.log10(v) : null));
  const finite = size.filter((v) => v !== null && Number.isFinite(v));
  if (!finite.length) return;
  const curves = [[size, [Math.min(...finite) - .2, Math.max(...finite) + .2], `|H|, ${response.unit}`, {power: true, decades: true, bare: true}],
    [response.phase.map((v) => v * 180 / Math.PI), null, 'phase, °; frequency, rad/s', {degrees: true, decades: true}]];
  curves.forEach(([ys, range, title, options], i) => {
    const {c, w, h} = views[i];
    const low = Math.min(...ys.filter(Number.isFinite), -180);
    const {toX, toY, bottom} = axes(views[i], span, range || [low, 5], title, options);
    response.natural_frequency.forEach((f) => {
      if (!(f > 0)) return;
      c.strokeStyle = colour('soft');
      c.setLineDash([2, 4]);
      line(c, toX(Math.log10(f)), kTop, toX(Math.log10(f)), h - bottom);
      c.setLineDash([]);
    });
    c.strokeStyle = colour('accent');
    c.lineWidth = 2;
    trace(c, x, ys, toX, toY);
  });
}
