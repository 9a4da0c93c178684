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

/// {label, key, unit, low, high, log, get, set}: `log` sliders have zero at their left end.
export function slider(edit, {label, key, unit, low, high, log, get, set}) {
  const range = make('input', {type: 'range', min: 0, max: kSteps, step: 1, 'aria-label': `${label}, ${unit}`});
  const text = make('input', {type: 'text', inputmode: 'decimal', 'aria-label': `${label}, ${unit}`, autocomplete: 'off'});
  const toValue = (p) => (log ? (p <= 0 ? 0 : low * (high / low) ** ((p - 1) / (kSteps - 1))) : low + (high - low) * p / kSteps);
  const toPlace = (v) => (log ? (v <= 0 ? 0 : 1 + (kSteps - 1) * Math.log(v / low) / Math.log(high / low)) : kSteps * (v - low) / (high - low));
  const take = (last) => edit(() => set(Number(toValue(Number(range.value)).toPrecision(3))), last);
  range.addEventListener('input', () => take(false));
  range.addEventListener('change', () => take(true));
  text.addEventListener('change', () => {
    const value = Number(text.value.trim().replace(',', '.').replace('−', '-'));
    if (text.value.trim() && Number.isFinite(value)) edit(() => set(value), true);
    else refresh();
  });
  function refresh() {
    const value = get();
    range.value = toPlace(value);
    range.setAttribute('aria-valuetext', `${number(value)} ${unit}`);
    if (document.activeElement !== text) text.value = plain(value);
  }
  return {element: frame(label, key, range, text, make('span', {}, unit)), refresh};
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
  text.addEventListener('change', () => {
    const words = text.value.split(/[,\s]+/).filter(Boolean);
    const values = words.map((word) => (none && word === none ? null : Number(word)));
    if (!words.length) return edit(() => set(null), true);
    if (values.some((x) => x !== null && !Number.isFinite(x)) || (values.length !== 1 && values.length !== count)) return refresh();
    edit(() => set(values.length === 1 ? Array(count).fill(values[0]) : values), true);
  });
  function refresh() {
    const values = get();
    if (document.activeElement !== text) text.value = values ? values.map((x) => (x === null ? none : plain(x))).join(', ') : '';
  }
  return {element: frame(`${label}, ${unit}`, key, text), refresh};
}

/// {label, key, names, get, set(i, j, value)}: a symmetric matrix.
export function matrix(edit, {label, key, names, get, set}) {
  const cells = names.map((row, i) => names.map((column, j) => {
    const cell = make('input', {type: 'text', inputmode: 'decimal', 'aria-label': `${label} ${row} ${column}`, autocomplete: 'off'});
    cell.addEventListener('change', () => {
      const value = Number(cell.value.trim().replace(',', '.').replace('−', '-'));
      if (cell.value.trim() && Number.isFinite(value)) edit(() => set(i, j, value), true);
      else refresh();
    });
    return cell;
  }));
  const grid = make('div', {class: 'matrix'}, ...cells.flat());
  grid.style.setProperty('--columns', names.length);
  grid.dataset.key = key;
  function refresh() {
    const values = get();
    cells.forEach((row, i) => row.forEach((cell, j) => {
      if (document.activeElement !== cell) cell.value = String(Number(values[i][j].toPrecision(4)));
      cell.title = `${row.length} x ${row.length}, entry ${names[i]} ${names[j]}: ${plain(values[i][j])}`;
    }));
  }
  return {element: make('div', {}, make('h3', {}, label), grid), refresh};
}

export function button(label, act) {
  const element = make('button', {type: 'button'}, label);
  element.addEventListener('click', act);
  return {element: make('div', {class: 'row'}, element), refresh: () => {}};
}
