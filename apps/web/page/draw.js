// What all drawings share: canvases in device pixels, colours of the theme, ticks and numbers.

// Okabe and Ito's palette, which people with any kind of colour vision can tell apart, in an order
// that suits the ground. Marks differ as well.
const kPalette = {
  light: ['#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#000000'],
  dark: ['#56b4e9', '#e69f00', '#009e73', '#cc79a7', '#f0e442', '#d55e00', '#ffffff'],
};
export const theme = () => document.documentElement.dataset.theme;
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

const slots = new Map();  // label -> place in the palette, in order of appearance
export function slotOf(label) {
  if (!slots.has(label)) slots.set(label, slots.size);
  return slots.get(label);
}
export const modeColour = (label) => typeof label === 'string' ? colour('ink') : kPalette[theme()][slotOf(label) % 7];
const kDashes = [[], [7, 4], [2, 3], [9, 3, 2, 3]];
export const modeDash = (label) => kDashes[Math.floor(slotOf(label) / 7) % 4];

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

export function line(c, x0, y0, x1, y1) {
  c.beginPath();
  c.moveTo(x0, y0);
  c.lineTo(x1, y1);
  c.stroke();
}

/// A mark that tells modes apart without colour.
export function mark(c, slot, x, y, r) {
  c.beginPath();
  if (slot % 4 === 0) {
    c.arc(x, y, r, 0, 2 * Math.PI);
  } else if (slot % 4 === 1) {
    c.rect(x - r * .85, y - r * .85, r * 1.7, r * 1.7);
  } else {
    const n = slot % 4 === 2 ? 3 : 4;
    for (let i = 0; i < n; ++i) {
      const a = -Math.PI / 2 + i * 2 * Math.PI / n;
      c[i ? 'lineTo' : 'moveTo'](x + 1.25 * r * Math.cos(a), y + 1.25 * r * Math.sin(a));
    }
    c.closePath();
  }
}

export function number(x, digits = 4) {
  if (x === null || x === undefined || Number.isNaN(x)) return '–';
  if (!Number.isFinite(x)) return x > 0 ? '∞' : '−∞';
  const size = Math.abs(x);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return x.toExponential(1).replace('-', '−');
  return x.toPrecision(digits).replace(/e.*/, '').replace('-', '−');
}

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
export const tickText = (x) => String(+x.toPrecision(3)).replace('-', '−');

/// Text in the middle of a drawing that has nothing to show.
export function say(c, w, h, text) {
  c.fillStyle = colour('soft');
  c.textAlign = 'center';
  c.fillText(text, w / 2, h / 2);
}
