// Numbers as the pages write them.

const superscript = (n) => String(n).replace('-', '⁻').replace(/\d/g, (d) => '⁰¹²³⁴⁵⁶⁷⁸⁹'[d]);
function powerOfTen(x) {
  const [digits, power] = x.toExponential(0).split('e');
  return `${digits === '1' ? '' : `${digits}·`}10${superscript(Number(power))}`;
}
const kForms = {
  figures: (x, digits, far) =>
    (far ? x.toExponential(1) : Math.abs(x) >= 10 ** digits ? Math.round(x) : x.toPrecision(digits)),
  decimals: (x, digits) => (+x.toFixed(digits) + 0).toFixed(digits),  // no sign before a zero
  tick: (x, digits, far) => (far ? powerOfTen(x) : rounded(x, digits)),
};

/// A number for people. `form` is 'figures', so many significant ones; 'decimals', so many of them; or 'tick', as an
/// axis has it: no zeros at the end, powers of ten.
export function number(x, digits = 4, form = 'figures') {
  if (x === null || x === undefined || Number.isNaN(x)) return '–';
  if (!Number.isFinite(x)) return x > 0 ? '∞' : '−∞';
  const size = Math.abs(x), far = size !== 0 && (size < 1e-3 || size >= 1e5);
  return String(kForms[form](x, digits, far)).replace('-', '−');
}
export const fixed = (x, decimals) => number(x, decimals, 'decimals');
export const tickText = (x) => number(x, 4, 'tick');

export const rounded = (x, digits) => Number(Number(x).toPrecision(digits));
/// A number for a field, which is read again: short, and exact where the value is.
export const plain = (x) => (x === null || x === undefined ? '' : String(rounded(x, 10)));

export const isNumber = (x) => typeof x === 'number' && Number.isFinite(x);
export const degrees = (rad) => rad * 180 / Math.PI;
