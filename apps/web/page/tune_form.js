// Fields of a form: a slider beside a number with its unit, choices, lists, matrices. Each has
// refresh(), which shows the value as it is. `edit` takes what changes the value, and whether the
// change has ended.
import {number} from '/draw.js';

const make = (tag, attributes = {}, ...children) => {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
};
const frame = (label, key, ...children) => {
  const field = make('label', {class: 'field'}, make('span', {}, label), ...children);
  field.dataset.key = key;
  return field;
};
const kSteps = 400;
/// As a number is written in a field: short, and exact where the value is.
export const plain = (x) => (x === null || x === undefined ? '' : String(Number(Number(x).toPrecision(10))));

const kUnits = {rad: {rad: 1, deg: Math.PI / 180, '°': Math.PI / 180}, m: {m: 1, mm: 1e-3}, kg: {kg: 1, g: 1e-3}};
/// Returns the numbers of a text, "-45 deg, 0.3", in rad, m or kg as `unitOf(i)` says; the word
/// `none` is null. Returns nothing for other texts.
export function numbers(text, unitOf, none) {
  const part = /\s*(?:([a-z]+)|([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(deg|°|rad|mm|m|kg|g)?)(?:\s*[,;]|\s+|$)\s*/iy;
  const words = text.replaceAll('−', '-').replace(/^\s*\[|\]\s*$/g, ''), found = [];
  while (part.lastIndex < words.length) {
    const told = part.exec(words);
    if (!told) return undefined;
    const [, word, value, unit] = told;
    const scale = unit ? (kUnits[unitOf(found.length)] || {})[unit] : 1;
    if (word ? word !== none : !scale) return undefined;
    found.push(word ? null : scale === 1 ? Number(value) : Number((value * scale).toPrecision(10)));
  }
  return found.every((x) => x === null || Number.isFinite(x)) ? found : undefined;
}

let notes = 0;
/// Takes the text of an input by `take`, which returns whether it could. A text that is not taken
/// stays, marked, with `wanted` in the note beside it until the value is another one. Returns the
/// note, and whether the input has such a text.
export function attend(input, {wanted, get, take, note = make('span', {class: 'wanted', role: 'status', id: `wanted${++notes}`})}) {
  let at = null;
  const mark = (bad) => {
    at = bad ? JSON.stringify(get()) : null;
    input.setAttribute('aria-invalid', bad);
    input.classList.toggle('wrong', bad);
    note.textContent = bad ? wanted : '';
  };
  input.setAttribute('aria-describedby', note.id);
  input.addEventListener('change', () => mark(!take(input.value)));
  const wrong = () => {
    if (at !== null && at !== JSON.stringify(get())) mark(false);
    return at !== null;
  };
  return {note, wrong};
}

/// {label, key, unit, low, high, log, get, set}: `log` sliders have zero at their left end.
export function slider(edit, {label, key, unit, low, high, log, get, set}) {
  const range = make('input', {type: 'range', min: 0, max: kSteps, step: 1, 'aria-label': `${label}, ${unit}`});
  const text = make('input', {type: 'text', inputmode: 'decimal', 'aria-label': `${label}, ${unit}`, autocomplete: 'off'});
  const toValue = (p) => (log ? (p <= 0 ? 0 : low * (high / low) ** ((p - 1) / (kSteps - 1))) : low + (high - low) * p / kSteps);
  const toPlace = (v) => (log ? (v <= 0 ? 0 : 1 + (kSteps - 1) * Math.log(v / low) / Math.log(high / low)) : kSteps * (v - low) / (high - low));
  const take = (last) => edit(() => set(Number(toValue(Number(range.value)).toPrecision(3))), last);
  range.addEventListener('input', () => take(false));
  range.addEventListener('change', () => take(true));
  const {note, wrong} = attend(text, {wanted: `a number${unit ? ` in ${unit}` : ''}`, get, take: (words) => {
    const values = numbers(words.replace(',', '.'), () => unit);
    if (!values || values.length !== 1) return false;
    edit(() => set(values[0]), true);
    return true;
  }});
  function refresh() {
    const value = get();
    range.value = toPlace(value);
    range.setAttribute('aria-valuetext', `${number(value)} ${unit}`);
    if (!wrong() && document.activeElement !== text) text.value = plain(value);
  }
  return {element: frame(label, key, range, text, make('span', {}, unit), note), refresh};
}

/// {label, key, options: [[value, text]], get, set}
export function choice(edit, {label, key, options, get, set}) {
  const select = make('select', {}, ...options.map(([value, text]) => make('option', {value}, text)));
  select.addEventListener('change', () => edit(() => set(select.value), true));
  return {element: frame(label, key, select), refresh: () => { select.value = get(); }};
}

/// {label, key, get, set} of true and false
export function check(edit, {label, key, get, set}) {
  const box = make('input', {type: 'checkbox'});
  box.addEventListener('change', () => edit(() => set(box.checked), true));
  return {element: frame(label, key, box), refresh: () => { box.checked = get(); }};
}

/// {label, key, unit, count, get, set}: numbers between commas, one for all, or nothing for null.
export function list(edit, {label, key, unit, count, get, set, none}) {
  const text = make('input', {type: 'text', class: 'wide', autocomplete: 'off', spellcheck: 'false', 'aria-label': `${label}, ${unit}`});
  const {note, wrong} = attend(text, {wanted: `${count} numbers in ${unit}, or one for all${none ? `; ${none} is one` : ''}`, get, take: (words) => {
    const values = numbers(words, () => unit, none);
    if (!values || ![0, 1, count].includes(values.length)) return false;
    edit(() => set(!values.length ? null : values.length === 1 ? Array(count).fill(values[0]) : values), true);
    return true;
  }});
  function refresh() {
    const values = get();
    if (!wrong() && document.activeElement !== text) text.value = values ? values.map((x) => (x === null ? none : plain(x))).join(', ') : '';
  }
  return {element: frame(`${label}, ${unit}`, key, text, note), refresh};
}

/// {label, key, names, get, set(i, j, value)}: a symmetric matrix.
export function matrix(edit, {label, key, names, get, set}) {
  const note = make('span', {class: 'wanted', role: 'status', id: `wanted${++notes}`}), wrongs = [];
  const cells = names.map((row, i) => names.map((column, j) => {
    const cell = make('input', {type: 'text', inputmode: 'decimal', 'aria-label': `${label} ${row} ${column}`, autocomplete: 'off'});
    wrongs.push(attend(cell, {note, wanted: `a number for ${row} ${column}`, get: () => get()[i][j], take: (words) => {
      const values = numbers(words.replace(',', '.'), () => '');
      if (!values || values.length !== 1) return false;
      edit(() => set(i, j, values[0]), true);
      return true;
    }}).wrong);
    return cell;
  }));
  const grid = make('div', {class: 'matrix'}, ...cells.flat());
  grid.style.setProperty('--columns', names.length);
  grid.dataset.key = key;
  function refresh() {
    const values = get();
    cells.forEach((row, i) => row.forEach((cell, j) => {
      if (!wrongs[i * row.length + j]() && document.activeElement !== cell) cell.value = String(Number(values[i][j].toPrecision(4)));
      cell.title = `${row.length} x ${row.length}, entry ${names[i]} ${names[j]}: ${plain(values[i][j])}`;
    }));
  }
  return {element: make('div', {}, make('h3', {}, label), grid, note), refresh};
}

export function button(label, act) {
  const element = make('button', {type: 'button'}, label);
  element.addEventListener('click', act);
  return {element: make('div', {class: 'row'}, element), refresh: () => {}};
}
