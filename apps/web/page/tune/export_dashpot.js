// A design as a text for Dashpot. `of` is {setup, q, design, answer}: the request and the program's answer.
import {rounded} from '../shared/numbers.js';
import {compact, diagonal, isDiagonal} from './designs.js';

const kDiffers = 'the modes differ from those on the page.';
const json = JSON.stringify;
export const notes = (lines) => lines.filter(Boolean).map((line) => `# ${line}\n`).join('');

/// The damping that acts in the null space, if it is not given by a ratio.
export function nullDamping({null_damping: damping, null_stiffness: stiffness}) {
  return Array.isArray(damping) ? damping : stiffness.map((k) => (damping.factor || 0) * Math.sqrt(k));
}

/// The projector of the null space where it is not the controller's own.
const projector = ({null_projector: name = 'dynamic', null_weights: weights}) => (name === 'dynamic' ? {}
  : {null_projector: name, ...(name === 'weighted' && weights && {null_weights: weights})});

/// The arm as keys of a configuration's `robot`: from the start of the program, with the changes of the page.
function armKeys({setup, design}) {
  const arm = design.arm || {}, keys = {...setup.robot.keys};
  for (const [key, value] of Object.entries(arm)) {
    if (value) keys[key] = key === 'gear_stiffness' ? value.map((k) => k || 'none') : value;
  }
  if (arm.reflected_inertia) delete keys.drives;
  if (!keys.gear_stiffness) delete keys.gear_damping;
  return keys;
}

/// The inertia that acts of the rotors, or null if there is none.
function rotors({setup, design}) {
  const told = design.arm?.reflected_inertia, left = setup.robot.keys.torque_loop_inertia_ratio;
  const acts = told ? told.map((x, i) => (left ? rounded(x * left[i], 7) : x)) : setup.model.reflected_inertia;
  return acts.some(Boolean) ? acts : null;
}

export function configuration(of) {
  const {setup, q, design, answer} = of, {stiffness, damping} = answer.gains, {config, urdf, base, tip} = setup.robot;
  const pair = ({ratio}, K, C) =>
    ({stiffness: compact(K), ...(ratio ? {damping_ratio: ratio} : {damping: compact(C)})});
  const gains = design.mode === 'joint' ? {joint: pair(design.joint_damping, design.joint_stiffness, damping)} : {
    task: {...pair(design.damping, stiffness, damping), frame: design.frame || 'base'},
    null_space: pair(design.null_damping, design.null_stiffness, nullDamping(design))};
  const loaded = config ? setup.designs[0] : {};
  const unusual = (key, usual, name = key) =>
    (design[key] === usual && [undefined, usual].includes(loaded[key]) ? {} : {[name]: design[key]});
  const sampled = {...unusual('delay', 0), ...unusual('cutoff', 0), ...unusual('difference_velocity', false)};
  const projected = [design, loaded].some((one) => projector(one).null_projector)
    ? {null_projector: 'dynamic', ...projector(design)} : {};
  const sections = {robot: {urdf, base, tip, ...armKeys(of)},
    control: {period: design.period, mode: design.mode, ...projected}, gains,
    limits: unusual('gain_margin', setup.usual_margin), integral: unusual('integral_time', 0, 'time'),
    analysis: Object.keys(sampled).length ? {sampled} : {}};
  const refused = answer.refused.map(({key, reason}) =>
    (key === 'q' ? `Here ${reason}.` : `The controller refuses it: ${key}: ${reason}.`));
  const lines = Object.entries(sections).map(([key, value]) => [key, Object.entries(value)])
    .filter(([, inner]) => inner.length)
    .map(([key, inner]) => `${key}:\n${inner.map(([name, value]) => `  ${name}: ${json(value)}\n`).join('')}`);
  return notes([config && `These keys replace keys of ${config}, which keeps its other ones.`, `q: ${json(q)}`,
    ...refused]) + lines.join('');
}

/// Matrices for `dashpot analyze`, a row a line.
export const matrices = ({answer}) => `${json(answer.system, null, 1)
  .replace(/\[\s+([^[\]]*?)\s+\]/g, (_, inner) => `[${inner.replace(/\s+/g, ' ')}]`)}\n`;

/// A word for a shell.
const quoted = (word) => (/^[\w./:,=@%+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);

/// Options of the programs for the arm.
function armOptions(of) {
  const {robot: {urdf, base, tip}, model} = of.setup, keys = armKeys(of), accepted = keys.accept_inertias;
  const {mass, center, inertia: I} = keys.payload || {};
  const list = (name, values) => values && `--${name} ${values.join(',')}`;
  return [`--urdf ${quoted(urdf)} --base ${quoted(base)} --tip ${quoted(tip)}`,
    list('gravity', keys.gravity), list('reflected-inertia', rotors(of)),
    list('viscous-friction', keys.viscous_friction || model.viscous_friction),
    list('gear-stiffness', keys.gear_stiffness), list('gear-damping', keys.gear_damping),
    keys.gear_stiffness && keys.position_sensor === 'link' && '--position-sensor link',
    mass > 0 && list('payload',
      [mass, ...(center || [0, 0, 0]), ...(I ? [...diagonal(I), I[0][1], I[0][2], I[1][2]] : [])]),
    accepted && (accepted === true ? '--accept-inertias' : quoted(`--accept-inertias=${accepted.join(',')}`))];
}

/// Options of the gains, whose damping is a factor or a diagonal.
function gainOptions(design, stiffness, damping) {
  const prefix = design.mode === 'joint' ? 'joint-' : '', null_damping = nullDamping(design);
  return [`--${prefix}stiffness ${diagonal(stiffness).join(',')}`,
    'factor' in damping ? `--damping-factor ${damping.factor}` : `--${prefix}damping ${diagonal(damping).join(',')}`,
    ...(prefix ? [] : [
      design.null_stiffness.some(Boolean) && `--null-stiffness ${design.null_stiffness.join(',')}`,
      null_damping.some(Boolean) && `--null-damping ${null_damping.join(',')}`,
      ...Object.entries(projector(design)).map(([key, value]) => `--${key.replace('_', '-')} ${value}`),
      design.rotation === 'half-quaternion' && '--rotation half-quaternion',
      design.frame === 'tool' && '--frame tool'])];
}

export function command(of) {
  const {q, design} = of, {period, delay, cutoff, integral_time: integral} = design, {config, keys} = of.setup.robot;
  const prefix = design.mode === 'joint' ? 'joint_' : '';
  const [stiffness, damping] = ['stiffness', 'damping'].map((key) => design[prefix + key]);
  const diagonals = isDiagonal(stiffness) && ('factor' in damping || (Array.isArray(damping) && isDiagonal(damping)));
  if (!diagonals || design.null_damping?.ratio || design.inertia_blocks) {
    return notes(['The damping is a matrix: save "matrices for dashpot analyze" as system.json.']) +
      'dashpot analyze system.json\n';
  }
  const without = ['tool', 'include_off_chain'].filter((key) => keys[key] !== undefined);
  const loop = period > 0 ? [`--period ${period}`, delay && `--delay ${delay}`, cutoff && `--cutoff ${cutoff}`,
    design.difference_velocity && '--difference-velocity', integral && `--integral-time ${integral}`] : [];
  const gains = gainOptions(design, stiffness, damping);
  const words = ['dashpot audit', ...armOptions(of), `--q ${q.join(',')}`, ...gains, ...loop].filter(Boolean);
  return notes([config && `The arm as ${config} has it.`,
    without.length && `There is no option for its ${without.join(' and ')}: ${kDiffers}`]) +
    `${words.join(' \\\n    ')}\n`;
}

/// The 4 x 4 matrix of a frame.
function poseRows({position: [x, y, z], rpy}) {
  const [[cr, sr], [cp, sp], [cy, sy]] = rpy.map((angle) => [Math.cos(angle), Math.sin(angle)]);
  return [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
    [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y], [-sp, cp * sr, cp * cr, z], [0, 0, 0, 1]];
}

/// Arguments of Robot.from_urdf.
function robotArguments(of) {
  const {urdf, base, tip} = of.setup.robot, keys = {...armKeys(of), reflected_inertia: rotors(of)}, {payload} = keys;
  const named = ['gravity', 'accept_inertias', 'reflected_inertia', 'viscous_friction', 'coulomb_friction',
    'gear_damping', 'position_sensor'].filter((key) => keys[key])
    .map((key) => `${key}=${keys[key] === true ? 'True' : json(keys[key])}`);
  const gears = keys.gear_stiffness?.map((k) => (k === 'none' ? 'float("inf")' : k)).join(', ');
  const {mass, center, inertia} = payload || {};
  const carried = mass > 0 ? [`payload_mass=${mass}`, `payload_center=${json(center || [0, 0, 0])}`,
    inertia && `payload_inertia=${json(inertia)}`] : [];
  return [...[urdf, base, tip].map((word) => json(word)), ...named,
    keys.include_off_chain === false && 'include_off_chain=False', gears && `gear_stiffness=[${gears}]`, ...carried,
    keys.tool && `tool=${json(poseRows(keys.tool))}`].filter(Boolean).join(', ');
}

export function python(of) {
  const {q, design, answer} = of, {stiffness, damping} = answer.gains, joint = design.mode === 'joint';
  const [prefix, told] = joint ? ['joint', design.joint_damping] : ['task', design.damping], rest = design.null_damping;
  const gains = [`${prefix}_stiffness=${json(compact(joint ? design.joint_stiffness : stiffness))}`,
    told.ratio ? `${prefix}_damping_ratio=${told.ratio}` : `${prefix}_damping=${json(compact(damping))}`,
    ...(joint ? [] : [`null_stiffness=${json(design.null_stiffness)}`,
      rest.ratio ? `null_damping_ratio=${rest.ratio}` : `null_damping=${json(nullDamping(design))}`,
      `frame="${design.frame || 'base'}"`,
      ...Object.entries(projector(design)).map(([key, value]) => `${key}=${json(value)}`)])];
  return notes([
    answer.damping_level && answer.damping_level.share < 1 &&
      `The sampled loop leaves less of the ratio, which this call does not count: ${kDiffers}`,
    ...answer.refused.map(({key, reason}) => `refused: ${key}: ${reason}`)]) +
    `import dashpot\n\nrobot = dashpot.Robot.from_urdf(${robotArguments(of)})\n` +
    `modes = dashpot.closed_loop(robot, ${json(q)},\n    ${gains.join(',\n    ')}).modes\nprint(modes)\n`;
}
