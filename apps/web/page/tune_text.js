// A design as text for other programs. `of` is {setup, q, design, answer}: what the server was
// asked, and what it said.

const round = (x) => Number(x.toPrecision(7));
const diagonal = (matrix) => matrix.map((row, i) => row[i]);
const asRows = (value) => (Array.isArray(value[0]) ? value : value.map((x, i) => value.map((_, j) => (i === j ? x : 0))));
const isDiagonal = (value) => !Array.isArray(value[0]) || value.every((row, i) => row.every((x, j) => i === j || x === 0));
const short = (value) => (!value ? null : isDiagonal(value) ? diagonal(asRows(value)) : value);
const kAxes = ['x', 'y', 'z'];

/// Stiffness and damping that act: half a quaternion's stiffness halved, a factor or ratio as the
/// matrix that it makes.
const acting = ({answer}) => answer.gains;
function nullDamping(design) {
  if (Array.isArray(design.null_damping)) return design.null_damping;
  return design.null_stiffness.map((k) => (design.null_damping.factor || 0) * Math.sqrt(k));
}
const notes = (lines) => lines.filter(Boolean).map((line) => `# ${line}\n`).join('');
const lossNote = (matrix) => matrix && !isDiagonal(matrix) && !matrix.every((row, i) => row.every((x, j) => i === j || Math.abs(x) < 1e-9 * Math.max(...diagonal(matrix).map(Math.abs))))
  && 'This form has no entries beside the diagonal: the modes differ from those on the page.';

/// What the keys of a configuration's `robot` say of the arm: those that the program was started
/// with, and what the page has in their place.
function armKeys({setup, design}) {
  const arm = design.arm || {}, keys = {...setup.robot.keys};
  for (const [key, value] of Object.entries(arm)) {
    if (value) keys[key] = key === 'gear_stiffness' ? value.map((k) => k || 'none') : value;
  }
  if (arm.reflected_inertia) delete keys.drives;
  if (!keys.gear_stiffness) delete keys.gear_damping;
  return keys;
}
/// The rotors' inertia that acts, or null where there is none.
function rotors({setup, design}) {
  const told = (design.arm || {}).reflected_inertia, left = setup.robot.keys.torque_loop_inertia_ratio;
  const acts = told ? told.map((x, i) => (left ? round(x * left[i]) : x)) : setup.model.reflected_inertia;
  return acts.some(Boolean) ? acts : null;
}

function configuration({setup, q, design, answer}) {
  const {stiffness, damping} = acting({answer});
  const gains = {}, robot = {urdf: setup.robot.urdf, base: setup.robot.base, tip: setup.robot.tip, ...armKeys({setup, design})};
  const pair = (told, K, C) => (told.ratio ? {stiffness: short(K), damping_ratio: told.ratio} : {stiffness: short(K), damping: short(C)});
  if (design.mode === 'joint') {
    gains.joint = pair(design.joint_damping, asRows(design.joint_stiffness), damping);
  } else {
    const K = stiffness;
    gains.task = {...pair(design.damping, K, damping), frame: design.frame || 'base'};
    gains.null_space = pair(design.null_damping, design.null_stiffness, nullDamping(design));
  }
  const loaded = setup.robot.config ? setup.designs[0] : {};
  const unusual = (key, usual, name = key) => (design[key] === usual && (loaded[key] === undefined || loaded[key] === usual) ? {} : {[name]: design[key]});
  const sampled = {...unusual('delay', 0), ...unusual('cutoff', 0), ...unusual('difference_velocity', false)};
  const sections = {robot, control: {period: design.period, mode: design.mode}, gains, limits: unusual('gain_margin', setup.usual_margin),
    integral: unusual('integral_time', 0, 'time'), analysis: Object.keys(sampled).length ? {sampled} : {}};
  const refused = answer.refused.map(({key, reason}) => (key === 'q' ? `Here ${reason}.` : `The controller refuses it: ${key}: ${reason}.`));
  const lines = Object.entries(sections).filter(([, value]) => Object.keys(value).length).map(([key, value]) => `${key}:\n` +
    Object.entries(value).map(([name, inner]) => `  ${name}: ${JSON.stringify(inner)}\n`).join(''));
  return notes([setup.robot.config && `These keys take the place of those of ${setup.robot.config}, which keeps its others.`, `q: ${JSON.stringify(q)}`, ...refused]) + lines.join('');
}

/// A word for a shell.
const quoted = (word) => (/^[\w./:,=@%+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);

/// Options of the programs that tell the arm.
function armOptions({setup, design}) {
  const keys = armKeys({setup, design}), words = [`--urdf ${quoted(setup.robot.urdf)} --base ${quoted(setup.robot.base)} --tip ${quoted(setup.robot.tip)}`];
  const list = (name, values) => values && words.push(`--${name} ${values.join(',')}`);
  list('reflected-inertia', rotors({setup, design}));
  list('viscous-friction', keys.viscous_friction || setup.model.viscous_friction);
  list('gear-stiffness', keys.gear_stiffness);
  list('gear-damping', keys.gear_damping);
  if (keys.gear_stiffness && keys.position_sensor === 'link') words.push('--position-sensor link');
  const {mass, center, inertia: I} = keys.payload || {};
  if (mass > 0) list('payload', [mass, ...(center || [0, 0, 0]), ...(I ? [...diagonal(I), I[0][1], I[0][2], I[1][2]] : [])]);
  if (keys.accept_inertias) words.push(keys.accept_inertias === true ? '--accept-inertias' : quoted(`--accept-inertias=${keys.accept_inertias.join(',')}`));
  return words;
}

function command(of) {
  const {setup, q, design} = of, words = armOptions(of);
  const without = ['tool', 'include_off_chain'].filter((key) => setup.robot.keys[key] !== undefined);
  const joint = design.mode === 'joint', told = joint ? design.joint_damping : design.damping;
  const stiffness = joint ? design.joint_stiffness : design.stiffness;
  const loop = design.period > 0 ? [`--period ${design.period}`, design.delay && `--delay ${design.delay}`, design.cutoff && `--cutoff ${design.cutoff}`,
    design.difference_velocity && '--difference-velocity', design.integral_time && `--integral-time ${design.integral_time}`].filter(Boolean) : [];
  const at = `--q ${q.join(',')}`;
  const plain = isDiagonal(stiffness) && (told.factor !== undefined || (Array.isArray(told) && isDiagonal(told)));
  if (!plain || (design.null_damping || {}).ratio || design.inertia_blocks) {
    return notes(['The damping is a matrix: save "matrices for dashpot analyze" as system.json.']) + 'dashpot analyze system.json\n';
  }
  const values = diagonal(asRows(stiffness)).join(',');
  const gains = [joint ? `--joint-stiffness ${values}` : `--stiffness ${values}`,
    told.factor !== undefined ? `--damping-factor ${told.factor}` : `--${joint ? 'joint-' : ''}damping ${diagonal(asRows(told)).join(',')}`];
  if (!joint) {
    if (design.null_stiffness.some(Boolean)) gains.push(`--null-stiffness ${design.null_stiffness.join(',')}`);
    if (nullDamping(design).some(Boolean)) gains.push(`--null-damping ${nullDamping(design).join(',')}`);
    if (design.null_projector === 'kinematic') gains.push('--null-projector kinematic');
    if (design.rotation === 'half-quaternion') gains.push('--rotation half-quaternion');
    if (design.frame === 'tool') gains.push('--frame tool');
  }
  return notes([setup.robot.config && `The arm as ${setup.robot.config} has it.`,
    without.length && `There is no option for its ${without.join(' and ')}: the modes differ from those on the page.`]) + ['dashpot audit', ...words, at, ...gains, ...loop].join(' \\\n    ') + '\n';
}

/// Diagonals of the task's gains for controllers that have no more.
function task(of, name) {
  const {stiffness, damping} = acting(of);
  if (of.design.mode === 'joint' || !stiffness || !damping) {
    return {text: `# ${name} has Cartesian gains: there are none in this design, or the posture is singular.\n`};
  }
  return {k: diagonal(stiffness).map(round), d: diagonal(damping).map(round), note: lossNote(damping) || lossNote(stiffness)};
}

const firstJoint = ({null_stiffness: all, null_damping: damping}) => (!all.every((x) => x === all[0]) || (Array.isArray(damping) && !damping.every((x) => x === damping[0]))) &&
  'The null space has one stiffness there: that of the first joint is given.';

function crisp(of) {
  const {text, k, d, note} = task(of, 'crisp');
  if (text) return text;
  const keys = (letter, values) => values.map((x, i) => `      task.${letter}_${i < 3 ? 'pos' : 'rot'}_${kAxes[i % 3]}: ${x.toString().includes('.') ? x : `${x}.0`}\n`).join('');
  const own = of.design.null_stiffness[0] || 0;
  return notes([note, d.some((x) => x <= 0) && 'A damping that is not positive becomes 2 sqrt(k) there.',
    firstJoint(of.design)]) +
    `cartesian_impedance_controller:\n    ros__parameters:\n${keys('k', k)}${keys('d', d)}      nullspace.stiffness: ${Number.isInteger(own) ? `${own}.0` : own}\n` +
    `      nullspace.projector_type: ${of.design.null_projector === 'kinematic' ? 'kinematic' : 'dynamic'}\n`;
}

function cartesianImpedance(of) {
  const {text, k, d, note} = task(of, 'Cartesian-Impedance-Controller');
  if (text) return text;
  const factors = d.map((x, i) => round(k[i] > 0 ? x / (2 * Math.sqrt(k[i])) : 0));
  const wrench = (v) => `\n  force: {x: ${v[0]}, y: ${v[1]}, z: ${v[2]}}\n  torque: {x: ${v[3]}, y: ${v[4]}, z: ${v[5]}}\n`;
  const own = of.design.null_stiffness[0] || 0, ownDamping = nullDamping(of.design)[0] || 0, {ratio} = of.design.null_damping;
  const factor = own > 0 ? round(ratio || ownDamping / (2 * Math.sqrt(own))) : 0;
  return notes([note, [...factors, factor].some((f) => f > 1) && 'It takes damping factors from 0 to 1: those above are cut off there.',
    firstJoint(of.design), ratio && own > 0 && 'A damping ratio of the null space has no counterpart there: the factor is that of an inertia of 1 kg m^2.',
    'A message cartesian_impedance_controller/ControllerConfig for set_config.']) +
    `cartesian_stiffness:${wrench(k)}cartesian_damping_factors:${wrench(factors)}nullspace_stiffness: ${own}\n` +
    `nullspace_damping_factor: ${factor}\nq_d_nullspace: [${of.q.join(', ')}]\n`;
}

function frankaRos(of) {
  const {text, k, d} = task(of, 'franka_ros');
  if (text) return text;
  const stated = k.map((x, i) => (i < 3 ? x : 2 * x));  // it acts on half of the rotation vector
  const mean = (from) => round((stated[from] + stated[from + 1] + stated[from + 2]) / 3);
  const other = d.some((x, i) => Math.abs(x - 2 * Math.sqrt(mean(i < 3 ? 0 : 3))) > 1e-6 * x) || stated.some((x, i) => Math.abs(x - mean(i < 3 ? 0 : 3)) > 1e-6 * x);
  return notes([firstJoint(of.design), other && 'It has one stiffness for translation and one for rotation, and damping is always 2 sqrt(stiffness): the modes differ from those on the page.']) +
    `translational_stiffness: ${mean(0)}\nrotational_stiffness: ${mean(3)}\nnullspace_stiffness: ${of.design.null_stiffness[0] || 0}\n`;
}

/// The 4 x 4 matrix of a frame.
function poseRows({position: [x, y, z], rpy}) {
  const [[cr, sr], [cp, sp], [cy, sy]] = rpy.map((angle) => [Math.cos(angle), Math.sin(angle)]);
  return [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x], [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y], [-sp, cp * sr, cp * cr, z], [0, 0, 0, 1]];
}

function python(of) {
  const {setup, q, design, answer} = of, {stiffness, damping} = acting(of), keys = {...armKeys(of), reflected_inertia: rotors(of)}, {payload} = keys;
  const options = ['gravity', 'accept_inertias', 'reflected_inertia', 'viscous_friction', 'coulomb_friction', 'gear_damping', 'position_sensor'].filter((key) => keys[key])
    .map((key) => `${key}=${keys[key] === true ? 'True' : JSON.stringify(keys[key])}`);
  if (keys.include_off_chain === false) options.push('include_off_chain=False');
  if (keys.gear_stiffness) options.push(`gear_stiffness=[${keys.gear_stiffness.map((k) => (k === 'none' ? 'float("inf")' : k)).join(', ')}]`);
  if (payload && payload.mass > 0) {
    options.push(`payload_mass=${payload.mass}`, `payload_center=${JSON.stringify(payload.center || [0, 0, 0])}`);
    if (payload.inertia) options.push(`payload_inertia=${JSON.stringify(payload.inertia)}`);
  }
  if (keys.tool) options.push(`tool=${JSON.stringify(poseRows(keys.tool))}`);
  const from = [setup.robot.urdf, setup.robot.base, setup.robot.tip].map((word) => JSON.stringify(word)).concat(options).join(', ');
  const joint = design.mode === 'joint', prefix = joint ? 'joint' : 'task', told = joint ? design.joint_damping : design.damping;
  const K = joint ? asRows(design.joint_stiffness) : stiffness;
  const gains = [`${prefix}_stiffness=${JSON.stringify(short(K))}`, told.ratio ? `${prefix}_damping_ratio=${told.ratio}` : `${prefix}_damping=${JSON.stringify(short(damping))}`];
  if (!joint) {
    gains.push(`null_stiffness=${JSON.stringify(design.null_stiffness)}`,
      design.null_damping.ratio ? `null_damping_ratio=${design.null_damping.ratio}` : `null_damping=${JSON.stringify(nullDamping(design))}`, `frame="${design.frame || 'base'}"`);
  }
  return notes([design.null_projector === 'kinematic' && design.null_stiffness.some(Boolean) && 'Here the null space has the dynamically consistent projector: the modes differ from those on the page.',
    answer.damping_level && answer.damping_level.share < 1 && 'The sampled loop leaves less of the ratio, which this call does not count: the modes differ from those on the page.',
    ...answer.refused.map(({key, reason}) => `refused: ${key}: ${reason}`)]) +
    `import dashpot\n\nrobot = dashpot.Robot.from_urdf(${from})\nmodes = dashpot.closed_loop(robot, ${JSON.stringify(q)},\n    ${gains.join(',\n    ')}).modes\nprint(modes)\n`;
}

export const kFormats = [
  {name: 'configuration of Dashpot', file: 'tuned.yaml', text: configuration},
  {name: 'matrices for dashpot analyze', file: 'system.json', text: ({answer}) => JSON.stringify(answer.system, null, 1).replace(/\[\s+([^[\]]*?)\s+\]/g, (_, inner) => `[${inner.replace(/\s+/g, ' ')}]`) + '\n'},
  {name: 'command', file: 'tuned.sh', text: command},
  {name: 'crisp_controllers', file: 'crisp.yaml', text: crisp},
  {name: 'Cartesian-Impedance-Controller', file: 'controller_config.yaml', text: cartesianImpedance},
  {name: 'franka_ros', file: 'compliance.yaml', text: frankaRos},
  {name: 'Python', file: 'tuned.py', text: python},
];
