// The effect on a damping ratio: an arrow for each entry of damping and stiffness, which takes a step of it.
import {$, button, element} from '../shared/dom.js';
import {isNumber, number, rounded} from '../shared/numbers.js';
import {kTaskAxes} from './designs.js';
import {compact} from './matrices.js';

const kLeast = 5e-4;  // changes of a ratio below this have no arrow

/// The step of an entry that an arrow stands for: a tenth of the stiffness on the diagonal there, a quarter of the
/// damping or, if that is more, of sqrt(stiffness).
function stepOf(which, {damping, stiffness}, i, j) {
  const mean = (A) => Math.sqrt(Math.abs(A[i][i] * A[j][j]));
  return which === 'stiffness' ? 0.1 * Math.max(mean(stiffness), 1)
    : 0.25 * Math.max(mean(damping), Math.sqrt(mean(stiffness)));
}

/// Adds a step to an entry of the matrix that acts, which then becomes the given matrix.
function take(page, which, matrix, i, j, step) {
  const {mode, rotation} = page.design(), key = mode === 'joint' ? `joint_${which}` : which;
  const half = which === 'stiffness' && rotation === 'half-quaternion' && mode !== 'joint';  // half of it acts
  const given = (r, c) => (half && r > 2 && c > 2 ? 2 : 1);
  const next = matrix.map((line, r) => line.map((x, c) => x * given(r, c)));
  next[i][j] += step * given(i, j);
  if (i !== j) next[j][i] = next[i][j];
  page.edit(() => { page.design()[key] = compact(next.map((line) => line.map((x) => rounded(x, 6)))); }, true);
}

/// The arrow of an entry; `changes` has the change of each ratio by a step.
function arrow(name, value, step, changes, chosen, click) {
  const now = changes[chosen], none = Math.abs(now) < kLeast;
  const said = `${name} = ${number(value)}; ${number(step, 2)} more changes the ratios of modes 1.. by ` +
    changes.map((change) => (change > 0 ? '+' : '') + number(change, 2)).join(', ');
  return button(click, {class: none ? 'none' : now > 0 ? 'up' : 'down', title: said, 'aria-label': said},
    none ? '·' : `${now > 0 ? '↑' : '↓'}${number(Math.abs(now), 2)}`);
}

/// The mode of the arrows: as chosen, or the one with the smallest ratio; -1 if there is none.
function chosenMode(modes) {
  const pick = $('arrow_mode');
  if (pick.options.length !== modes.length + 1) {
    pick.replaceChildren(new Option('the smallest ratio', 'smallest'),
      ...modes.map((_, i) => new Option(`mode ${i + 1}`, i + 1)));
  }
  if (pick.value !== 'smallest') return Number(pick.value) - 1;
  const ratios = modes.map((mode) => mode.damping_ratio);
  return ratios.indexOf(Math.min(...ratios.filter(isNumber)));
}

export function fillSensitivity(page) {
  const answer = page.answer(), asked = page.asked[page.state.edited], joint = page.design().mode === 'joint';
  const sensitivity = answer && (asked.design.mode === 'joint') === joint ? answer.sensitivity : null;
  const chosen = chosenMode(answer ? answer.modes : []);
  $('arrow_note').textContent = !sensitivity ? 'not for gains times inertia'
    : 'change by a step: a quarter of a damping, a tenth of a stiffness; click to take it, with Shift the other way';
  const labels = joint ? page.setup.arm.joints.map((_, i) => String(i + 1)) : kTaskAxes;
  for (const which of ['damping', 'stiffness']) {
    const matrix = sensitivity && chosen >= 0 && answer.gains[which];
    const entry = (i, j) => {
      const step = stepOf(which, answer.gains, i, j), twice = i === j ? 1 : 2;
      const changes = answer.modes.map((_, k) => sensitivity[which][k][i][j] * step * twice);
      return arrow(`${which} ${labels[i]} ${labels[j]}`, matrix[i][j], step, changes, chosen,
        (e) => take(page, which, matrix, i, j, e.shiftKey ? -step : step));
    };
    $(`arrows_${which}`).replaceChildren(...(!matrix ? [] : [
      element('tr', {}, element('th'), ...labels.map((label) => element('th', {}, label))),
      ...labels.map((label, i) => element('tr', {}, element('th', {}, label),
        ...labels.map((_, j) => element('td', {}, entry(i, j)))))]));
  }
}
