// Curves on a canvas: axes with ticks, linear or logarithmic; values under the pointer; zoom.
import {begin, colour, line, logTicks, mark, modeColour, modeDash, number, say, showHint, tickText, ticks} from '/draw.js';

const kLeft = 54, kRight = 12, kTop = 18, kBottom = 20;

/// The part of the horizontal axis that is shown, which several plots may share; null: all of it.
export class View {
  constructor() {
    this.shown = null;
    this.at = null;  // under the pointer
  }
}

const finite = (v) => v !== null && v !== undefined && Number.isFinite(v);
const forward = (log, v) => (log ? Math.log10(v) : v);
const back = (log, v) => (log ? 10 ** v : v);

/// One drawing. `changed` is called when it has to be drawn again because of pointer or keys.
///
/// The wheel, after a click or with Ctrl, + and - zoom, dragging and arrow keys move what is shown, a
/// double click or 0 shows all again. With Shift the arrow keys move the line whose values are shown.
export class Plot {
  constructor(canvas, changed, view = new View()) {
    Object.assign(this, {canvas, changed, view, drawn: null, pointer: null});
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    let drag = null;
    const place = (e) => e.clientX - canvas.getBoundingClientRect().left;
    canvas.addEventListener('pointerdown', (e) => { drag = place(e); });
    canvas.addEventListener('pointermove', (e) => {
      this.pointer = [place(e), e.clientY - canvas.getBoundingClientRect().top];
      this.view.at = this.value(this.pointer[0]);
      if (drag !== null && e.buttons & 1 && this.view.shown) {
        this.move((drag - place(e)) / this.width());
        drag = place(e);
      }
      this.changed();
    });
    canvas.addEventListener('pointerup', () => { drag = null; });
    canvas.addEventListener('pointerleave', () => this.leave());
    canvas.addEventListener('blur', () => this.leave());
    canvas.addEventListener('wheel', (e) => {
      if (!this.drawn || (document.activeElement !== canvas && !e.ctrlKey)) return;  // the page scrolls
      e.preventDefault();
      this.zoom(Math.exp(e.deltaY * 0.002), this.value(place(e)));
    }, {passive: false});
    canvas.addEventListener('dblclick', () => this.all());
    canvas.addEventListener('keydown', (e) => {
      const side = {ArrowLeft: -1, ArrowRight: 1}[e.key];
      if (side && e.shiftKey) this.step(side);
      else if (side) this.move(0.1 * side);
      else if (e.key === '+' || e.key === '=') this.zoom(1 / 1.5);
      else if (e.key === '-') this.zoom(1.5);
      else if (e.key === '0') this.all();
      else return;
      e.preventDefault();
    });
  }
  leave() {
    this.pointer = this.view.at = null;
    showHint(this.canvas, 0, 0, null);
    this.changed();
  }
  width() { return Math.max(1, this.canvas.clientWidth - kLeft - kRight); }
  /// The value of the horizontal axis at a pixel, or null.
  value(x) {
    if (!this.drawn) return null;
    const {log, range: [a, b]} = this.drawn, [l, r] = [forward(log, a), forward(log, b)];
    return back(log, l + (r - l) * Math.min(1, Math.max(0, (x - kLeft) / this.width())));
  }
  all() {
    this.view.shown = null;
    this.changed();
  }
  /// Shows `factor` times as much, with the value `at` where it is.
  zoom(factor, at = this.view.at) {
    if (!this.drawn) return;
    const {log, range, whole} = this.drawn, [a, b] = range.map((v) => forward(log, v));
    const [low, high] = whole.map((v) => forward(log, v)), fixed = at === null ? (a + b) / 2 : forward(log, at);
    const most = high - low, share = Math.max(factor, 1e-4 * most / (b - a));
    const shown = [fixed - (fixed - a) * share, fixed + (b - fixed) * share];
    this.view.shown = shown[1] - shown[0] >= most * .999 ? null : this.within(shown, low, high).map((v) => back(log, v));
    this.changed();
  }
  move(share) {
    if (!this.drawn || !this.view.shown) return;
    const {log, range, whole} = this.drawn, [a, b] = range.map((v) => forward(log, v)), by = share * (b - a);
    this.view.shown = this.within([a + by, b + by], ...whole.map((v) => forward(log, v))).map((v) => back(log, v));
    this.changed();
  }
  within([a, b], low, high) {
    const by = Math.max(0, low - a) - Math.max(0, b - high);
    return [a + by, b + by];
  }
  step(side) {
    if (!this.drawn) return;
    const {log, range} = this.drawn, [a, b] = range.map((v) => forward(log, v));
    const at = this.view.at === null ? (a + b) / 2 : forward(log, this.view.at);
    this.view.at = back(log, Math.min(b, Math.max(a, at + side * (b - a) / 100)));
    this.pointer = [kLeft + this.width() * (forward(log, this.view.at) - a) / (b - a), kTop];
    this.changed();
  }

  /// Draws `picture`:
  ///   title  text above
  ///   x      {range: [a, b], log, text: shown with a value, bare: without numbers}
  ///   y      {range: [a, b] or absent for what is visible, log: true, false or 'auto', degrees}
  ///   curves [{x, y, label (a mode) or colour and name, width, dash}]; a y that is not finite is a gap
  ///   levels [{value, text}] across, `lines` [{value}] upright
  ///   cursor a value of x, or null; `strip` [{x, colour}] along the bottom
  draw(picture) {
    const {c, w, h} = begin(this.canvas), {title, x, curves = [], levels = [], lines = []} = picture;
    const [from, to] = x.range, shown = this.view.shown;
    const range = shown && shown[0] < to && shown[1] > from ? shown : x.range;
    const y = this.vertical(picture, range);
    if (!y || !(range[1] > range[0])) {
      const said = picture.empty || `${title}: nothing to show`;
      this.drawn = null;
      this.canvas.setAttribute('aria-label', said);
      return say(c, w, h, said);
    }
    this.drawn = {log: !!x.log, range, whole: x.range};
    const bottom = x.bare ? 6 : kBottom;
    const map = (log, [a, b], low, high) => {
      const l = forward(log, a), k = (high - low) / (forward(log, b) - l);
      return (v) => low + k * (forward(log, v) - l);
    };
    const toX = map(x.log, range, kLeft, w - kRight), toY = map(y.log, y.range, h - bottom, kTop);
    this.axes(c, w, h, {title, x, y, range, toX, toY, bottom});
    c.save();
    c.beginPath();
    c.rect(kLeft, 0, w - kLeft - kRight + 6, h);
    c.clip();
    for (const {value} of lines) {
      c.strokeStyle = colour('soft');
      c.setLineDash([2, 4]);
      line(c, toX(value), kTop, toX(value), h - bottom);
    }
    let text = Infinity;
    for (const level of [...levels].sort((a, b) => b.value - a.value)) {
      if (!(level.value > 0) && y.log) continue;
      c.strokeStyle = c.fillStyle = colour('accent');
      c.setLineDash([5, 4]);
      line(c, kLeft, toY(level.value), w, toY(level.value));
      c.textAlign = 'right';
      const at = toY(level.value) - 4;
      if (level.text && Math.abs(at - text) > 12) c.fillText(level.text, w - kRight - 4, text = at);
    }
    for (const curve of curves) this.curve(c, curve, toX, toY, w, y.log);
    for (const [i, {x: at, colour: name}] of (picture.strip || []).entries()) {
      const next = picture.strip[i + 1];
      c.fillStyle = colour(name);
      c.fillRect(toX(at), h - bottom - 5, Math.max((next ? toX(next.x) : toX(at) + 2) - toX(at) + .5, 1), 5);
    }
    c.lineWidth = 1;
    c.setLineDash([]);
    if (finite(picture.cursor)) {
      c.strokeStyle = colour('ink');
      line(c, toX(picture.cursor), kTop, toX(picture.cursor), h - bottom);
    }
    const at = this.view.at;
    if (at !== null && at >= range[0] && at <= range[1]) {
      c.strokeStyle = colour('accent');
      line(c, toX(at), kTop, toX(at), h - bottom);
      if (this.pointer) this.hover(at, picture, toX(at), range);
    }
    c.restore();
    this.canvas.setAttribute('aria-label', this.summary(picture));
  }

  /// Range and kind of the vertical axis for what is visible, or null if nothing is.
  vertical({y, curves = [], levels = []}, [from, to]) {
    if (y.range) return y;
    let low = Infinity, high = -Infinity, negative = false;
    for (const {x, y: values} of curves) {
      for (let i = 0; i < x.length; ++i) {
        if (!finite(values[i]) || x[i] < from || x[i] > to) continue;
        if (values[i] <= 0) negative = true;
        low = Math.min(low, values[i]);
        high = Math.max(high, values[i]);
      }
    }
    if (!(high > -Infinity)) return null;
    for (const {value} of levels) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    const log = !negative && low > 0 && (y.log === true || (y.log === 'auto' && high > 8 * low));
    if (log) return {...y, log, range: [low / (1.05 * (high / low) ** .06), high * 1.05 * (high / low) ** .06]};
    if (y.around) return {...y, log: false, range: [low - .08 * (high - low || 1), high + .08 * (high - low || 1)]};
    return {...y, log: false, range: [Math.min(low * 1.08, 0), high > 0 ? high * 1.08 : 1]};
  }

  axes(c, w, h, {title, x, y, range, toX, toY, bottom}) {
    c.fillStyle = colour('soft');
    c.strokeStyle = colour('grid');
    c.textAlign = 'right';
    const rows = (h - bottom - kTop) / 28;
    const upright = y.degrees ? ticks(y.range[0] / 90, y.range[1] / 90, Math.max(1, rows)).filter(Number.isInteger).map((v) => 90 * v)
      : y.log ? logTicks(...y.range, rows) : ticks(...y.range, rows);
    for (const v of upright) {
      line(c, kLeft, toY(v), w - kRight, toY(v));
      c.fillText(tickText(v), kLeft - 6, toY(v) + 4);
    }
    c.textAlign = 'center';
    const count = (w - kLeft) / 80;
    let right = -Infinity;
    for (const v of x.log ? logTicks(...range, 2 * count) : ticks(...range, count)) {
      line(c, toX(v), kTop, toX(v), h - bottom);
      const half = c.measureText(tickText(v)).width / 2, at = Math.min(toX(v), w - half - 1);
      if (!x.bare && at - half > right + 6) {
        c.fillText(tickText(v), at, h - 5);
        right = at + half;
      }
    }
    c.textAlign = 'left';
    c.fillStyle = colour('ink');
    c.fillText(title, kLeft, 12, w - kLeft - 4);
    c.strokeStyle = colour('soft');
    line(c, kLeft, kTop, kLeft, h - bottom);
    line(c, kLeft, h - bottom, w - kRight, h - bottom);
  }

  curve(c, {x, y, label, colour: own, dash, width = 1.6}, toX, toY, w, log) {
    c.strokeStyle = own ? colour(own) : modeColour(label);
    c.setLineDash(dash || (label === undefined ? [] : modeDash(label)));
    c.lineWidth = width;
    c.beginPath();
    let on = false, marked = -Infinity;
    const marks = [];
    for (let i = 0; i < x.length; ++i) {
      if (!finite(y[i]) || (log && y[i] <= 0)) {  // a gap stays one
        on = false;
        continue;
      }
      const px = toX(x[i]), py = toY(y[i]);
      c[on ? 'lineTo' : 'moveTo'](px, py);
      on = true;
      // Marks stand along a curve of a mode, for each mode at places of its own, and at its end.
      if (label !== undefined && (i + 1 === x.length || (px >= kLeft && Math.floor(px / 120 + label * .37) > marked))) {
        if (marked > -Infinity || i + 1 === x.length) marks.push([px, py]);
        marked = Math.floor(px / 120 + label * .37);
      }
    }
    c.stroke();
    for (const [px, py] of marks) mark(c, label, px, py, width > 2 ? 5 : 3.6);
  }

  /// The values at `at`, beside the pointer: those of the nearest points, highest first.
  hover(at, {x, curves = []}, px, [from, to]) {
    const reach = x.reach === undefined ? Infinity : x.reach;
    const rows = [];
    for (const {x: xs, y, label, name, unit = ''} of curves) {
      let low = 0, high = xs.length - 1;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (xs[middle] <= at) low = middle;
        else high = middle;
      }
      const i = Math.abs(xs[low] - at) <= Math.abs((xs[high] ?? Infinity) - at) ? low : high;
      if (!finite(y[i]) || Math.abs(xs[i] - at) > reach || xs[i] < from || xs[i] > to) continue;
      rows.push({label, value: y[i], text: `${name ?? label}: ${number(y[i])}${unit}`});
    }
    rows.sort((a, b) => b.value - a.value);
    showHint(this.canvas, px, this.pointer[1], [{text: `${number(at)}${x.text || ''}`}, ...rows]);
  }

  summary({title, curves = []}) {
    const last = (ys) => ys.findLast ? ys.findLast(finite) : [...ys].reverse().find(finite);
    const said = curves.slice(0, 16).map(({y, label, name}) => `${name ?? `mode ${label}`} ${number(last(y))}`);
    return `${title}. Now: ${said.join(', ')}. Keys: plus, minus, arrows and 0 zoom; Shift with arrows reads values.`;
  }
}

/// The receptance: magnitude and phase over frequency, on two plots with one View.
export function drawResponse(magnitude, phase, response, note) {
  const empty = {title: '', x: {range: [0, 1]}, y: {}, empty: note};
  if (!response) {
    magnitude.draw(empty);
    return phase.draw({...empty, empty: '–'});
  }
  const omega = response.omega, x = {range: [omega[0], omega[omega.length - 1]], log: true, text: ' rad/s'};
  const lines = response.natural_frequency.filter((f) => f > 0).map((value) => ({value}));
  const curve = {x: omega, colour: 'accent', width: 2};
  magnitude.draw({title: `|H|, ${response.unit}`, x: {...x, bare: true}, y: {log: true}, lines,
    curves: [{...curve, y: response.magnitude, name: '|H|', unit: ` ${response.unit}`}]});
  const degrees = response.phase.map((v) => v * 180 / Math.PI);
  phase.draw({title: 'phase, °; frequency, rad/s', x, y: {degrees: true, range: [Math.min(...degrees.filter(finite), -180), 5]},
    lines, curves: [{...curve, y: degrees, name: 'phase', unit: '°'}]});
}
