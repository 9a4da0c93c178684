// The map of eigenvalues with bounds, rays and trails; the sampled poles beside the unit circle.
import {begin, colour, line, mark, modeColour, number, say, slotOf, tickText} from '/draw.js';

const kTrail = 5;  // s

export class PoleMap {
  constructor(canvas) {
    this.canvas = canvas;
    this.trails = [];  // {t, poles}
    this.span = [1, 10];
  }
  forget() { this.trails = []; }
  note(t, poles) {
    const last = this.trails.length ? this.trails[this.trails.length - 1].t : -Infinity;
    if (t < last || t > last + kTrail) this.forget();  // a leap, or back in time
    if (t !== last) this.trails.push({t, poles});
    while (this.trails[0].t < t - kTrail) this.trails.shift();
  }

  /// Where the poles stand on the canvas: [{label, re, im, x, y}].
  draw(poles, identified, wanted, chosen) {
    const {c, w, h} = begin(this.canvas);
    const sizes = [...poles, ...identified].map((p) => Math.hypot(p.re, p.im)).filter((r) => r > 1e-6 && Number.isFinite(r));
    if (!sizes.length) {
      say(c, w, h, 'no modes');
      return [];
    }
    const most = 10 ** (Math.ceil(Math.log10(Math.max(...sizes)) * 4 + 0.4) / 4);
    const least = Math.min(10 ** Math.floor(Math.log10(Math.min(...sizes))), most / 10);
    const unstable = poles.some((p) => p.re > 0);
    const x0 = unstable ? w * 0.6 : w - 34, y0 = h - 22;  // the lower half is the mirror image
    this.origin = [x0, y0];
    const R = Math.min(x0 - 30, y0 - 22);
    const from = Math.max(least / 2, most * 1e-6);
    const radius = (r) => R * Math.log1p(r / from) / Math.log1p(most / from);
    const place = (re, im) => {
      const r = Math.hypot(re, im), k = r > 0 ? radius(r) / r : 0;
      return [x0 + k * re, y0 - k * im];
    };
    this.grid(c, w, h, x0, y0, R, radius, least, most, wanted);
    c.save();
    c.beginPath();
    c.rect(0, 0, w, y0 + 8);
    c.clip();
    this.paths(c, place);
    for (const p of identified) {
      const [x, y] = place(p.re, p.im);
      c.strokeStyle = colour('ink');
      c.lineWidth = 1.5;
      line(c, x - 6, y - 6, x + 6, y + 6);
      line(c, x - 6, y + 6, x + 6, y - 6);
    }
    const drawn = poles.map((p) => {
      const [x, y] = place(p.re, p.im);
      const r = Math.hypot(p.re, p.im);
      c.strokeStyle = c.fillStyle = modeColour(p.label);
      if (p.bound !== null && r > 0) {
        c.globalAlpha = 0.25;  // the proved disc; mostly smaller than a pixel
        c.beginPath();
        c.arc(x, y, Math.min(Math.abs(radius(r + p.bound) - radius(r)), 2 * R), 0, 2 * Math.PI);
        c.fill();
        c.globalAlpha = 1;
      }
      mark(c, slotOf(p.label), x, y, p.label === chosen ? 6 : 4.5);
      c.lineWidth = 1.5;
      if (p.bound === null) c.stroke();  // open: nothing is proved
      else c.fill();
      if (p.label === chosen) {
        c.beginPath();
        c.arc(x, y, 10, 0, 2 * Math.PI);
        c.strokeStyle = colour('ink');
        c.stroke();
      }
      return {...p, x, y};
    });
    c.restore();
    return drawn;
  }

  grid(c, w, h, x0, y0, R, radius, least, most, wanted) {
    c.fillStyle = colour('soft');
    c.strokeStyle = colour('grid');
    for (let d = least; d <= most * 1.001; d *= 10) {
      for (const m of [1, 2, 5]) {
        if (m * d > most * 1.001) break;
        c.beginPath();
        c.arc(x0, y0, radius(m * d), Math.PI, 2 * Math.PI);
        c.stroke();
        c.textAlign = 'left';
        if (radius(m * d) > 16 && (m === 1 || R > 260)) c.fillText(tickText(m * d), x0 + 4, y0 - radius(m * d) + 4);
      }
    }
    for (const ratio of [0.1, 0.3, 0.5, 0.7, 0.9]) {
      const a = Math.acos(ratio);
      line(c, x0, y0, x0 - R * ratio, y0 - R * Math.sin(a));
      c.textAlign = 'right';
      c.fillText(ratio, x0 - R * ratio - 4, y0 - R * Math.sin(a) - 2);
    }
    if (wanted > 0 && wanted <= 1) {
      c.strokeStyle = colour('accent');
      c.setLineDash([5, 4]);
      const a = Math.acos(wanted);
      line(c, x0, y0, x0 - R * wanted, y0 - R * Math.sin(a));
      c.setLineDash([]);
    }
    c.strokeStyle = colour('soft');
    line(c, 4, y0, w - 4, y0);
    line(c, x0, 4, x0, y0 + 6);
    c.textAlign = 'left';
    c.fillText('Im', x0 + 4, 12);
    c.fillText('Re', 4, y0 + 14);
  }

  paths(c, place) {
    const ways = new Map();
    for (const {poles} of this.trails) {
      for (const p of poles) {
        const key = `${p.label}/${p.which}`;
        if (!ways.has(key)) ways.set(key, []);
        ways.get(key).push(place(p.re, p.im));
      }
    }
    c.lineWidth = 2;
    for (const [key, way] of ways) {
      c.strokeStyle = modeColour(Number(key.split('/')[0]));
      c.globalAlpha = 0.45;
      c.beginPath();
      way.forEach((p, i) => c[i ? 'lineTo' : 'moveTo'](p[0], p[1]));
      c.stroke();
    }
    c.globalAlpha = 1;
  }
}

/// Sampled poles z = exp(l T), as close to z = 1 as they are.
export function sampledPoles(sampled, period) {
  if (!sampled || !(period > 0)) return [];
  const all = [];
  sampled.natural_frequency.forEach((w, i) => {
    const ratio = sampled.damping_ratio[i];
    if (w === null || ratio === null) return;
    const split = ratio > 1 ? w * Math.sqrt(ratio * ratio - 1) : 0;
    for (const s of [1, -1]) {
      const re = -ratio * w + s * split, im = ratio > 1 ? 0 : s * sampled.damped_frequency[i];
      const size = Math.exp(re * period);
      all.push({re: size * Math.cos(im * period), im: size * Math.sin(im * period)});
    }
  });
  return all;
}

export function drawCircle(canvas, poles) {
  const {c, w, h} = begin(canvas);
  if (!poles.length) {
    say(c, w, h, 'no sampled poles');
    return;
  }
  const width = Math.max(...poles.map((z) => Math.abs(1 - z.re)), 1e-9);
  const height = Math.max(...poles.map((z) => Math.abs(z.im)), width * 0.1);
  const k = Math.min((w - 60) / width, (h - 30) / 2 / height);
  const x0 = w - 34, y0 = h / 2;
  c.fillStyle = colour('grid');
  c.beginPath();  // the unit circle, however large it is at this scale
  for (let i = -64; i <= 64; ++i) {
    const top = Math.min(Math.PI, 1.3 * (h / 2) / k), a = i / 64 * top;
    c[i > -64 ? 'lineTo' : 'moveTo'](x0 - k * (1 - Math.cos(a)), y0 - k * Math.sin(a));
  }
  c.lineTo(-4, -40);
  c.lineTo(-4, h + 40);
  c.closePath();
  c.save();
  c.globalAlpha = 0.6;
  c.fill();
  c.restore();
  c.strokeStyle = colour('accent');
  c.lineWidth = 1.5;
  c.stroke();
  c.strokeStyle = colour('soft');
  c.lineWidth = 1;
  line(c, 4, y0, w - 4, y0);
  for (const z of poles) {
    const out = Math.hypot(z.re, z.im) >= 1;
    c.strokeStyle = colour(out ? 'bad' : 'ink');
    c.lineWidth = 1.8;
    const x = x0 - k * (1 - z.re), y = y0 - k * z.im;
    line(c, x - 4, y - 4, x + 4, y + 4);
    line(c, x - 4, y + 4, x + 4, y - 4);
  }
  c.fillStyle = colour('soft');
  c.textAlign = 'right';
  c.fillText('z = 1', w - 2, y0 + 14);
  c.textAlign = 'left';
  c.fillText(`${number((w - 60) / k, 2)} wide`, 6, h - 6);
}
