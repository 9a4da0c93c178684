// What all drawings share: canvases in device pixels, colours and marks, scales, numbers, hints.

// Theme: style.css has the colours of both.
let known = new Map();  // name -> colour, because asking the style sheet takes long
export const theme = () => document.documentElement.dataset.theme;
export const colour = (name) => {
  if (!known.has(name)) known.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return known.get(name);
};
/// Sets the theme that the address or the browser asks for, and lets a button switch it.
export function followTheme(button, changed) {
  const dark = matchMedia('(prefers-color-scheme: dark)');
  const set = (name) => {
    document.documentElement.dataset.theme = name;
    known = new Map();
    changed();
  };
  const asked = new URLSearchParams(location.search).get('theme');
  set(asked === 'dark' || asked === 'light' ? asked : dark.matches ? 'dark' : 'light');
  dark.addEventListener('change', () => set(dark.matches ? 'dark' : 'light'));
  button.addEventListener('click', () => set(theme() === 'dark' ? 'light' : 'dark'));
}
const still = matchMedia('(prefers-reduced-motion: reduce)');
export const reducedMotion = () => still.matches;

/// Returns a function that asks for `draw` after so many ms, which then runs once, at most `rate`
/// times a second.
export function redrawer(draw, rate) {
  let timer = 0, due = Infinity, last = -Infinity;
  const run = () => requestAnimationFrame((now) => {
    due = Infinity;
    last = now;
    draw(now);
  });
  return (wait = 0) => {
    const now = performance.now(), at = Math.max(now + wait, last + 1000 / rate);
    if (at >= due) return;
    clearTimeout(timer);
    due = at;
    timer = setTimeout(run, at - now);
  };
}

// Modes: colour, mark and dash follow from the label alone. Seven colours, which people with any
// kind of colour vision can tell apart (Okabe and Ito, and ink), and six marks: 42 labels in a row
// look different. The program numbers modes on by 32 when it has to begin again, and then the first
// one looks like the first one. A label that is text, such as a zero mode's, has the colour of ink.
const kMarks = ['M1 0A1 1 0 1 1-1 0A1 1 0 1 1 1 0Z', 'M-.87-.87H.87V.87H-.87Z', 'M0-1.2L1.1.75H-1.1Z',
  'M0-1.25L1.05 0 0 1.25-1.05 0Z', 'M0 1.2L-1.1-.75H1.1Z', 'M-.42-1.15H.42V-.42H1.15V.42H.42V1.15H-.42V.42H-1.15V-.42H-.42Z'];
const kDashes = [[], [8, 4], [2, 3], [10, 3, 2, 3]];
const place = (label) => (typeof label === 'number' ? Math.max(0, label - 1) % 32 : 0);
const colourName = (label) => (typeof label === 'number' ? `mode-${place(label) % 7}` : 'ink');
const paths = kMarks.map((d) => new Path2D(d));
export const modeColour = (label) => colour(colourName(label));
export const modeDash = (label) => kDashes[place(label) % 4];

/// Paints the mark of a mode in its colour; `open` leaves it empty.
export function mark(c, label, x, y, r, open = false) {
  const path = paths[place(label) % 6];
  c.save();
  c.translate(x, y);
  c.scale(r, r);
  c.setLineDash([]);
  c.fillStyle = c.strokeStyle = modeColour(label);
  c.lineWidth = 1.6 / r;
  if (open) c.stroke(path);
  else c.fill(path);
  c.restore();
}

/// Returns the mark of a mode as an element of the page, with its dash if it is for curves.
export function markElement(label, dashed = false) {
  const xml = 'http://www.w3.org/2000/svg', svg = document.createElementNS(xml, 'svg');
  svg.setAttribute('class', 'mark');
  svg.setAttribute('aria-hidden', 'true');
  svg.setAttribute('viewBox', dashed ? '-3 -1.4 6 2.8' : '-1.4 -1.4 2.8 2.8');
  svg.style.color = `var(--${colourName(label)})`;
  const add = (name, attributes) => {
    const part = document.createElementNS(xml, name);
    for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, value);
    svg.append(part);
  };
  if (dashed) {
    svg.classList.add('wide');
    add('path', {d: 'M-3 0H3', stroke: 'currentColor', 'stroke-width': .3, 'stroke-dasharray': modeDash(label).map((x) => x / 8).join(' ')});
  }
  add('path', {d: kMarks[place(label) % 6], fill: 'currentColor'});
  return svg;
}

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

/// Text in the middle of a drawing that has nothing to show.
export function say(c, w, h, text) {
  c.fillStyle = colour('soft');
  c.textAlign = 'center';
  text.split('\n').forEach((row, i, all) => c.fillText(row, w / 2, h / 2 + 16 * (i - (all.length - 1) / 2), w - 8));
}

// Numbers
export function number(x, digits = 4) {
  if (x === null || x === undefined || Number.isNaN(x)) return '–';
  if (!Number.isFinite(x)) return x > 0 ? '∞' : '−∞';
  const size = Math.abs(x);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return x.toExponential(1).replace('-', '−');
  if (size >= 10 ** digits) return String(Math.round(x)).replace('-', '−');
  return x.toPrecision(digits).replace('-', '−');
}
/// With so many decimals, and no sign before a zero.
export function fixed(x, decimals) {
  if (x === null || !Number.isFinite(x)) return number(x);
  return (+x.toFixed(decimals) + 0).toFixed(decimals).replace('-', '−');
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
/// Ticks of a logarithmic axis from a to b, both positive: decades, or 1 and 3, or 1, 2 and 5 of
/// each; round numbers where less than that fits in between.
export function logTicks(a, b, count) {
  const all = [], decades = Math.log10(b / a);
  if (!(decades > 0) || !Number.isFinite(decades)) return [a];
  const factors = [[1, 2, 5], [1, 3], [1]].find((f) => decades * f.length <= 1.5 * count) || [1], every = Math.ceil(decades / Math.max(count, 1));
  for (let e = Math.floor(Math.log10(a)); e <= Math.log10(b); ++e) {
    if (e % every) continue;
    for (const f of factors) if (f * 10 ** e >= a * .9999 && f * 10 ** e <= b * 1.0001) all.push(f * 10 ** e);
  }
  if (all.length >= 3 || decades > 1.5) return all;
  const even = ticks(a, b, count);
  return even.length >= 3 ? even : ticks(a, b, 2 * count + 2);
}
const superscript = (n) => String(n).replace('-', '⁻').replace(/\d/g, (d) => '⁰¹²³⁴⁵⁶⁷⁸⁹'[d]);
export const tickText = (x) => {
  const size = Math.abs(x);
  if (size > 0 && (size < 1e-3 || size >= 1e5)) {
    const [digits, power] = x.toExponential(0).split('e');
    return `${digits === '1' ? '' : `${digits}·`}10${superscript(Number(power))}`.replace('-', '−');
  }
  return String(+x.toPrecision(4)).replace('-', '−');
};

/// Returns a mode's shape as the terminal writes it, "q2 - 0.43 q5 + 0.21 q1 (95 deg)": entries
/// relative to the largest, by falling size, with the phase where one is not in step with it.
export function shapeText(re, im, terms = 4) {
  const size = re.map((x, i) => Math.hypot(x, im[i]));
  if (!size.every(Number.isFinite)) return '–';
  const order = size.map((_, i) => i).sort((i, j) => Math.fround(size[j]) - Math.fround(size[i]) || i - j);
  const [a, b] = [re[order[0]], im[order[0]]], square = a * a + b * b;
  let text = `q${order[0] + 1}`;
  for (const [k, i] of order.slice(1).entries()) {
    const x = (re[i] * a + im[i] * b) / square, y = (im[i] * a - re[i] * b) / square, r = Math.hypot(x, y);
    if (!(r >= 0.02)) break;
    if (k + 1 === terms) return `${text} …`;
    const inStep = Math.abs(y) <= 0.176 * Math.abs(x);
    text += `${inStep && x < 0 ? ' − ' : ' + '}${r < 1 - 5e-3 ? `${r.toPrecision(2)} ` : ''}q${i + 1}`;
    if (!inStep) text += ` (${Math.round(Math.atan2(y, x) * 180 / Math.PI)}°)`.replace('-', '−');
  }
  return text;
}

/// Shows rows {label, text, strong} beside a point of a canvas, or nothing.
let hint = null;
export function showHint(canvas, x, y, rows) {
  if (!hint) {
    hint = document.createElement('div');
    hint.className = 'hint';
    document.body.append(hint);
  }
  hint.hidden = !rows;
  if (!rows) return;
  hint.replaceChildren(...rows.map(({label, text}) => {
    const row = document.createElement('div');
    if (label !== undefined) row.append(markElement(label), ' ');
    row.append(text);
    return row;
  }));
  const box = canvas.getBoundingClientRect();
  const left = box.left + x + 14, over = left + hint.offsetWidth > document.documentElement.clientWidth - 4;
  hint.style.left = `${window.scrollX + (over ? Math.max(4, left - 28 - hint.offsetWidth) : left)}px`;
  hint.style.top = `${window.scrollY + Math.max(4, Math.min(box.top + y - 10, window.innerHeight - hint.offsetHeight - 4))}px`;
}
