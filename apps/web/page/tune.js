// The page of `dashpot tune`: a state, what the server says of it, and drawings of both.
import {ArmView} from '/arm.js';
import {Plot, View} from '/curves.js';
import {followTheme, markElement, number, reducedMotion} from '/draw.js';
import {PoleMap} from '/poles.js';
import {dragTip} from '/tune_arm.js';
import {attend, numbers, plain, slider} from '/tune_form.js';
import {gainFields, loopFields, partFields, structure} from '/tune_gains.js';
import {Newest, Store, Workspace, post} from '/tune_state.js';
import {kFormats} from '/tune_text.js';

const $ = (id) => document.getElementById(id);
const kDesigns = ['a', 'b'], kColours = {a: 'accent', b: 'force'};
const kAxes = ['x', 'y', 'z', 'rx', 'ry', 'rz'];
const page = window.dashpot = {errors: [], answers: {a: null, b: null}, problem: {a: '', b: ''}, old: {a: false, b: false}, asked: {a: null, b: null}, chosen: null, timing: [], poles: []};
window.addEventListener('error', (e) => page.errors.push(e.message));
window.addEventListener('unhandledrejection', (e) => page.errors.push(String(e.reason)));

const setup = page.setup = await (await fetch('/setup')).json();
const store = page.store = new Store({q: setup.q, place: 'tip/0', motion: 'step', edited: 'a', a: setup.designs[0], b: setup.designs[1]}, (ended) => changed(ended));
const edit = (change, ended) => store.edit(change, ended);
const design = () => store.design();
const answer = (name = store.state.edited) => page.answers[name];

// Drawings. What has changed is drawn: an arm that swings leaves the rest as it is.
const stale = new Set();
const redraw = (...parts) => {
  if (!stale.size) requestAnimationFrame(paint);
  for (const part of parts) stale.add(part);
};
const draw = () => redraw('arm', 'poles', 'motion', 'workspace', 'texts');
const arm = new ArmView($('arm'), () => redraw('arm'));
const poles = new PoleMap($('poles'), () => redraw('poles'), (label) => choose(label));
const time = new Plot($('time'), () => redraw('motion'));
const shared = new View();
const magnitude = new Plot($('magnitude'), () => redraw('motion'), shared), phase = new Plot($('phase'), () => redraw('motion'), shared);
const ratios = new Plot($('ratios'), () => redraw('workspace')), margins = new Plot($('margins'), () => redraw('workspace'));
followTheme($('theme'), draw);
window.addEventListener('resize', draw);
page.tipOnScreen = dragTip(arm, () => ({arm: setup.arm, q: store.state.q}), (q, ended) => edit((state) => { state.q = q.map((x) => Number(x.toPrecision(6))); }, ended));

// Questions to the server. The answers of both designs are drawn in one frame, unless one takes long.
const kTogether = 15;  // ms
let later = 0;
const questions = Object.fromEntries(kDesigns.map((name) => [name, new Newest(setup.token, (heard, asked) => {
  page.problem[name] = heard.error || '';
  page.old[name] = !!heard.error;
  $('link').textContent = heard.gone ? heard.error : '';
  $('link').className = 'badge bad';
  if (!heard.error) page.answers[name] = heard;
  page.asked[name] = asked;
  clearTimeout(later);
  later = setTimeout(() => redraw('arm', 'poles', 'motion', 'texts'), kDesigns.some((one) => one !== name && questions[one].busy) ? kTogether : 0);
  if (kDesigns.every((one) => !questions[one].busy || !questions[one].next)) workspace.look({a: store.state.a, b: store.state.b});
})]));
const workspace = page.workspace = new Workspace(setup.token, () => redraw('workspace'));

// Fields
let fields = [], built = '';
const posture = setup.arm.joints.map((joint, i) => {
  const bounded = Number.isFinite(joint.lower) && Number.isFinite(joint.upper) && joint.lower !== null;
  const field = slider(edit, {label: joint.name, key: 'q', unit: joint.prismatic ? 'm' : 'rad', low: bounded ? joint.lower : -Math.PI, high: bounded ? joint.upper : Math.PI,
    get: () => store.state.q[i], set: (x) => { store.state.q[i] = x; }});
  $('posture').append(field.element);
  return field;
});
if (setup.postures.length) {
  const some = setup.postures, at = () => some.findIndex((q) => q.every((x, i) => x === store.state.q[i])) + 1;
  const field = slider(edit, {label: 'of the list', key: 'q', unit: `of ${some.length}`, low: 1, high: Math.max(some.length, 2), get: () => at() || 1,
    set: (k) => { store.state.q = [...some[Math.min(some.length, Math.max(1, Math.round(k))) - 1]]; }});
  $('posture').prepend(field.element);
  posture.push(field);
}
const unitOf = (i) => (setup.arm.joints[i] && setup.arm.joints[i].prismatic ? 'm' : 'rad');
const all = attend($('q'), {wanted: `${setup.q.length} numbers in ${[...new Set(setup.q.map((_, i) => unitOf(i)))].join(' or ')}; 45 deg is one`, get: () => store.state.q, take: (words) => {
  const q = numbers(words, unitOf);
  if (!q || q.length !== setup.q.length) return false;
  edit((state) => { state.q = q; }, true);
  return true;
}});
$('q').parentElement.append(all.note);
/// Takes the damping of the wanted ratio at this posture: the matrix for all modes, or a diagonal whose smallest ratio it is.
async function propose(key, full) {
  const name = store.state.edited, ratio = wanted();
  const ask = (damping) => post(setup.token, '/design', JSON.stringify({q: store.state.q, place: store.state.place, design: {...store.design(name), [key]: damping}}));
  const round = (x) => Number(x.toPrecision(6));
  let found = await ask({ratio});
  const singular = found.error ? '' : (found.refused.find(({key}) => key === 'q') || {reason: ''}).reason;
  let damping = found.error || singular ? null : found.gains.damping;
  for (let turn = 0; damping && !full && turn < 8; ++turn) {
    const diagonal = turn ? damping.map((x) => x * ratio / found.smallest_ratio) : damping.map((line, i) => line[i]);
    found = await ask(diagonal);
    damping = found.error || !(found.smallest_ratio > 0) ? null : diagonal;
    if (damping && Math.abs(found.smallest_ratio - ratio) < 1e-3) break;
  }
  page.problem[name] = damping ? '' : singular || found.error || 'damping: no diagonal gives the ratio';
  if (damping) edit((state) => { state[name][key] = damping.map((x) => (full ? x.map(round) : round(x))); }, true);
  else redraw('texts');
}
function build() {
  const key = `${store.state.edited} ${structure(design())}`;
  if (key === built) return;
  built = key;
  const acting = () => {
    const asked = page.asked[store.state.edited];  // the springs may have been others
    return answer() && asked.design.mode === design().mode ? answer().gains.damping : null;
  };
  const groups = {gains: gainFields(edit, design, setup.arm, acting, propose), loop: loopFields(edit, design), parts: partFields(edit, design, setup)};
  fields = Object.values(groups).flat();
  for (const [id, group] of Object.entries(groups)) $(id).replaceChildren(...group.map((field) => field.element));
}
function refresh() {
  for (const field of [...posture, ...fields]) field.refresh();
  if (!all.wrong() && document.activeElement !== $('q')) $('q').value = store.state.q.map(plain).join(', ');
  $('design_name').textContent = store.state.edited.toUpperCase();
  for (const button of $('which').children) button.setAttribute('aria-pressed', button.dataset.design === store.state.edited);
  $('undo').disabled = !store.past.length;
  $('redo').disabled = !store.future.length;
  $('place').value = store.state.place;
  $('motion').value = store.state.motion;
}

function changed(ended) {
  page.current = false;
  page.moved = workspace.moved = performance.now();
  build();
  refresh();
  for (const name of kDesigns) questions[name].ask('/design', {q: store.state.q, place: store.state.place, design: store.design(name)});
  redraw('arm');
}

// What is shown
function choose(label) {
  page.chosen = page.chosen === label ? null : label;
  redraw('arm', 'poles', 'texts');
}
const polesOf = (name) => (answer(name) ? answer(name).modes.flatMap((mode, i) => mode.eigenvalues.map(([re, im], which) => ({label: i + 1, which, re, im, bound: mode.error_bound}))) : []);
const other = () => (store.state.edited === 'a' ? 'b' : 'a');
const wanted = () => {
  const told = ['damping', 'joint_damping'].map((key) => design()[key].ratio).filter(Boolean);
  return told[0] || 0.7;
};

function paint(now) {
  const mine = answer(), mode = mine && page.chosen && mine.modes[page.chosen - 1];
  const shape = mode ? {label: page.chosen, re: mode.shape.map((z) => z[0]).slice(0, setup.q.length), im: mode.shape.map((z) => z[1]).slice(0, setup.q.length),
    phase: reducedMotion() ? 0 : now / 400, amplitude: 0.25} : null;
  const parts = {
    arm: () => {
      arm.draw(setup.arm, store.state.q, shape);
      if (shape && !reducedMotion()) setTimeout(() => redraw('arm'), 60);
    },
    poles: () => { page.poles = poles.draw(polesOf(store.state.edited), polesOf(other()).filter((p) => p.im >= 0), wanted(), page.chosen); },
    motion: drawMotion,
    texts: tell,
    workspace: drawWorkspace,
  };
  const asked = [...stale];
  stale.clear();
  for (const [name, paintPart] of Object.entries(parts)) if (asked.includes(name)) paintPart();
  const current = kDesigns.every((name) => page.asked[name] && JSON.stringify(page.asked[name].design) === JSON.stringify(store.design(name)) &&
    JSON.stringify(page.asked[name].q) === JSON.stringify(store.state.q));
  page.current = current;
  if (current && page.moved) {
    page.timing.push(performance.now() - page.moved);
    page.moved = 0;
  }
}

function drawMotion() {
  const shown = kDesigns.filter((name) => answer(name));
  const step = store.state.motion === 'step';
  const end = Math.max(...shown.map((name) => answer(name).release.time.at(-1)), 0.01);
  time.draw({title: `${step ? 'step' : 'release'}, of a distance of 1; time, s`, x: {range: [0, end], text: ' s'}, y: {around: true}, empty: 'no motion',
    levels: [{value: step ? 1.02 : 0.02, text: ''}, {value: step ? 0.98 : -0.02, text: '2 %'}],
    curves: shown.map((name) => ({x: answer(name).release.time, y: answer(name).release.value.map((r) => (step ? 1 - r : r)), colour: kColours[name], name: name.toUpperCase(),
      width: 2, dash: name === 'b' ? [7, 4] : []}))});
  const all = shown.map((name) => answer(name).frequency), unit = all.length ? all[0].unit : '';
  const range = all.length ? [Math.min(...all.map((f) => f.omega[0])), Math.max(...all.map((f) => f.omega.at(-1)))] : [0, 1];
  const over = (values, unitText) => shown.map((name, i) => ({x: all[i].omega, y: values(all[i]), colour: kColours[name], name: name.toUpperCase(), unit: unitText, width: 2,
    dash: name === 'b' ? [7, 4] : []}));
  const lines = all.length ? (answer() ? answer().frequency : all[0]).natural_frequency.filter((f) => f > range[0]).map((value) => ({value})) : [];
  const degrees = (f) => f.phase.map((v) => v * 180 / Math.PI), x = {range, log: true, text: ' rad/s'};
  magnitude.draw({title: `receptance, ${unit}`, x: {...x, bare: true}, y: {log: true}, lines, curves: over((f) => f.magnitude, ` ${unit}`), empty: 'no response'});
  phase.draw({title: 'phase, °; frequency, rad/s', x, y: {degrees: true, range: [Math.min(-180, ...all.flatMap(degrees)), Math.max(5, ...all.flatMap(degrees))]}, lines,
    curves: over(degrees, '°'), empty: ' '});
  $('motion_note').textContent = 'A whole line, B broken';
}

/// How many postures, in %, have less: at most 200 points of it, both ends among them.
function share(values) {
  const sorted = Float64Array.from(values).sort(), n = sorted.length, count = Math.min(n, 200);
  const at = Array.from({length: count}, (_, i) => Math.round(i * (n - 1) / Math.max(count - 1, 1)));
  return {x: at.map((i) => sorted[i]), y: at.map((i) => 100 * (i + 1) / n)};
}
function drawWorkspace() {
  for (const [plot, key, title] of [[ratios, 'smallest_ratio', 'postures with a smaller ratio, %; smallest ratio'], [margins, 'gain_margin', 'postures with less margin, %; gain margin']]) {
    const curves = kDesigns.map((name) => ({...share((workspace.found[name] || {[key]: []})[key]), colour: kColours[name], name: name.toUpperCase(), unit: ' %', width: 2,
      dash: name === 'b' ? [7, 4] : []})).filter((curve) => curve.x.length > 1);
    const all = curves.flatMap((curve) => [curve.x[0], curve.x.at(-1)]), low = Math.min(...all), high = Math.max(...all);
    const log = key === 'gain_margin' && low > 0;
    const room = log ? [low / 1.1, high * 1.1] : [low - 0.03 * (high - low || 1), high + 0.03 * (high - low || 1)];
    plot.draw({title, x: {range: curves.length ? room : [0, 1], log, text: ''}, y: {range: [0, 100]}, curves, empty: 'no postures yet',
      lines: key === 'smallest_ratio' ? [{value: 0}] : [{value: 1}].filter(() => log)});
  }
  const all = kDesigns.map((name) => workspace.found[name]).filter(Boolean);
  $('workspace_note').textContent = all.map((found, i) => `${kDesigns[i].toUpperCase()}: ${found.error || `${found.postures} postures`}`).join(', ');
  const buttons = kDesigns.flatMap((name) => Object.entries((workspace.found[name] || {worst: {}}).worst).map(([key, {value, q}]) => ({name, key, value, q})));
  const text = (b) => `${b.name.toUpperCase()}: worst ${b.key === 'gain_margin' ? 'margin' : 'ratio'} ${number(b.value, 3)}`;
  if ($('worst').dataset.shown === buttons.map(text).join()) return;
  $('worst').dataset.shown = buttons.map(text).join();
  $('worst').replaceChildren(...buttons.map((b) => {
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = text(b);
    button.addEventListener('click', () => edit((state) => {
      state.q = b.q.map((x) => Number(x.toPrecision(8)));
      state.edited = b.name;
    }, true));
    return button;
  }));
}

const cell = (text, kind = '') => {
  const element = document.createElement('td');
  element.textContent = text;
  if (kind) element.className = kind;
  return element;
};
const difference = (a, b) => (Number.isFinite(a) && Number.isFinite(b) ? (b > a ? '+' : '') + number(b - a, 3) : '–');
const row = (...cells) => {
  const element = document.createElement('tr');
  element.append(...cells);
  return element;
};

/// What the arms of the two designs do not share.
function armDifference() {
  const names = {payload: 'payload', reflected_inertia: 'rotors', viscous_friction: 'friction', gear_stiffness: 'gears', gear_damping: "gears' damping",
    position_sensor: 'where joints are measured'};
  const told = (name, key) => {
    const value = (store.design(name).arm || {})[key] || setup.robot.keys[key] || setup.model[key] || null;
    if (key === 'payload') return value && value.mass > 0 ? [value.mass, value.center || [0, 0, 0], value.inertia] : null;
    if (key === 'position_sensor') return value || 'motor';
    return value && value.map((x) => (x === 'none' ? null : x));
  };
  return Object.keys(names).filter((key) => JSON.stringify(told('a', key)) !== JSON.stringify(told('b', key))).map((key) => names[key]);
}

const kMostGood = 1.5; // a mode that is damped more creeps

/// Tables, chips, arrows and texts: all but the drawings.
function tell() {
  const [a, b] = kDesigns.map((name) => answer(name)), modes = (from, i) => (from && from.modes[i]) || null;
  const count = Math.max(a ? a.modes.length : 0, b ? b.modes.length : 0);
  const good = (mode, from) => (mode && mode.damping_ratio !== null ? (mode.damping_ratio >= 0.6 && mode.damping_ratio <= kMostGood && !unstable(from) && !from.refused.some(({key}) => key === 'q') ? 'good' : 'bad') : '');
  $('rows').replaceChildren(...Array.from({length: count}, (_, i) => {
    const ma = modes(a, i), mb = modes(b, i), first = cell('');
    first.append(markElement(i + 1), ` ${i + 1}`);
    const line = row(first, cell(ma ? number(ma.natural_frequency) : '–'), cell(ma ? number(ma.damping_ratio) : '–', good(ma, a)),
      cell(mb ? number(mb.natural_frequency) : '–'), cell(mb ? number(mb.damping_ratio) : '–', good(mb, b)), cell(difference(ma && ma.damping_ratio, mb && mb.damping_ratio)));
    line.classList.toggle('chosen', page.chosen === i + 1);
    return line;
  }));
  const totals = [['smallest ratio', (x) => x.smallest_ratio], ['fastest pole, 1/s', (x) => x.fastest_pole], ['gain margin', (x) => x.gain_margin],
    ['overshoot, %', (x) => (x.release.overshoot === null ? null : x.release.overshoot * 100)], ['settling to 2 %, s', (x) => x.release.settling_time], ['free motions', (x) => x.soft_or_zero, true]];
  $('totals').replaceChildren(...totals.map(([name, get, whole]) => {
    const values = [a, b].map((x) => (x ? get(x) : null)), text = (v) => (v === 1e6 && name === 'gain margin' ? 'above 1e6' : v === null ? '–' : whole ? String(v) : number(v));
    const bad = (v) => (name === 'gain margin' && v !== null && v < 1 ? 'bad' : '');
    return row(cell(name), ...values.map((v) => cell(text(v), bad(v))), cell(difference(...values)));
  }));
  $('limits').textContent = kDesigns.flatMap((name) => loopWords(name.toUpperCase(), answer(name))).map((text) => `${text}.`).join(' ');
  const different = armDifference();
  $('arms').textContent = different.length ? `A and B are on different arms: ${different.join(', ')}.` : '';
  document.body.classList.toggle('old', kDesigns.some((name) => page.old[name]));
  tellRefused();
  tellChips();
  tellArrows();
  tellText();
}

const unstable = ({gain_margin: margin}) => margin !== null && margin < 1;
/// What is to be said of the sampled loop of a design, and of its ratio there.
function loopWords(name, found) {
  if (!found) return [];
  const {limit, damping_level: level} = found;
  return [unstable(found) && `${name} is unstable in the sampled loop, so that its ratios and its motion are none that an arm would show`,
    level && !level.kept && `No share of the ratio of ${name} leaves the loop the margin asked for: its springs are too stiff, or the ratio too small for them`,
    level && level.share < 0.995 && `The ratio of ${name} is lowered to ${number(100 * level.share, 2)} % where the loop bears least`,
    found.assumes.length > 0 && `The loop of ${name} assumes: ${found.assumes.join(', ')}`,
    limit && `${name} is limited by a motion at ${number(limit.frequency, 3)} rad/s${limit.joint ? `, most of it in ${limit.joint}` : ''}`].filter(Boolean);
}

/// What is to be said of joints outside their limits.
function outside() {
  return setup.arm.joints.flatMap(({name, lower, upper, prismatic}, i) => {
    const x = store.state.q[i], bound = (limit) => (Number.isFinite(limit) ? limit : null), [low, high] = [bound(lower), bound(upper)];
    if ((low === null || x >= low - 1e-9) && (high === null || x <= high + 1e-9)) return [];
    const degrees = !prismatic && Math.abs(x) > 2 * Math.PI ? ` Degrees are written as ${plain(x)} deg.` : '';
    return [{key: 'q', reason: `${name} at ${number(x)} ${unitOf(i)} is outside its limits, ${[low, high].map((limit) => (limit === null ? 'none' : number(limit))).join(' to ')}.${degrees}`}];
  });
}

function tellRefused() {
  const problem = page.problem[store.state.edited], mine = answer();
  const all = problem ? [{key: problem.split(':')[0], reason: problem}] : mine ? mine.refused.map(({key, reason}) => ({key, reason: key === 'q' ? `Here ${reason}.` : `The controller refuses it: ${reason.startsWith(key) ? reason : `${key}: ${reason}`}.`})) : [];
  if (!problem && setup.rotors_unknown && !(design().arm || {}).reflected_inertia) {
    $('reads').textContent = 'rotors unknown: fast modes and margin are those without them';
  } else {
    $('reads').textContent = '';
  }
  const warned = (mine && !problem ? mine.warned : []).map(({reason}) => ({reason: `Warning: ${reason}`}));
  $('refused').replaceChildren(...all.concat(outside(), warned).map(({reason}) => {
    const item = document.createElement('li');
    item.textContent = reason;
    return item;
  }));
  const words = (key) => key.replace(/^.*\./, '').replace(/^task_/, '');
  for (const field of document.querySelectorAll('#design_panel [data-key]')) {
    const hit = all.find(({key}) => words(key) === field.dataset.key);
    field.classList.toggle('bad', !!hit);
    if (hit) field.title = hit.reason;
    else if (!field.classList.contains('matrix')) field.removeAttribute('title');
    for (const input of field.querySelectorAll('input, select')) input.setAttribute('aria-invalid', !!hit || input.classList.contains('wrong'));
  }
}

function tellChips() {
  const mine = answer();
  $('chips').replaceChildren(...(mine ? mine.modes : []).map((mode, i) => {
    const chip = document.createElement('button');
    chip.type = 'button';
    chip.append(markElement(i + 1), ` ${number(mode.natural_frequency, 3)} rad/s`);
    chip.setAttribute('aria-pressed', page.chosen === i + 1);
    chip.addEventListener('click', () => choose(i + 1));
    return chip;
  }));
  const zero = mine ? mine.zero_modes : [];
  $('zero').replaceChildren(...zero.flatMap((mode, i) => {
    const term = document.createElement('dt'), text = document.createElement('dd'), most = Math.max(...mode.map(Math.abs));
    term.textContent = zero.length > 1 ? `zero mode ${i + 1}` : 'zero mode';
    text.textContent = mode.map((x, k) => [k, x / most]).filter(([, x]) => Math.abs(x) > 0.15).map(([k, x]) => `joint ${k + 1} ${number(x, 2)}`).join(', ');
    return [term, text];
  }));
}

/// The step of an entry that an arrow stands for: a tenth of the stiffness on the diagonal there, a
/// quarter of the damping or, if that is more, of sqrt(stiffness).
function stepOf(matrix, stiffness, i, j) {
  const mean = (A) => Math.sqrt(Math.abs(A[i][i] * A[j][j]));
  return matrix === stiffness ? 0.1 * Math.max(mean(stiffness), 1) : 0.25 * Math.max(mean(matrix), Math.sqrt(mean(stiffness)));
}
function tellArrows() {
  const mine = answer(), asked = page.asked[store.state.edited], joint = design().mode === 'joint';
  const sensitivity = mine && (asked.design.mode === 'joint') === joint ? mine.sensitivity : null;
  const pick = $('arrow_mode'), names = mine ? mine.modes.map((_, i) => String(i + 1)) : [];
  if (pick.options.length !== names.length + 1) {
    pick.replaceChildren(...['smallest', ...names].map((name) => new Option(name === 'smallest' ? 'the smallest ratio' : `mode ${name}`, name)));
  }
  $('arrow_note').textContent = sensitivity ? 'change by a step: a quarter of a damping, a tenth of a stiffness; click to take it, with Shift the other way' : 'not for gains times inertia';
  let chosen = Number(pick.value) - 1;
  if (pick.value === 'smallest' && mine) {
    chosen = mine.modes.reduce((best, mode, i) => (mode.damping_ratio !== null && (best < 0 || mode.damping_ratio < mine.modes[best].damping_ratio) ? i : best), -1);
  }
  const labels = joint ? setup.arm.joints.map((_, i) => String(i + 1)) : kAxes;
  for (const which of ['damping', 'stiffness']) {
    const table = $(`arrows_${which}`), matrix = sensitivity && mine.gains[which];
    if (!matrix || chosen < 0) {
      table.replaceChildren();
      continue;
    }
    const head = document.createElement('tr');
    head.append(document.createElement('th'), ...labels.map((name) => {
      const th = document.createElement('th');
      th.textContent = name;
      return th;
    }));
    table.replaceChildren(head, ...labels.map((name, i) => {
      const th = document.createElement('th');
      th.textContent = name;
      return row(th, ...labels.map((_, j) => {
        const step = stepOf(matrix, mine.gains.stiffness, i, j), change = (k) => sensitivity[which][k][i][j] * step * (i === j ? 1 : 2);
        const now = change(chosen), box = cell(''), button = document.createElement('button');
        button.type = 'button';
        button.className = Math.abs(now) < 5e-4 ? 'none' : now > 0 ? 'up' : 'down';
        button.textContent = Math.abs(now) < 5e-4 ? '·' : `${now > 0 ? '↑' : '↓'}${number(Math.abs(now), 2)}`;
        button.title = `${which} ${labels[i]} ${labels[j]} = ${number(matrix[i][j])}; ${number(step, 2)} more changes the ratios of modes 1.. by ` +
          mine.modes.map((__, k) => (change(k) > 0 ? '+' : '') + number(change(k), 2)).join(', ');
        button.setAttribute('aria-label', button.title);
        button.addEventListener('click', (e) => take(which, matrix, i, j, e.shiftKey ? -step : step));
        box.append(button);
        return box;
      }));
    }));
  }
}
/// Adds a step to an entry of the matrix that acts, which then is given as a matrix.
function take(which, matrix, i, j, step) {
  const key = design().mode === 'joint' ? `joint_${which}` : which;
  const half = which === 'stiffness' && design().rotation === 'half-quaternion' && design().mode !== 'joint';
  const next = matrix.map((line, r) => line.map((x, c) => x * (half && r > 2 && c > 2 ? 2 : 1)));
  next[i][j] += step * (half && i > 2 && j > 2 ? 2 : 1);
  if (i !== j) next[j][i] = next[i][j];
  const clean = next.map((line) => line.map((x) => Number(x.toPrecision(6))));
  const flat = clean.every((line, r) => line.every((x, c) => r === c || x === 0));
  edit(() => { design()[key] = flat ? clean.map((line, r) => line[r]) : clean; }, true);
}

function tellText() {
  const asked = page.asked[store.state.edited], format = kFormats[$('format').value];
  if (!asked || !answer()) return;
  const text = format.text({setup, q: asked.q, design: asked.design, answer: answer()});
  if ($('text').value !== text) $('text').value = text;
}

// Buttons, choices and keys
$('source').textContent = setup.robot.config || `${setup.arm.name}, ${setup.robot.urdf.split('/').pop()}`;
$('source').title = `${setup.robot.urdf}, from ${setup.robot.base} to ${setup.robot.tip}`;
$('preset').replaceChildren(new Option('your own', ''), ...setup.presets.map(({name}) => new Option(name, name)));
$('preset').addEventListener('change', () => {
  const preset = setup.presets.find(({name}) => name === $('preset').value);
  if (preset) edit((state) => { state[state.edited] = {...state[state.edited], ...structuredClone(preset.design)}; }, true);
  $('preset').value = '';
});
$('place').replaceChildren(...kAxes.map((name, i) => new Option(`tip ${name}`, `tip/${i}`)), ...setup.arm.joints.map(({name}, i) => new Option(name, `joint/${i}`)));
for (const key of ['place', 'motion']) $(key).addEventListener('change', () => edit((state) => { state[key] = $(key).value; }, true));
$('format').replaceChildren(...kFormats.map(({name}, i) => new Option(name, i)));
for (const id of ['format', 'arrow_mode']) {
  $(id).addEventListener('change', () => {
    page.current = false;
    redraw('texts');
  });
}
const show = (name) => {
  edit((state) => { state.edited = name; }, true);
  draw();
};
for (const button of $('which').children) button.addEventListener('click', () => show(button.dataset.design));
$('copy_over').addEventListener('click', () => edit((state) => { state[other()] = structuredClone(state[state.edited]); }, true));
$('undo').addEventListener('click', () => store.undo());
$('redo').addEventListener('click', () => store.redo());
window.addEventListener('keydown', (e) => {
  const writes = /^(TEXTAREA|SELECT)$/.test(e.target.tagName) || (e.target.tagName === 'INPUT' && e.target.type === 'text');
  const key = e.key.toLowerCase();
  if ((e.ctrlKey || e.metaKey) && !writes && (key === 'z' || key === 'y')) {
    if (key === 'y' || e.shiftKey) store.redo();
    else store.undo();
    e.preventDefault();
  } else if (!writes && !e.ctrlKey && !e.metaKey && !e.altKey && kDesigns.includes(key)) {
    show(key);
  }
});
const done = (text) => { $('done').textContent = text; };
function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  done(`${name} is saved by the browser`);
}
const clip = (text, what) => navigator.clipboard.writeText(text).then(() => done(`${what} is copied`), () => done('the browser does not allow to copy'));
$('download').addEventListener('click', () => save(new Blob([$('text').value], {type: 'text/plain'}), kFormats[$('format').value].file));
$('copy').addEventListener('click', () => clip($('text').value, 'the text'));
$('address').addEventListener('click', () => {
  store.address();
  clip(location.href, 'the address');
});
$('picture').addEventListener('click', () => {
  const parts = ['poles', 'time', 'magnitude'].map($), sheet = document.createElement('canvas'), c = sheet.getContext('2d');
  sheet.width = Math.max(...parts.map((part) => part.width));
  sheet.height = parts.reduce((sum, part) => sum + part.height, 0);
  c.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--panel');
  c.fillRect(0, 0, sheet.width, sheet.height);
  parts.reduce((y, part) => {
    c.drawImage(part, 0, y);
    return y + part.height;
  }, 0);
  sheet.toBlob((blob) => save(blob, 'tuned.png'));
});
page.post = (path, body) => post(setup.token, path, JSON.stringify(body));

changed(true);
page.ready = true;
