// The task's gains as texts for other controllers, which have diagonals. `of` is {setup, q, design, answer}, as for
// Dashpot.
import {rounded} from '../shared/numbers.js';
import {diagonal, isDiagonal, kTaskAxes} from './designs.js';
import {nullDamping, notes} from './export_dashpot.js';

const round = (x) => rounded(x, 7);
const decimal = (x) => (Number.isInteger(x) ? `${x}.0` : String(x));
/// Whether entries off the diagonal are more than rounding.
const isLost = (matrix) => matrix && !isDiagonal(matrix, 1e-9 * Math.max(...diagonal(matrix).map(Math.abs)));

/// Writes {k, d, note}, the diagonals of the task's gains and what is lost with them, by `write` for a controller.
const forTask = (name, write) => (of) => {
  const {stiffness, damping} = of.answer.gains;
  if (of.design.mode === 'joint' || !stiffness || !damping) {
    return `# ${name} has Cartesian gains: there are none in this design, or the posture is singular.\n`;
  }
  const lost = isLost(damping) || isLost(stiffness);
  return write(of, diagonal(stiffness).map(round), diagonal(damping).map(round),
    lost && 'This form has no entries off the diagonal: the modes differ from those on the page.');
};

function nullSpaceNote({null_stiffness: stiffness, null_damping: damping}) {
  const differ = (all) => Array.isArray(all) && all.some((x) => x !== all[0]);
  return (differ(stiffness) || differ(damping)) &&
    'The null space has one stiffness there: here it comes from the first joint.';
}

export const crisp = forTask('crisp', ({design}, k, d, lost) => {
  const keys = (letter, values) => values.map((x, i) =>
    `      task.${letter}_${i < 3 ? 'pos' : 'rot'}_${kTaskAxes[i % 3]}: ${decimal(x)}\n`).join('');
  return notes([lost, d.some((x) => x <= 0) && 'A damping that is not positive becomes 2 sqrt(k) there.',
    nullSpaceNote(design)]) + `cartesian_impedance_controller:\n    ros__parameters:\n${keys('k', k)}${keys('d', d)}` +
    `      nullspace.stiffness: ${decimal(design.null_stiffness[0] || 0)}\n` +
    `      nullspace.projector_type: ${design.null_projector?.replace('weighted', 'kinematic') || 'dynamic'}\n`;
});

export const cartesianImpedance = forTask('Cartesian-Impedance-Controller', ({q, design}, k, d, lost) => {
  const factorOf = (damping, stiffness) => round(stiffness > 0 ? damping / (2 * Math.sqrt(stiffness)) : 0);
  const factors = d.map((x, i) => factorOf(x, k[i])), own = design.null_stiffness[0] || 0;
  const {ratio} = design.null_damping;
  const factor = ratio && own > 0 ? round(ratio) : factorOf(nullDamping(design)[0] || 0, own);
  const axes = (v) => `{x: ${v[0]}, y: ${v[1]}, z: ${v[2]}}`;
  const wrench = (v) => `\n  force: ${axes(v)}\n  torque: ${axes(v.slice(3))}\n`;
  return notes([lost,
    [...factors, factor].some((f) => f > 1) && 'It takes damping factors from 0 to 1: those above are cut off there.',
    nullSpaceNote(design), ratio && own > 0 &&
      'A damping ratio of the null space has no counterpart there: the factor is for an inertia of 1 kg m^2.',
    'A message cartesian_impedance_controller/ControllerConfig for set_config.']) +
    `cartesian_stiffness:${wrench(k)}cartesian_damping_factors:${wrench(factors)}nullspace_stiffness: ${own}\n` +
    `nullspace_damping_factor: ${factor}\nq_d_nullspace: [${q.join(', ')}]\n`;
});

export const frankaRos = forTask('franka_ros', ({design}, k, d) => {
  const stated = k.map((x, i) => (i < 3 ? x : 2 * x));  // it acts on half of the rotation vector
  const [linear, angular] = [0, 3].map((i) => round((stated[i] + stated[i + 1] + stated[i + 2]) / 3));
  const given = stated.map((_, i) => (i < 3 ? linear : angular));
  const other = d.some((x, i) => Math.abs(x - 2 * Math.sqrt(given[i])) > 1e-6 * x) ||
    stated.some((x, i) => Math.abs(x - given[i]) > 1e-6 * x);
  return notes([nullSpaceNote(design), other && 'It has one stiffness for translation and one for rotation, and ' +
    'damping is always 2 sqrt(stiffness): the modes differ from those on the page.']) +
    `translational_stiffness: ${linear}\nrotational_stiffness: ${angular}\n` +
    `nullspace_stiffness: ${design.null_stiffness[0] || 0}\n`;
});
