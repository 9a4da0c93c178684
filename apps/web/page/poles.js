// The map of eigenvalues with bounds, rays and trails; the sampled poles beside the unit circle.
import {begin, colour, line, mark, modeColour, number, say, showHint, tickText, ticks} from '/draw.js';

const kTrail = 5;  // s

/// Eigenvalues with an imaginary part of 0 or above, at logarithmic distances from 0, which leave
/// the rays of equal ratio straight.
///
/// `changed` is called when the map has to be drawn again because of the pointer, `choose` with the
/// label of a pole that is clicked. The wheel, after a click or with Ctrl, + and - zoom, dragging
/// moves; a double click or 0 shows all again.
export class PoleMap {
  constructor(canvas, changed = () => {}, choose = () => {}) {
    Object.assign(this, {canvas, changed, choose, trails: [], drawn: [], zoom: 1, shift: [0, 0], pointer: null});
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    const place = (e) => {
      const box = canvas.getBoundingClientRect();
      return [e.clientX - box.left, e.clientY - box.top];
    };
    let drag = null, moved = 0;
    canvas.addEventListener('pointerdown', (e) => {
      drag = place(e);
      moved = 0;
    });
    canvas.addEventListener('pointermove', (e) => {
      const [x, y] = this.pointer = place(e);
      if (drag && e.buttons & 1 && this.zoom > 1) {
        moved += Math.hypot(x - drag[0], y - drag[1]);
        this.shift = [this.shift[0] + x - drag[0], this.shift[1] + y - drag[1]];
        drag = [x, y];
      }
      this.changed();
    });
    canvas.addEventListener('pointerup', (e) => {
      drag = null;
      const pole = moved < 4 && this.nearest(place(e));
      if (pole && pole.label !== undefined) this.choose(pole.label);
    });
    canvas.addEventListener('pointerleave', () => {
      this.pointer = drag = null;
      showHint(canvas, 0, 0, null);
      this.changed();
    });
    canvas.addEventListener('wheel', (e) => {
      if (document.activeElement !== canvas && !e.ctrlKey) return;  // the page scrolls
      e.preventDefault();
      this.enlarge(Math.exp(-e.deltaY * 0.002), place(e));
    }, {passive: false});
    canvas.addEventListener('dblclick', () => this.enlarge(0));
    canvas.addEventListener('keydown', (e) => {
      if (e.key === '+' || e.key === '=') this.enlarge(1.25);
      else if (e.key === '-') this.enlarge(0.8);
      else if (e.key === '0') this.enlarge(0);
      else return;
      e.preventDefault();
    });
  }
  enlarge(factor, at = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2]) {
    const zoom = Math.min(30, Math.max(1, this.zoom * factor)), k = zoom / this.zoom;
    const base = this.base || [0, 0];  // where 0 is without zoom and shift
    this.shift = zoom === 1 ? [0, 0] : this.shift.map((s, i) => at[i] - base[i] - k * (at[i] - base[i] - s));
    this.zoom = zoom;
    this.changed();
  }
  nearest([x, y]) {
    const near = (p) => Math.hypot(p.x - x, p.y - y);
    const best = this.drawn.filter((p) => p.y <= this.origin[1] + 8).reduce((a, b) => (a && near(a) <= near(b) ? a : b), null);
    return best && near(best) < 18 ? best : null;
  }
  forget() { this.trails = []; }
  /// Keeps poles for the trail.
  note(t, poles) {
    const last = this.trails.length ? this.trails[this.trails.length - 1].t : -Infinity;
    if (t < last || t > last + kTrail) this.forget();  // a leap, or back in time
    if (t > last + 0.09 || t < last) this.trails.push({t, poles});
    while (this.trails.length && this.trails[0].t < t - kTrail) this.trails.shift();
  }

  /// `poles` are {label, which, re, im, bound}, `which` of a mode's two, `bound` null if nothing is
  /// proved; `crosses` are {re, im}; `wanted` is a damping ratio or 0. Returns the poles with the
  /// place x, y of each on the canvas.
  draw(poles, crosses = [], wanted = 0, chosen = null) {
    const {c, w, h} = begin(this.canvas);
    const sizes = [...poles, ...crosses].map((p) => Math.hypot(p.re, p.im)).filter((r) => r > 1e-6 && Number.isFinite(r));
    this.drawn = [];
    if (!sizes.length) {
      say(c, w, h, 'no modes');
      return this.drawn;
    }
    const most = 10 ** (Math.ceil(Math.log10(Math.max(...sizes)) * 4 + 0.4) / 4);
    const least = Math.min(10 ** Math.floor(Math.log10(Math.min(...sizes))), most / 10);
    const unstable = poles.some((p) => p.re > 0);
    const bx = unstable ? w * 0.6 : w - 40, by = h - 36;  // the lower half is the mirror image
    this.base = [bx, by];
    const [x0, y0] = this.origin = [bx + this.shift[0], by + this.shift[1]];
    const R = Math.max(1, Math.min(bx - 30, by - 22)) * this.zoom;
    const from = Math.max(least / 2, most * 1e-6);
    const radius = (r) => R * Math.log1p(r / from) / Math.log1p(most / from);
    const place = (re, im) => {
      const r = Math.hypot(re, im), k = r > 0 ? radius(r) / r : 0;
      return [x0 + k * re, y0 - k * im];
    };
    c.save();
    c.beginPath();
    c.rect(0, 0, w, h - 18);
    c.clip();
    this.grid(c, w, h, x0, y0, R, radius, least, most, wanted, unstable);
    c.beginPath();
    c.rect(0, 0, w, y0 + 8);
    c.clip();
    this.paths(c, place);
    for (const p of crosses) {
      const [x, y] = place(p.re, p.im);
      c.strokeStyle = colour('ink');
      c.lineWidth = 1.5;
      line(c, x - 6, y - 6, x + 6, y + 6);
      line(c, x - 6, y + 6, x + 6, y - 6);
    }
    this.drawn = poles.map((p) => {
      const [x, y] = place(p.re, p.im);
      const r = Math.hypot(p.re, p.im);
      c.fillStyle = modeColour(p.label);
      if (p.bound !== null && r > 0) {
        c.globalAlpha = 0.25;  // the proved disc; mostly smaller than a pixel
        c.beginPath();
        c.arc(x, y, Math.min(Math.abs(radius(r + p.bound) - radius(r)), 2 * R), 0, 2 * Math.PI);
        c.fill();
        c.globalAlpha = 1;
      }
      mark(c, p.label, x, y, p.label === chosen ? 6.5 : 5, p.bound === null);  // open: nothing is proved
      if (p.label === chosen) {
        c.beginPath();
        c.arc(x, y, 10, 0, 2 * Math.PI);
        c.strokeStyle = colour('ink');
        c.lineWidth = 1.5;
        c.stroke();
      }
      return {...p, x, y};
    });
    c.restore();
    if (this.pointer) {
      const pole = this.nearest(this.pointer);
      showHint(this.canvas, ...this.pointer, pole && [{label: pole.label, text: `mode ${pole.label}`},
        {text: `${number(pole.re)} ± ${number(Math.abs(pole.im))}i 1/s`},
        {text: `${number(Math.hypot(pole.re, pole.im))} rad/s, cosine ${number(-pole.re / Math.hypot(pole.re, pole.im), 3)}`}]);
    }
    this.canvas.setAttribute('aria-label', `Eigenvalues in 1/s: ${poles.filter((p) => p.im >= 0).slice(0, 40)
      .map((p) => `mode ${p.label} at ${number(p.re, 3)}${p.im ? ` plus or minus ${number(p.im, 3)} i` : ''}`).join(', ')}`);
    return this.drawn;
  }

  grid(c, w, h, x0, y0, R, radius, least, most, wanted, unstable) {
    c.fillStyle = colour('soft');
    c.strokeStyle = colour('grid');
    const room = (r, last) => Math.abs(r - last) > 34 && r > 16;
    let last = 0;
    for (let d = least; d <= most * 1.001; d *= 10) {
      for (const m of [1, 2, 5]) {
        if (m * d > most * 1.001) break;
        const r = radius(m * d);
        c.beginPath();
        c.arc(x0, y0, r, Math.PI, 2 * Math.PI);
        c.stroke();
        if (!room(r, last)) continue;
        last = r;
        c.textAlign = 'left';
        c.fillText(tickText(m * d), x0 + 4, y0 - r + 4);
        c.textAlign = 'center';
        c.fillText(`−${tickText(m * d)}`, x0 - r, y0 + 16);
        if (unstable) c.fillText(tickText(m * d), x0 + r, y0 + 16);
      }
    }
    const ray = (ratio, text) => {  // named at its end, or where it leaves the canvas
      const s = Math.sqrt(1 - ratio * ratio);
      const end = Math.min(R, ratio > 0 ? (x0 - 30) / ratio : R, s > 0 ? (y0 - 16) / s : R);
      line(c, x0, y0, x0 - R * ratio, y0 - R * s);
      c.textAlign = 'right';
      if (end > 20) c.fillText(text, x0 - end * ratio - 4, y0 - end * s - 2);
    };
    for (const ratio of [0.1, 0.3, 0.5, 0.7, 0.9]) ray(ratio, ratio);
    if (wanted > 0 && wanted <= 1) {
      c.strokeStyle = colour('accent');
      c.setLineDash([5, 4]);
      line(c, x0, y0, x0 - R * wanted, y0 - R * Math.sqrt(1 - wanted * wanted));
      c.setLineDash([]);
    }
    c.strokeStyle = colour('soft');
    line(c, 4, y0, w - 4, y0);
    line(c, x0, 4, x0, y0 + 6);
    c.textAlign = 'left';
    c.fillText('Im', x0 + 4, 12);
    c.fillText('Re', 4, y0 - 4);
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

/// The z plane around z = 1, with the unit circle; `poles` are {re, im}.
export function drawCircle(canvas, poles) {
  const {c, w, h} = begin(canvas);
  if (!poles.length) {
    say(c, w, h, 'no sampled poles');
    return;
  }
  const width = Math.max(...poles.map((z) => Math.abs(1 - z.re)), 1e-9);
  const height = Math.max(...poles.map((z) => Math.abs(z.im)), width * 0.1);
  const bottom = h - 18;
  const k = Math.min((w - 74) / width, (bottom - 24) / 2 / height);
  const x0 = w - 20, y0 = bottom / 2;
  const toX = (re) => x0 - k * (1 - re), toY = (im) => y0 - k * im;
  c.save();
  c.beginPath();
  c.rect(38, 0, w, bottom);
  c.clip();
  c.fillStyle = colour('grid');
  c.beginPath();  // the unit circle, however large it is at this scale
  for (let i = -64; i <= 64; ++i) {
    const top = Math.min(Math.PI, 1.3 * (h / 2) / k), a = i / 64 * top;
    c[i > -64 ? 'lineTo' : 'moveTo'](x0 - k * (1 - Math.cos(a)), y0 - k * Math.sin(a));
  }
  c.lineTo(-4, -40);
  c.lineTo(-4, h + 40);
  c.closePath();
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
  line(c, 38, 0, 38, bottom);
  line(c, 38, bottom, w, bottom);
  c.textAlign = 'center';
  // Numbers of the axis: how far left of z = 1, because what differs lies in its last digits.
  for (const v of ticks(0, (x0 - 44) / k, (w - 40) / 70)) {
    line(c, toX(1 - v), bottom, toX(1 - v), bottom + 3);
    const text = v ? `1−${tickText(v)}` : '1';
    c.fillText(text, Math.min(toX(1 - v), w - c.measureText(text).width / 2 - 1), h - 4);
  }
  c.textAlign = 'right';
  for (const v of ticks(-(bottom / 2 - 6) / k, (bottom / 2 - 6) / k, bottom / 30)) {
    line(c, 35, toY(v), 38, toY(v));
    c.fillText(tickText(v), 33, toY(v) + 4, 32);
  }
  for (const z of poles) {
    const out = Math.hypot(z.re, z.im) >= 1;
    c.strokeStyle = colour(out ? 'bad' : 'ink');
    c.lineWidth = 1.8;
    const x = toX(z.re), y = toY(z.im);
    line(c, x - 4, y - 4, x + 4, y + 4);
    line(c, x - 4, y + 4, x + 4, y - 4);
  }
  canvas.setAttribute('aria-label', `Sampled poles: ${poles.slice(0, 32).map((z) => `${z.re.toFixed(4)} ${z.im >= 0 ? 'plus' : 'minus'} ${Math.abs(z.im).toFixed(4)} i`).join(', ')}`);
}
