// The map of eigenvalues with bounds, rays of equal damping ratio and trails.
import {begin, circle, cross, line, say, showHint, trace} from './canvas.js';
import {listenToGestures} from './gestures.js';
import {drawMark, modeColour} from './mode_marks.js';
import {number, tickText} from './numbers.js';
import {colour} from './theme.js';

const kTrail = 5;  // s
const kRays = [0.1, 0.3, 0.5, 0.7, 0.9];

/// Eigenvalues with an imaginary part of 0 or above, at logarithmic distances from 0, which leave the rays of equal
/// ratio straight.
///
/// `changed` is called when the map has to be drawn again because of the pointer, `choose` with the label of a pole
/// that is clicked. The wheel, after a click or with Ctrl, + and - zoom, dragging moves; a double click or 0 shows all.
export class PoleMap {
  constructor(canvas, changed = () => {}, choose = () => {}) {
    Object.assign(this, {canvas, trails: [], drawn: [], zoom: 1, shift: [0, 0], base: [0, 0], pointer: null});
    listenToGestures(canvas, changed, {
      hover: (place) => { this.pointer = place; },
      drag: (dx, dy) => { if (this.zoom > 1) this.shift = [this.shift[0] + dx, this.shift[1] + dy]; },
      click: (place) => {
        const pole = this.nearest(place);
        if (pole) choose(pole.label);
      },
      leave: () => {
        this.pointer = null;
        showHint(canvas, 0, 0, null);
      },
      zoom: (factor, place) => this.enlarge(factor, place),
      all: () => this.enlarge(0),
    });
  }
  enlarge(factor, at = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2]) {
    const zoom = Math.min(30, Math.max(1, this.zoom * factor)), k = zoom / this.zoom;
    const from = at.map((x, i) => x - this.base[i]);
    this.shift = zoom === 1 ? [0, 0] : this.shift.map((s, i) => from[i] - k * (from[i] - s));
    this.zoom = zoom;
  }
  nearest([x, y]) {
    const upper = this.drawn.filter((p) => p.y <= this.origin[1] + 8);
    const near = upper.map((pole) => ({pole, distance: Math.hypot(pole.x - x, pole.y - y)}));
    return near.filter(({distance}) => distance < 18).sort((a, b) => a.distance - b.distance)[0]?.pole;
  }
  forget() { this.trails = []; }
  /// Keeps poles for the trail.
  note(t, poles) {
    const last = this.trails.at(-1)?.t ?? -Infinity;
    if (t < last || t > last + kTrail) this.forget();  // a leap, or back in time
    if (t > last + 0.09 || t < last) this.trails.push({t, poles});
    while (this.trails.length && this.trails[0].t < t - kTrail) this.trails.shift();
  }

  /// `poles` are {label, which, re, im, bound}, `which` of a mode's two, `bound` null if nothing is proved; `crosses`
  /// are {re, im}; `wanted` is a damping ratio or 0. Returns the poles with the place x, y of each on the canvas.
  draw(poles, crosses = [], wanted = 0, chosen = null) {
    const {c, w, h} = begin(this.canvas);
    const sizes = [...poles, ...crosses].map((p) => Math.hypot(p.re, p.im)).filter((r) => r > 1e-6 && r < Infinity);
    this.drawn = [];
    if (!sizes.length) {
      say(c, w, h, 'no modes');
      return this.drawn;
    }
    const scale = this.scale(w, h, sizes, poles.some((p) => p.re > 0)), {y0, place, radius, R} = scale;
    const clip = (height) => {
      c.beginPath();
      c.rect(0, 0, w, height);
      c.clip();
    };
    c.save();
    clip(h - 18);
    this.grid(c, w, scale, wanted);
    clip(y0 + 8);  // the lower half is the mirror image
    this.paths(c, place);
    c.strokeStyle = colour('ink');
    c.lineWidth = 1.5;
    for (const {re, im} of crosses) cross(c, ...place(re, im), 6);
    this.drawn = poles.map((pole) => {
      const {label, re, im, bound} = pole, [x, y] = place(re, im), r = Math.hypot(re, im), open = bound === null;
      c.fillStyle = modeColour(label);
      if (!open && r > 0) {
        c.globalAlpha = 0.25;  // the proved disc; mostly smaller than a pixel
        circle(c, x, y, Math.min(Math.abs(radius(r + bound) - radius(r)), 2 * R));
        c.fill();
        c.globalAlpha = 1;
      }
      drawMark(c, label, x, y, label === chosen ? 6.5 : 5, open);
      if (label === chosen) {
        circle(c, x, y, 10);
        c.stroke();
      }
      return {...pole, x, y};
    });
    c.restore();
    if (this.pointer) this.tell(this.nearest(this.pointer));
    const said = poles.filter((p) => p.im >= 0).slice(0, 40).map(({label, re, im}) =>
      `mode ${label} at ${number(re, 3)}${im ? ` plus or minus ${number(im, 3)} i` : ''}`);
    this.canvas.setAttribute('aria-label', `Eigenvalues in 1/s: ${said.join(', ')}`);
    return this.drawn;
  }

  /// Says beside the pointer which pole is there.
  tell(pole) {
    const {label, re, im} = pole || {}, size = Math.hypot(re, im);
    showHint(this.canvas, ...this.pointer, pole && [{label, text: `mode ${label}`},
      {text: `${number(re)} ± ${number(Math.abs(im))}i 1/s`},
      {text: `${number(size)} rad/s, cosine ${number(-re / size, 3)}`}]);
  }

  /// How eigenvalues of such sizes take their places: 0 is at x0, y0, a distance r is radius(r) px, up to R for `most`.
  scale(w, h, sizes, unstable) {
    const most = 10 ** (Math.ceil(Math.log10(Math.max(...sizes)) * 4 + 0.4) / 4);
    const least = Math.min(10 ** Math.floor(Math.log10(Math.min(...sizes))), most / 10);
    const [bx, by] = this.base = [unstable ? w * 0.6 : w - 40, h - 36];  // without zoom and shift
    const [x0, y0] = this.origin = [bx + this.shift[0], by + this.shift[1]];
    const R = Math.max(1, Math.min(bx - 30, by - 22)) * this.zoom, from = Math.max(least / 2, most * 1e-6);
    const radius = (r) => R * Math.log1p(r / from) / Math.log1p(most / from);
    const place = (re, im) => {
      const r = Math.hypot(re, im), k = r > 0 ? radius(r) / r : 0;
      return [x0 + k * re, y0 - k * im];
    };
    return {x0, y0, R, radius, place, least, most, unstable};
  }

  grid(c, w, {x0, y0, R, radius, least, most, unstable}, wanted) {
    c.fillStyle = colour('soft');
    c.strokeStyle = colour('grid');
    let last = 0;
    for (let d = least; d <= most * 1.001; d *= 10) {
      for (const size of [d, 2 * d, 5 * d].filter((x) => x <= most * 1.001)) {
        const r = radius(size), text = tickText(size);
        c.beginPath();
        c.arc(x0, y0, r, Math.PI, 2 * Math.PI);
        c.stroke();
        if (r <= 16 || Math.abs(r - last) <= 34) continue;
        last = r;
        c.textAlign = 'left';
        c.fillText(text, x0 + 4, y0 - r + 4);
        c.textAlign = 'center';
        c.fillText(`−${text}`, x0 - r, y0 + 16);
        if (unstable) c.fillText(text, x0 + r, y0 + 16);
      }
    }
    const ray = (ratio, sine = Math.sqrt(1 - ratio * ratio)) => {
      line(c, x0, y0, x0 - R * ratio, y0 - R * sine);
      return sine;
    };
    c.textAlign = 'right';
    for (const ratio of kRays) {  // named at its end, or where it leaves the canvas
      const sine = ray(ratio), end = Math.min(R, (x0 - 30) / ratio, (y0 - 16) / sine);
      if (end > 20) c.fillText(ratio, x0 - end * ratio - 4, y0 - end * sine - 2);
    }
    if (wanted > 0 && wanted <= 1) {
      c.strokeStyle = colour('accent');
      c.setLineDash([5, 4]);
      ray(wanted);
      c.setLineDash([]);
    }
    c.strokeStyle = colour('soft');
    line(c, 4, y0, w - 4, y0);
    line(c, x0, 4, x0, y0 + 6);
    c.textAlign = 'left';
    c.fillText('Im', x0 + 4, 12);
    c.fillText('Re', 4, y0 - 4);
  }

  /// Where each pole was in the last seconds.
  paths(c, place) {
    const ways = new Map();
    for (const {label, which, re, im} of this.trails.flatMap(({poles}) => poles)) {
      const key = `${label}/${which}`;
      if (!ways.has(key)) ways.set(key, {label, way: []});
      ways.get(key).way.push(place(re, im));
    }
    c.lineWidth = 2;
    c.globalAlpha = 0.45;
    for (const {label, way} of ways.values()) {
      c.strokeStyle = modeColour(label);
      trace(c, way);
      c.stroke();
    }
    c.globalAlpha = 1;
  }
}
