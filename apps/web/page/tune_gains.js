// Which fields a design has: gains, loop, and what the arm has besides.
import {button, check, choice, list, matrix, slider} from '/tune_form.js';

const kTask = ['x', 'y', 'z', 'rx', 'ry', 'rz'];
const rows = (value) => (Array.isArray(value[0]) ? value : value.map((x, i) => value.map((_, j) => (i === j ? x : 0))));
const diagonal = (value) => (Array.isArray(value[0]) ? value.map((row, i) => row[i]) : value);
export const kindOf = (damping) => (Array.isArray(damping) ? (Array.isArray(damping[0]) ? 'full' : 'diagonal') : damping.ratio !== undefined ? 'ratio' : 'factor');

/// The words on which the form's fields depend; where they change, it is built again.
export function structure(design) {
  return [design.mode, kindOf(design.stiffness.length ? design.stiffness : []), kindOf(design.joint_stiffness), kindOf(design.damping),
    kindOf(design.joint_damping), kindOf(design.null_damping)].join();
}

/// Stiffness and damping of task or joints. `acting` returns the matrix of damping that acts, or null;
/// `propose` takes damping of the wanted ratio.
function pair(edit, design, {stiffness, damping, names, units, acting, propose}) {
  const fields = [], n = names.length;
  const full = Array.isArray(design()[stiffness][0]);
  fields.push(choice(edit, {label: 'stiffness', key: `${stiffness}_kind`, options: [['diagonal', 'diagonal'], ['full', 'full matrix']],
    get: () => kindOf(design()[stiffness]), set: (kind) => { design()[stiffness] = kind === 'full' ? rows(design()[stiffness]) : diagonal(design()[stiffness]); }}));
  const entry = (key, i, j, value) => { design()[key][i][j] = design()[key][j][i] = value; };
  if (full) {
    fields.push(matrix(edit, {label: 'stiffness, N/m, N, N m/rad', key: stiffness, names, get: () => design()[stiffness], set: (i, j, x) => entry(stiffness, i, j, x)}));
  } else {
    names.forEach((name, i) => fields.push(slider(edit, {label: `stiffness ${name}`, key: stiffness, unit: units(i)[0], low: units(i)[1], high: units(i)[2], log: true,
      get: () => design()[stiffness][i], set: (x) => { design()[stiffness][i] = x; }})));
  }
  fields.push(choice(edit, {label: 'damping', key: `${damping}_kind`,
    options: [['ratio', 'damping ratio, at every posture'], ['factor', 'factor of √stiffness'], ['diagonal', 'diagonal'], ['full', 'full matrix']],
    get: () => kindOf(design()[damping]), set: (kind) => {
      const now = acting() || rows(Array(n).fill(0)), clean = now.map((row) => row.map((x) => Number(x.toPrecision(6))));
      design()[damping] = {ratio: {ratio: 0.7}, factor: {factor: 2}, diagonal: diagonal(clean), full: clean}[kind];
    }}));
  fields.push(button('Propose a diagonal', () => propose(damping, false)), button('Propose a matrix', () => propose(damping, true)));
  const kind = kindOf(design()[damping]);
  if (kind === 'ratio' || kind === 'factor') {
    fields.push(slider(edit, {label: kind, key: damping, unit: kind === 'ratio' ? '' : '√kg', low: kind === 'ratio' ? 0.05 : 0, high: kind === 'ratio' ? 2 : 6,
      get: () => design()[damping][kind], set: (x) => { design()[damping] = {[kind]: x}; }}));
  } else if (kind === 'diagonal') {
    names.forEach((name, i) => fields.push(slider(edit, {label: `damping ${name}`, key: damping, unit: units(i)[3], low: 0.01 * units(i)[1] ** 0.5, high: units(i)[4], log: true,
      get: () => design()[damping][i], set: (x) => { design()[damping][i] = x; }})));
  } else {
    fields.push(matrix(edit, {label: 'damping, N s/m, N s, N m s/rad', key: damping, names, get: () => design()[damping], set: (i, j, x) => entry(damping, i, j, x)}));
  }
  return fields;
}

/// Fields of the gains. `design` returns the design that is edited, `arm` is the chain.
export function gainFields(edit, design, arm, acting, propose) {
  const n = arm.joints.length, joint = design().mode === 'joint', rest = () => design().null_stiffness;
  const fields = [choice(edit, {label: 'springs', key: 'mode', options: [['cartesian', 'at the tip'], ['joint', 'in the joints']],
    get: () => design().mode, set: (x) => { design().mode = x; }})];
  if (joint) {
    const unit = (i) => (arm.joints[i].prismatic ? ['N/m', 1, 1e5, 'N s/m', 1e4] : ['N m/rad', 0.1, 1e4, 'N m s/rad', 300]);
    return fields.concat(pair(edit, design, {stiffness: 'joint_stiffness', damping: 'joint_damping', names: arm.joints.map((_, i) => String(i + 1)), units: unit, acting, propose}));
  }
  const unit = (i) => (i < 3 ? ['N/m', 1, 1e4, 'N s/m', 1000] : ['N m/rad', 0.1, 1000, 'N m s/rad', 100]);
  fields.push(...pair(edit, design, {stiffness: 'stiffness', damping: 'damping', names: kTask, units: unit, acting, propose}));
  fields.push(choice(edit, {label: 'axes', key: 'frame', options: [['base', 'of the base'], ['tool', 'of the tool']], get: () => design().frame || 'base', set: (x) => { design().frame = x; }}));
  fields.push(choice(edit, {label: 'rotation error', key: 'rotation', options: [['vector', 'rotation vector'], ['half-quaternion', 'part of a quaternion: half of it']],
    get: () => design().rotation || 'vector', set: (x) => { design().rotation = x; }}));
  if (n < 7 && !rest().some(Boolean)) return fields;
  fields.push(slider(edit, {label: 'null space', key: 'null_stiffness', unit: 'N m/rad', low: 0.01, high: 500, log: true, get: () => rest()[0],
    set: (x) => { design().null_stiffness = Array(n).fill(x); }}));
  fields.push(choice(edit, {label: 'its damping', key: 'null_damping_kind', options: [['ratio', 'damping ratio'], ['factor', 'factor of √stiffness'], ['diagonal', 'given']],
    get: () => kindOf(design().null_damping), set: (kind) => { design().null_damping = {ratio: {ratio: 0.7}, factor: {factor: 2}, diagonal: Array(n).fill(0)}[kind]; }}));
  const kind = kindOf(design().null_damping);
  fields.push(slider(edit, kind === 'diagonal'
    ? {label: 'damping', key: 'null_damping', unit: 'N m s/rad', low: 0.01, high: 100, log: true, get: () => design().null_damping[0], set: (x) => { design().null_damping = Array(n).fill(x); }}
    : {label: kind, key: 'null_damping', unit: kind === 'ratio' ? '' : '√kg m', low: kind === 'ratio' ? 0.05 : 0, high: kind === 'ratio' ? 2 : 6, get: () => design().null_damping[kind], set: (x) => { design().null_damping = {[kind]: x}; }}));
  fields.push(choice(edit, {label: 'its projector', key: 'null_projector', options: [['dynamic', 'dynamically consistent'], ['kinematic', 'pseudo-inverse']],
    get: () => design().null_projector || 'dynamic', set: (x) => { design().null_projector = x; }}));
  fields.push(check(edit, {label: '× inertia of tip', key: 'inertia_blocks', get: () => !!design().inertia_blocks, set: (x) => { design().inertia_blocks = x; }}));
  return fields;
}

export function loopFields(edit, design) {
  const of = (key, label, unit, low, high, log = false, scale = 1) => slider(edit, {label, key, unit, low, high, log,
    get: () => design()[key] * scale, set: (x) => { design()[key] = key === 'delay' ? Math.round(x) : x / scale; }});
  return [of('period', 'period', 'ms', 0.1, 20, true, 1000), of('delay', 'delay', 'ticks', 0, 10), of('cutoff', 'low-pass', 'Hz', 1, 1000, true),
    check(edit, {label: 'velocity differenced', key: 'difference_velocity', get: () => !!design().difference_velocity, set: (x) => { design().difference_velocity = x; }}),
    of('integral_time', 'integral', 's', 0.1, 100, true), of('gain_margin', 'margin asked for', '', 1, 10)];
}

export function partFields(edit, design, setup) {
  const n = setup.arm.joints.length, arm = () => (design().arm = design().arm || {});
  const set = (key, value) => {
    if (value === null) delete arm()[key];
    else arm()[key] = value;
  };
  const joints = (key, label, unit, none) => list(edit, {label, key, unit, count: n, none, get: () => arm()[key] || null, set: (x) => set(key, x)});
  const loaded = setup.robot.keys;
  const carried = {mass: setup.model.payload, center: [0, 0, 0], ...loaded.payload}, payload = () => arm().payload || carried;
  /// Another mass with the same radii of gyration.
  const massOf = (mass) => ({...payload(), mass, ...(carried.inertia && {inertia: carried.inertia.map((line) => line.map((x) => x * mass / carried.mass))})});
  const fields = [slider(edit, {label: `payload${carried.inertia ? ', its inertia grows with it' : ''}`, key: 'payload', unit: 'kg', low: 0, high: 20,
    get: () => payload().mass, set: (x) => set('payload', massOf(x))}),
    list(edit, {label: 'its centre', key: 'payload', unit: 'm', count: 3, get: () => payload().center, set: (x) => set('payload', {...payload(), center: x || [0, 0, 0]})}),
    joints('reflected_inertia', 'rotors', 'kg m²')];
  if (setup.published) {
    fields.push(button(`Rotors as published for ${setup.published.name}`, () => edit(() => set('reflected_inertia', setup.published.reflected_inertia), true)));
  }
  return fields.concat([joints('viscous_friction', 'friction', 'N m s/rad'), joints('gear_stiffness', 'gears', 'N m/rad', 'none'), joints('gear_damping', 'their damping', 'N m s/rad'),
    choice(edit, {label: 'joints measured', key: 'position_sensor', options: [['motor', 'at the motors'], ['link', 'at the links']],
      get: () => arm().position_sensor || loaded.position_sensor || 'motor', set: (x) => set('position_sensor', x === (loaded.position_sensor || 'motor') ? null : x)})]);
}
