// The poles of the sampled loop beside the unit circle.
import {ticks} from '../shared/axes.js';
import {begin, cross, line, say, trace} from '../shared/canvas.js';
import {fixed, tickText} from '../shared/numbers.js';
import {colour} from '../shared/theme.js';

const kLeft = 38, kRight = 20, kBottom = 18;  // margins, px

/// Sampled poles z = exp(l T), accurate near z = 1.
export function sampledPoles(sampled, period) {
  if (!sampled || !(period > 0)) return [];
  return sampled.natural_frequency.flatMap((w, i) => {
    const ratio = sampled.damping_ratio[i];
    if (w === null || ratio === null) return [];
    const split = ratio > 1 ? w * Math.sqrt(ratio * ratio - 1) : 0;
    return [1, -1].map((s) => {
      const angle = ratio > 1 ? 0 : s * sampled.damped_frequency[i] * period;
      const size = Math.exp((s * split - ratio * w) * period);
      return {re: size * Math.cos(angle), im: size * Math.sin(angle)};
    });
  });
}

/// The z plane around z = 1, with the unit circle; `poles` are {re, im}.
export function drawCircle(canvas, poles) {
  const {c, w, h} = begin(canvas);
  if (!poles.length) {
    say(c, w, h, 'no sampled poles');
    return;
  }
  const width = Math.max(...poles.map((z) => Math.abs(1 - z.re)), 1e-9);
  const height = Math.max(...poles.map((z) => Math.abs(z.im)), width * 0.1);
  const bottom = h - kBottom, x0 = w - kRight, y0 = bottom / 2;
  const k = Math.min((w - kLeft - 36) / width, (bottom - 24) / 2 / height);
  const toX = (re) => x0 - k * (1 - re), toY = (im) => y0 - k * im;
  c.save();
  c.beginPath();
  c.rect(kLeft, 0, w, bottom);
  c.clip();
  c.fillStyle = colour('grid');
  const most = Math.min(Math.PI, 1.3 * (h / 2) / k);  // the circle is larger than the canvas, mostly
  const angles = Array.from({length: 129}, (_, i) => (i - 64) / 64 * most);
  trace(c, [...angles.map((a) => [toX(Math.cos(a)), toY(Math.sin(a))]), [-4, -40], [-4, h + 40]], true);
  c.globalAlpha = 0.6;
  c.fill();
  c.globalAlpha = 1;
  c.strokeStyle = colour('accent');
  c.lineWidth = 1.5;
  c.stroke();
  c.strokeStyle = colour('soft');
  c.lineWidth = 1;
  line(c, 4, y0, w - 4, y0);
  c.restore();
  c.strokeStyle = c.fillStyle = colour('soft');
  line(c, kLeft, 0, kLeft, bottom);
  line(c, kLeft, bottom, w, bottom);
  c.textAlign = 'center';
  // Numbers of the axis are distances from z = 1, because z itself differs in its last digits.
  for (const v of ticks(0, (x0 - kLeft - 6) / k, (w - 40) / 70)) {
    const x = toX(1 - v), text = v ? `1−${tickText(v)}` : '1';
    line(c, x, bottom, x, bottom + 3);
    c.fillText(text, Math.min(x, w - c.measureText(text).width / 2 - 1), h - 4);
  }
  c.textAlign = 'right';
  const half = (bottom / 2 - 6) / k;
  for (const v of ticks(-half, half, bottom / 30)) {
    line(c, kLeft - 3, toY(v), kLeft, toY(v));
    c.fillText(tickText(v), kLeft - 5, toY(v) + 4, 32);
  }
  c.lineWidth = 1.8;
  for (const {re, im} of poles) {
    c.strokeStyle = colour(Math.hypot(re, im) >= 1 ? 'bad' : 'ink');
    cross(c, toX(re), toY(im), 4);
  }
  const said = poles.slice(0, 32).map(({re, im}) =>
    `${fixed(re, 4)} ${im >= 0 ? 'plus' : 'minus'} ${fixed(Math.abs(im), 4)} i`);
  canvas.setAttribute('aria-label', `Sampled poles: ${said.join(', ')}`);
}
