// Fields of a form: a slider beside a number with its unit, choices, lists, matrices. Each has refresh(), which shows
// the present value.
import {button, element} from '../shared/dom.js';
import {number, plain, rounded} from '../shared/numbers.js';

const kSteps = 400;
const kUnits = {rad: {rad: 1, deg: Math.PI / 180, '°': Math.PI / 180}, m: {m: 1, mm: 1e-3}, kg: {kg: 1, g: 1e-3}};

/// Returns the numbers of a text, "-45 deg, 0.3", in rad, m or kg as `unitOf(i)` says; the word `none` is null. Returns
/// nothing for other texts.
export function readNumbers(text, unitOf, none) {
  const part =
    /\s*(?:([a-z]+)|([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(deg|°|rad|mm|m|kg|g)?)(?:\s*[,;]|\s+|$)\s*/iy;
  const words = text.replaceAll('−', '-').replace(/^\s*\[|\]\s*$/g, ''), found = [];
  while (part.lastIndex < words.length) {
    const told = part.exec(words);
    if (!told) return undefined;
    const [, word, value, unit] = told;
    const scale = unit ? (kUnits[unitOf(found.length)] || {})[unit] : 1;
    if (word ? word !== none : !scale) return undefined;
    found.push(word ? null : scale === 1 ? Number(value) : rounded(value * scale, 10));
  }
  return found.every((x) => x === null || Number.isFinite(x)) ? found : undefined;
}
function readNumber(text, unit) {
  const values = readNumbers(text.replace(',', '.'), () => unit);
  return values && values.length === 1 ? values[0] : undefined;
}

let notes = 0;
const makeNote = () => element('span', {class: 'wanted', role: 'status', id: `wanted${++notes}`});

/// An input whose text goes to `take`, which returns whether it is valid. An invalid text stays, marked, with `wanted`
/// in the note beside it until the value `get()` changes. refresh() writes `text` of the value, unless the input has
/// an invalid text or is being edited.
export function textInput(input, {wanted, get, take, text, note = makeNote()}) {
  let wrong = null;  // the value when a text was invalid
  const mark = (bad) => {
    wrong = bad ? JSON.stringify(get()) : null;
    input.setAttribute('aria-invalid', bad);
    input.classList.toggle('wrong', bad);
    note.textContent = bad ? wanted : '';
  };
  input.setAttribute('aria-describedby', note.id);
  input.addEventListener('change', () => mark(!take(input.value)));
  return {input, note, refresh: () => {
    if (wrong !== null && wrong !== JSON.stringify(get())) mark(false);
    if (wrong === null && document.activeElement !== input) input.value = text(get());
  }};
}

const textAttributes = (label, more) => ({type: 'text', autocomplete: 'off', 'aria-label': label, ...more});
const frame = (label, key, ...children) =>
  element('label', {class: 'field', 'data-key': key}, element('span', {}, label), ...children);

/// Makes fields; `edit` takes a function that changes a value, and whether the change has ended.
export class Form {
  constructor(edit) { this.edit = edit; }

  /// An input for one number.
  number(label, unit, {wanted, get, set, text = plain, note}) {
    return textInput(element('input', textAttributes(label, {inputmode: 'decimal'})), {wanted, get, text, note,
      take: (words) => {
        const value = readNumber(words, unit);
        if (value !== undefined) this.edit(() => set(value), true);
        return value !== undefined;
      }});
  }

  /// `log` sliders have zero at their left end.
  slider({label, key, unit, low, high, log, get, set}) {
    const name = `${label}, ${unit}`, span = high / low;
    const toValue = (p) => (!log ? low + (high - low) * p / kSteps
      : p <= 0 ? 0 : low * span ** ((p - 1) / (kSteps - 1)));
    const toPlace = (v) => (!log ? kSteps * (v - low) / (high - low)
      : v <= 0 ? 0 : 1 + (kSteps - 1) * Math.log(v / low) / Math.log(span));
    const take = (ended) => () => this.edit(() => set(rounded(toValue(Number(range.value)), 3)), ended);
    const range = element('input', {type: 'range', min: 0, max: kSteps, step: 1, 'aria-label': name,
      input: take(false), change: take(true)});
    const field = this.number(name, unit, {wanted: `a number${unit ? ` in ${unit}` : ''}`, get, set});
    return {element: frame(label, key, range, field.input, element('span', {}, unit), field.note), refresh: () => {
      range.value = toPlace(get());
      range.setAttribute('aria-valuetext', `${number(get())} ${unit}`);
      field.refresh();
    }};
  }

  /// `options` are [[value, text]].
  choice({label, key, options, get, set}) {
    const select = element('select', {change: () => this.edit(() => set(select.value), true)},
      ...options.map(([value, text]) => element('option', {value}, text)));
    return {element: frame(label, key, select), refresh: () => { select.value = get(); }};
  }

  /// A value that is true or false.
  check({label, key, get, set}) {
    const box = element('input', {type: 'checkbox', change: () => this.edit(() => set(box.checked), true)});
    return {element: frame(label, key, box), refresh: () => { box.checked = get(); }};
  }

  /// Numbers between commas, one for all, or nothing for null.
  list({label, key, unit, count, get, set, none}) {
    const name = `${label}, ${unit}`;
    const input = element('input', textAttributes(name, {class: 'wide', spellcheck: 'false'}));
    const {note, refresh} = textInput(input, {get,
      wanted: `${count} numbers in ${unit}, or one for all${none ? `; ${none} is one` : ''}`,
      text: (values) => (values ? values.map((x) => (x === null ? none : plain(x))).join(', ') : ''),
      take: (words) => {
        const values = readNumbers(words, () => unit, none);
        if (!values || ![0, 1, count].includes(values.length)) return false;
        this.edit(() => set(!values.length ? null : values.length === 1 ? Array(count).fill(values[0]) : values), true);
        return true;
      }});
    return {element: frame(name, key, input, note), refresh};
  }

  /// A symmetric matrix, of which set(i, j, value) sets an entry.
  matrix({label, key, names, get, set}) {
    const note = makeNote(), n = names.length;
    const cells = names.flatMap((row, i) => names.map((column, j) =>
      this.number(`${label} ${row} ${column}`, '', {note, wanted: `a number for ${row} ${column}`,
        get: () => get()[i][j], set: (x) => set(i, j, x), text: (x) => String(rounded(x, 4))})));
    const grid = element('div', {class: 'matrix', 'data-key': key}, ...cells.map(({input}) => input));
    grid.style.setProperty('--columns', n);
    const refresh = () => cells.forEach((cell, k) => {
      const i = Math.floor(k / n), j = k % n;
      cell.refresh();
      cell.input.title = `${n} x ${n}, entry ${names[i]} ${names[j]}: ${plain(get()[i][j])}`;
    });
    return {element: element('div', {}, element('h3', {}, label), grid, note), refresh};
  }

  button(label, click) {
    return {element: element('div', {class: 'row'}, button(click, {}, label)), refresh: () => {}};
  }
}

/// get and set of a field for the value of a key in `object()`.
export const at = (object, key, usual) => ({get: () => object()[key] ?? usual, set: (x) => { object()[key] = x; }});
