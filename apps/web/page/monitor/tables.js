// The tables of modes and joints.
import {$, set, setText} from '../shared/dom.js';
import {markElement} from '../shared/mode_marks.js';
import {degrees, fixed, number} from '../shared/numbers.js';
import {wantedRatio} from './loop_state.js';

const kSoft = 5;  // kind of a mode without a spring of its own
const kOrigins = ['tracked', 'reused', 'solved directly'];

/// The judgement of a damping ratio: 'good', 'bad', or '' if no ratio is wanted. Friction and rounding may take 5 % of
/// it.
export function judge(ratio, wanted) {
  if (ratio === null) return 'none';
  if (!(ratio > 0)) return 'bad';
  return wanted > 0 ? (ratio >= 0.95 * wanted ? 'good' : 'bad') : '';
}

/// A mode's shape as the terminal writes it, "q2 - 0.43 q5 + 0.21 q1 (95 deg)": entries relative to the largest, by
/// falling size, with the phase where one is not in step with it.
function shapeText(re, im, terms = 4) {
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
    text += `${inStep && x < 0 ? ' − ' : ' + '}${r < 1 - 5e-3 ? `${number(r, 2)} ` : ''}q${i + 1}`;
    if (!inStep) text += ` (${fixed(degrees(Math.atan2(y, x)), 0)}°)`;
  }
  return text;
}

/// Gives a table so many rows and cells; returns the cells of each row.
function resize(table, rows, cells) {
  while (table.rows.length > rows) table.deleteRow(-1);
  while (table.rows.length < rows) {
    const row = table.insertRow();
    for (let i = 0; i < cells; ++i) row.insertCell();
  }
  return [...table.rows].map((row) => row.cells);
}

export function fillModeTable(page) {
  const {frame: {modes}, setup: {arm}, chosen} = page, wanted = wantedRatio(page);
  const count = modes ? modes.label.length : 0, status = modes && modes.status ? `${modes.status_text}; ` : '';
  setText('modes_note', !modes ? 'none yet' : `${count}, and ${modes.zero_modes} zero; ` +
    `${kOrigins[modes.origin] || ''}; ${status}` +
    `${wanted > 0 ? `wanted ratio ${number(wanted, 3)}` : 'no ratio is wanted'}`);
  const names = arm ? arm.joints.map((joint, i) => `q${i + 1} = ${joint.name}`).join('\n') : '';
  resize($('rows'), count, 7).forEach((cells, i) => {
    const label = modes.label[i], f = modes.natural_frequency[i], ratio = modes.damping_ratio[i];
    const bound = modes.natural_frequency_bound[i];
    set($('rows').rows[i], 'className', label === chosen ? 'chosen' : '');
    if (cells[0].dataset.label !== String(label)) {
      cells[0].dataset.label = label;
      cells[0].replaceChildren(markElement(label), ` ${label}`);
    }
    const texts = [number(f), number(f === null ? null : f / (2 * Math.PI), 3), number(ratio, 3), modes.kind_text[i],
      bound === null ? 'none' : number(bound, 2), shapeText(modes.shape_real[i], modes.shape_imag[i])];
    texts.forEach((value, k) => set(cells[k + 1], 'textContent', value));
    set(cells[3], 'className', modes.kind[i] === kSoft ? '' : judge(ratio, wanted));
    set(cells[6], 'title', names);
  });
}

export function fillJointTable({frame: {state}, setup: {arm}}) {
  const count = state ? state.n : 0, own = arm && arm.joints.length === count;
  resize($('joints'), count, 6).forEach((cells, i) => {
    const joint = own ? arm.joints[i] : null, q = state.joint_position[i];
    const texts = [`q${i + 1}`, joint ? joint.name : '–', fixed(q, 4), fixed(state.reference_joint_position[i], 4),
      fixed(state.joint_velocity[i], 4), fixed(state.joint_torque[i], 3)];
    texts.forEach((value, k) => set(cells[k], 'textContent', value));
    set(cells[2], 'className', joint && (q < joint.lower || q > joint.upper) ? 'bad' : '');
    set(cells[2], 'title', joint ? `limits ${number(joint.lower)} and ${number(joint.upper)}` : '');
  });
}
