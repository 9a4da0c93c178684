// The fields of stiffness and damping, at the tip, in the joints and in the null space.
import {rounded} from '../shared/numbers.js';
import {at} from './form_fields.js';
import {asRows, diagonal, kindOf, kTaskAxes} from './designs.js';

// Units and ends of the sliders.
const linear = (most, mostDamping) =>
  ({stiffness: {unit: 'N/m', low: 1, high: most}, damping: {unit: 'N s/m', low: 0.01, high: mostDamping}});
const angular = (most, mostDamping) =>
  ({stiffness: {unit: 'N m/rad', low: 0.1, high: most}, damping: {unit: 'N m s/rad', low: 0.00316, high: mostDamping}});
const kUsual = {ratio: {ratio: 0.7}, factor: {factor: 2}};
const kRatio = ['ratio', 'damping ratio'], kFactor = ['factor', 'factor of √stiffness'];
const kDiagonal = ['diagonal', 'diagonal'], kFull = ['full', 'full matrix'];

/// The words on which the form's fields depend; if they change, it is built again.
export function structure(design) {
  const gains = [design.stiffness, design.joint_stiffness, design.damping, design.joint_damping, design.null_damping];
  return [design.mode, design.null_projector, ...gains.map(kindOf)].join();
}

/// A slider of the ratio or factor that gives the damping.
const relative = (form, design, key, kind, unit) => form.slider({label: kind, key,
  ...(kind === 'ratio' ? {unit: '', low: 0.05, high: 2} : {unit, low: 0, high: 6}),
  get: () => design()[key][kind], set: (x) => { design()[key] = {[kind]: x}; }});

/// Stiffness and damping of task or joints; `names` and `ranges` belong to the entries.
function pair(form, page, {stiffness, damping, names, ranges}) {
  const design = () => page.design(), kind = kindOf(design()[damping]);
  const entries = (key, label, units) => (kindOf(design()[key]) === 'full'
    ? [form.matrix({label: `${label}, ${units}`, key, names, get: () => design()[key],
      set: (i, j, x) => { design()[key][i][j] = design()[key][j][i] = x; }})]
    : names.map((name, i) => form.slider({label: `${label} ${name}`, key, log: true, ...ranges[i][label],
      ...at(() => design()[key], i)})));
  return [
    form.choice({label: 'stiffness', key: `${stiffness}_kind`, options: [kDiagonal, kFull],
      get: () => kindOf(design()[stiffness]),
      set: (to) => { design()[stiffness] = (to === 'full' ? asRows : diagonal)(design()[stiffness]); }}),
    ...entries(stiffness, 'stiffness', 'N/m, N, N m/rad'),
    form.choice({label: 'damping', key: `${damping}_kind`,
      options: [[kRatio[0], `${kRatio[1]}, at every posture`], kFactor, kDiagonal, kFull],
      get: () => kindOf(design()[damping]), set: (to) => {
        const acts = page.actingDamping() || asRows(Array(names.length).fill(0));
        const now = acts.map((row) => row.map((x) => rounded(x, 6)));
        design()[damping] = kUsual[to] ? {...kUsual[to]} : to === 'full' ? now : diagonal(now);
      }}),
    form.button('Propose a diagonal', () => page.propose(damping, false)),
    form.button('Propose a matrix', () => page.propose(damping, true)),
    ...(kUsual[kind] ? [relative(form, design, damping, kind, '√kg')]
      : entries(damping, 'damping', 'N s/m, N s, N m s/rad'))];
}

function nullSpaceFields(form, design, n) {
  const kind = kindOf(design().null_damping), all = (key) => (x) => { design()[key] = Array(n).fill(x); };
  return [
    form.slider({label: 'null space', key: 'null_stiffness', unit: 'N m/rad', low: 0.01, high: 500, log: true,
      get: () => design().null_stiffness[0], set: all('null_stiffness')}),
    form.choice({label: 'its damping', key: 'null_damping_kind', options: [kRatio, kFactor, ['diagonal', 'given']],
      get: () => kindOf(design().null_damping),
      set: (to) => { design().null_damping = kUsual[to] ? {...kUsual[to]} : Array(n).fill(0); }}),
    kind !== 'diagonal' ? relative(form, design, 'null_damping', kind, '√kg m')
      : form.slider({label: 'damping', key: 'null_damping', unit: 'N m s/rad', low: 0.01, high: 100, log: true,
        get: () => design().null_damping[0], set: all('null_damping')}),
    form.choice({label: 'its projector', key: 'null_projector',
      options: [['dynamic', 'dynamically consistent'], ['kinematic', 'pseudo-inverse'],
        ['weighted', 'weighted pseudo-inverse'], ['none', 'none: in all joints']],
      ...at(design, 'null_projector', 'dynamic')}),
    ...(design().null_projector !== 'weighted' ? [] : [form.list({label: 'its weights', key: 'null_weights', unit: '1',
      count: n, ...at(design, 'null_weights', null)})]),
    form.check({label: '× inertia of tip', key: 'inertia_blocks', ...at(design, 'inertia_blocks', false)})];
}

/// Fields of the gains of the design that is edited.
export function gainFields(form, page) {
  const {joints} = page.setup.arm, design = () => page.design();
  const mode = form.choice({label: 'springs', key: 'mode',
    options: [['cartesian', 'at the tip'], ['joint', 'in the joints']], ...at(design, 'mode')});
  if (design().mode === 'joint') {
    return [mode, ...pair(form, page, {stiffness: 'joint_stiffness', damping: 'joint_damping',
      names: joints.map((_, i) => String(i + 1)),
      ranges: joints.map(({prismatic}) => (prismatic ? linear(1e5, 1e4) : angular(1e4, 300)))})];
  }
  return [mode, ...pair(form, page, {stiffness: 'stiffness', damping: 'damping', names: kTaskAxes,
    ranges: kTaskAxes.map((_, i) => (i < 3 ? linear(1e4, 1000) : angular(1000, 100)))}),
  form.choice({label: 'axes', key: 'frame', options: [['base', 'of the base'], ['tool', 'of the tool']],
    ...at(design, 'frame', 'base')}),
  form.choice({label: 'rotation error', key: 'rotation',
    options: [['vector', 'rotation vector'], ['half-quaternion', 'part of a quaternion: half of it']],
    ...at(design, 'rotation', 'vector')}),
  ...(joints.length >= 7 || design().null_stiffness.some(Boolean) ? nullSpaceFields(form, design, joints.length) : [])];
}
