// Curves on a canvas: axes with ticks, linear or logarithmic; values under the pointer; zoom.
import {drawAxes, kBottom, kLeft, kRight, kTop} from './axes.js';
import {begin, line, say, showHint} from './canvas.js';
import {listenToGestures} from './gestures.js';
import {drawMark, modeColour, modeDash} from './mode_marks.js';
import {isNumber, number} from './numbers.js';
import {colour} from './theme.js';

/// The part of the horizontal axis that is shown, which several plots may share; null: all of it.
export class View {
  shown = null;
  at = null;  // under the pointer
}

const forward = (log, v) => (log ? Math.log10(v) : v);
const back = (log, v) => (log ? 10 ** v : v);

/// One drawing. `changed` is called when it has to be drawn again because of pointer or keys.
///
/// The wheel, after a click or with Ctrl, + and - zoom, dragging and arrow keys move what is shown, a double click or 0
/// shows all again. With Shift the arrow keys move the line whose values are shown.
export class Plot {
  constructor(canvas, changed, view = new View()) {
    Object.assign(this, {canvas, view, drawn: null, pointer: null});
    listenToGestures(canvas, changed, {
      hover: (place) => {
        this.pointer = place;
        view.at = this.value(place[0]);
      },
      drag: (dx) => this.move(-dx / this.width()),
      leave: () => {
        this.pointer = view.at = null;
        showHint(canvas, 0, 0, null);
      },
      zoom: (factor, place) => this.zoom(factor, place && this.value(place[0])),
      all: () => { view.shown = null; },
      arrow: (side, _, shift) => side !== 0 && (shift ? this.step(side) : this.move(0.1 * side)),
    }, {step: 1.5});
  }
  width() { return Math.max(1, this.canvas.clientWidth - kLeft - kRight); }
  /// The visible part of the horizontal axis, which has a range.
  shown(range) {
    const {shown} = this.view;
    return shown && shown[0] < range[1] && shown[1] > range[0] ? shown : range;
  }
  /// The visible part of the horizontal axis, and all of it; in logarithms on a logarithmic axis.
  spans() {
    const {log, range} = this.drawn, counted = (ends) => ends.map((v) => forward(log, v));
    return {log, shown: counted(this.shown(range)), range: counted(range)};
  }
  /// The value of the horizontal axis at a pixel, or null.
  value(x) {
    if (!this.drawn) return null;
    const {log, shown: [a, b]} = this.spans();
    return back(log, a + (b - a) * Math.min(1, Math.max(0, (x - kLeft) / this.width())));
  }
  /// Enlarges by a factor, with the value `at` where it is.
  zoom(factor, at = this.view.at) {
    if (!this.drawn) return;
    const {log, shown: [a, b], range: [low, high]} = this.spans();
    const fixed = at === null ? (a + b) / 2 : forward(log, at), k = Math.max(1 / factor, 1e-4 * (high - low) / (b - a));
    this.show(fixed - (fixed - a) * k, fixed + (b - fixed) * k);
  }
  move(share) {
    if (!this.drawn || !this.view.shown) return;
    const {shown: [a, b]} = this.spans(), by = share * (b - a);
    this.show(a + by, b + by);
  }
  /// Shows from a to b, moved to lie within the axis, or all of it.
  show(a, b) {
    const {log, range: [low, high]} = this.spans(), by = Math.max(0, low - a) - Math.max(0, b - high);
    this.view.shown = b - a >= (high - low) * .999 ? null : [a + by, b + by].map((v) => back(log, v));
  }
  /// Moves the line whose values are shown.
  step(side) {
    if (!this.drawn) return;
    const {log, shown: [a, b]} = this.spans(), was = this.view.at === null ? (a + b) / 2 : forward(log, this.view.at);
    const at = Math.min(b, Math.max(a, was + side * (b - a) / 100));
    this.view.at = back(log, at);
    this.pointer = [kLeft + this.width() * (at - a) / (b - a), kTop];
  }

  /// Draws `picture`:
  ///   title  text above
  ///   x      {range: [a, b], log, text: shown with a value, bare: without numbers}
  ///   y      {range: [a, b] or absent for what is visible, log: true, false or 'auto', degrees}
  ///   curves [{x, y, label (a mode) or colour and name, width, dash}]; a y that is not finite is a gap
  ///   levels [{value, text}] across, `lines` [{value}] upright
  ///   cursor a value of x, or null; `strip` [{x, colour}] along the bottom
  draw(picture) {
    const {c, w, h} = begin(this.canvas), {title, x} = picture, range = this.shown(x.range);
    const y = this.vertical(picture, range);
    if (!y || !(range[1] > range[0])) {
      const said = picture.empty || `${title}: nothing to show`;
      this.drawn = null;
      this.canvas.setAttribute('aria-label', said);
      say(c, w, h, said);
      return;
    }
    this.drawn = {log: !!x.log, range: x.range};
    const bottom = h - (x.bare ? 6 : kBottom);
    const map = (log, [a, b], low, high) => {
      const l = forward(log, a), k = (high - low) / (forward(log, b) - l);
      return (v) => low + k * (forward(log, v) - l);
    };
    const toX = map(x.log, range, kLeft, w - kRight), toY = map(y.log, y.range, bottom, kTop);
    const area = {c, w, h, bottom, x, y, range, toX, toY};
    drawAxes(area, title);
    c.save();
    c.beginPath();
    c.rect(kLeft, 0, w - kLeft - kRight + 6, h);
    c.clip();
    this.straight(area, picture);
    for (const curve of picture.curves || []) this.curve(area, curve);
    c.lineWidth = 1;
    c.setLineDash([]);
    const {at} = this.view, upright = (value, style) => {
      c.strokeStyle = colour(style);
      line(c, toX(value), kTop, toX(value), bottom);
    };
    if (isNumber(picture.cursor)) upright(picture.cursor, 'ink');
    if (at !== null && at >= range[0] && at <= range[1]) {
      upright(at, 'accent');
      if (this.pointer) this.hover(at, picture, toX(at), range);
    }
    c.restore();
    this.canvas.setAttribute('aria-label', this.summary(picture));
  }

  /// Lines upright and across, and the strip along the bottom.
  straight({c, w, bottom, y, toX, toY}, {lines = [], levels = [], strip = []}) {
    c.strokeStyle = colour('soft');
    c.setLineDash([2, 4]);
    for (const {value} of lines) line(c, toX(value), kTop, toX(value), bottom);
    c.strokeStyle = c.fillStyle = colour('accent');
    c.setLineDash([5, 4]);
    c.textAlign = 'right';
    let last = Infinity;
    for (const {value, text} of [...levels].sort((a, b) => b.value - a.value)) {
      if (!(value > 0) && y.log) continue;
      const at = toY(value);
      line(c, kLeft, at, w, at);
      if (text && Math.abs(at - 4 - last) > 12) c.fillText(text, w - kRight - 4, last = at - 4);
    }
    strip.forEach(({x: at, colour: name}, i) => {
      const end = i + 1 < strip.length ? toX(strip[i + 1].x) : toX(at) + 2;
      c.fillStyle = colour(name);
      c.fillRect(toX(at), bottom - 5, Math.max(end - toX(at) + .5, 1), 5);
    });
  }

  /// Range and kind of the vertical axis for the visible part, or null if nothing is visible.
  vertical({y, curves = [], levels = []}, [from, to]) {
    if (y.range) return y;
    let low = Infinity, high = -Infinity, negative = false;
    for (const {x, y: values} of curves) {
      for (let i = 0; i < x.length; ++i) {
        if (!isNumber(values[i]) || x[i] < from || x[i] > to) continue;
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
    const span = high - low || 1, wanted = y.log === true || (y.log === 'auto' && high > 8 * low);
    if (wanted && !negative && low > 0) {
      const room = 1.05 * (high / low) ** .06;
      return {...y, log: true, range: [low / room, high * room]};
    }
    if (y.around) return {...y, log: false, range: [low - .08 * span, high + .08 * span]};
    return {...y, log: false, range: [Math.min(low * 1.08, 0), high > 0 ? high * 1.08 : 1]};
  }

  curve({c, toX, toY, y: {log}}, {x, y, label, colour: own, dash, width = 1.6}) {
    c.strokeStyle = own ? colour(own) : modeColour(label);
    c.setLineDash(dash || (label === undefined ? [] : modeDash(label)));
    c.lineWidth = width;
    c.beginPath();
    let on = false, marked = -Infinity;
    const marks = [];
    for (let i = 0; i < x.length; ++i) {
      if (!isNumber(y[i]) || (log && y[i] <= 0)) {  // a gap stays one
        on = false;
        continue;
      }
      const px = toX(x[i]), py = toY(y[i]), last = i + 1 === x.length;
      c[on ? 'lineTo' : 'moveTo'](px, py);
      on = true;
      if (label === undefined) continue;
      // Marks stand along a curve of a mode, for each mode at places of its own, and at its end.
      const place = Math.floor(px / 120 + label * .37);
      if (!last && (px < kLeft || place <= marked)) continue;
      if (marked > -Infinity || last) marks.push([px, py]);
      marked = place;
    }
    c.stroke();
    for (const [px, py] of marks) drawMark(c, label, px, py, width > 2 ? 5 : 3.6);
  }

  /// The values of the points nearest to `at`, highest first, beside the pointer.
  hover(at, {x: {reach = Infinity, text = ''}, curves = []}, px, [from, to]) {
    const rows = [];
    for (const {x, y, label, name, unit = ''} of curves) {
      let low = 0, high = x.length - 1;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (x[middle] <= at) low = middle;
        else high = middle;
      }
      const i = Math.abs(x[low] - at) <= Math.abs((x[high] ?? Infinity) - at) ? low : high;
      if (!isNumber(y[i]) || Math.abs(x[i] - at) > reach || x[i] < from || x[i] > to) continue;
      rows.push({label, value: y[i], text: `${name ?? label}: ${number(y[i])}${unit}`});
    }
    rows.sort((a, b) => b.value - a.value);
    showHint(this.canvas, px, this.pointer[1], [{text: `${number(at)}${text}`}, ...rows]);
  }

  summary({title, curves = []}) {
    const said = curves.slice(0, 16).map(({y, label, name}) =>
      `${name ?? `mode ${label}`} ${number([...y].reverse().find(isNumber))}`);
    return `${title}. Now: ${said.join(', ')}. Keys: plus, minus, arrows and 0 zoom; Shift with arrows reads values.`;
  }
}
