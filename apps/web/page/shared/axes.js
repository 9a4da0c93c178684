// The axes of a plot, and where their ticks stand.
import {line} from './canvas.js';
import {tickText} from './numbers.js';
import {colour} from './theme.js';

export const kLeft = 54, kRight = 12, kTop = 18, kBottom = 20;  // margins, px

/// Round numbers from a to b, about `count`.
export function ticks(a, b, count) {
  const raw = (b - a) / Math.max(count, 1);
  if (!(raw > 0) || !Number.isFinite(raw)) return [a];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((s) => s * power >= raw * .999);
  const all = [];
  for (let i = Math.ceil(a / step - 1e-9); i * step <= b + 1e-9 * step; ++i) all.push(i * step);
  return all;
}

/// Ticks of a logarithmic axis from a to b, both positive: decades, or 1 and 3, or 1, 2 and 5 of each; round numbers
/// where less than that fits in between.
export function logTicks(a, b, count) {
  const all = [], decades = Math.log10(b / a);
  if (!(decades > 0) || !Number.isFinite(decades)) return [a];
  const factors = [[1, 2, 5], [1, 3], [1]].find((f) => decades * f.length <= 1.5 * count) || [1];
  const every = Math.ceil(decades / Math.max(count, 1));
  for (let e = Math.floor(Math.log10(a)); e <= Math.log10(b); ++e) {
    if (e % every) continue;
    for (const f of factors) if (f * 10 ** e >= a * .9999 && f * 10 ** e <= b * 1.0001) all.push(f * 10 ** e);
  }
  if (all.length >= 3 || decades > 1.5) return all;
  const even = ticks(a, b, count);
  return even.length >= 3 ? even : ticks(a, b, 2 * count + 2);
}

/// Draws axes with ticks and a title; toX and toY take values to px.
export function drawAxes({c, w, h, bottom, x, y, range, toX, toY}, title) {
  c.fillStyle = colour('soft');
  c.strokeStyle = colour('grid');
  c.textAlign = 'right';
  const rows = (bottom - kTop) / 28, [low, high] = y.range;
  const across = y.degrees ? ticks(low / 90, high / 90, Math.max(1, rows)).filter(Number.isInteger).map((v) => 90 * v)
    : (y.log ? logTicks : ticks)(low, high, rows);
  for (const v of across) {
    line(c, kLeft, toY(v), w - kRight, toY(v));
    c.fillText(tickText(v), kLeft - 6, toY(v) + 4);
  }
  c.textAlign = 'center';
  const count = (w - kLeft) / 80;
  let right = -Infinity;
  for (const v of x.log ? logTicks(...range, 2 * count) : ticks(...range, count)) {
    line(c, toX(v), kTop, toX(v), bottom);
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
  line(c, kLeft, kTop, kLeft, bottom);
  line(c, kLeft, bottom, w - kRight, bottom);
}
