// Drawing on a canvas in CSS pixels, and the hint beside its pointer.
import {element} from './dom.js';
import {markElement} from './mode_marks.js';
import {colour} from './theme.js';

/// The context of a canvas, cleared, with its width and height in CSS pixels.
export function begin(canvas) {
  const scale = window.devicePixelRatio || 1;
  const w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== Math.round(w * scale) || canvas.height !== Math.round(h * scale)) {
    canvas.width = Math.round(w * scale);
    canvas.height = Math.round(h * scale);
  }
  const c = canvas.getContext('2d');
  c.setTransform(scale, 0, 0, scale, 0, 0);
  c.clearRect(0, 0, w, h);
  c.font = '11.5px system-ui, "DejaVu Sans", sans-serif';
  c.lineWidth = 1;
  c.setLineDash([]);
  return {c, w, h};
}

/// Begins a path through points [x, y].
export function trace(c, points, closed = false) {
  c.beginPath();
  for (const [x, y] of points) c.lineTo(x, y);
  if (closed) c.closePath();
}

export function line(c, x0, y0, x1, y1) {
  trace(c, [[x0, y0], [x1, y1]]);
  c.stroke();
}

export function circle(c, x, y, r) {
  c.beginPath();
  c.arc(x, y, r, 0, 2 * Math.PI);
}

export function cross(c, x, y, r) {
  line(c, x - r, y - r, x + r, y + r);
  line(c, x - r, y + r, x + r, y - r);
}

/// Text in the middle of an empty drawing.
export function say(c, w, h, text) {
  c.fillStyle = colour('soft');
  c.textAlign = 'center';
  text.split('\n').forEach((row, i, all) => c.fillText(row, w / 2, h / 2 + 16 * (i - (all.length - 1) / 2), w - 8));
}

/// Shows rows {label, text} beside a point of a canvas, or nothing.
export function showHint(canvas, x, y, rows) {
  let hint = document.querySelector('body > .hint');
  if (!hint) document.body.append(hint = element('div', {class: 'hint'}));
  hint.hidden = !rows;
  if (!rows) return;
  hint.replaceChildren(...rows.map(({label, text}) =>
    element('div', {}, ...(label === undefined ? [] : [markElement(label), ' ']), text)));
  const box = canvas.getBoundingClientRect(), {offsetWidth: wide, offsetHeight: high} = hint;
  const left = box.left + x + 14, over = left + wide > document.documentElement.clientWidth - 4;
  hint.style.left = `${window.scrollX + (over ? Math.max(4, left - 28 - wide) : left)}px`;
  hint.style.top = `${window.scrollY + Math.max(4, Math.min(box.top + y - 10, window.innerHeight - high - 4))}px`;
}
