// Tables, alarms and legends of the page: what is said in numbers and words.
import {fixed, markElement, number, shapeText} from '/draw.js';

const $ = (id) => document.getElementById(id);
export function text(id, value) { if ($(id).textContent !== value) $(id).textContent = value; }
function set(node, key, value) { if (node[key] !== value) node[key] = value; }

/// Replaces the children of an element when `key` differs from the last time.
export function fill(id, key, make) {
  if ($(id).dataset.key === key) return false;
  $(id).dataset.key = key;
  $(id).replaceChildren(...make());
  return true;
}

/// The damping ratio wanted just now: what the loop says it designs for, or else the configuration.
export function wantedRatio({setup, frame: {state}}) {
  if (state) return state.mode === 0 ? state.joint_damping_ratio : state.task_damping_ratio;
  return setup.wanted_ratio.cartesian;
}

/// How a damping ratio is to be judged: 'good', 'bad', or '' where no ratio is wanted. Friction and
/// rounding may take 5 % of it.
export function judge(ratio, wanted) {
  if (ratio === null) return 'none';
  if (!(ratio > 0)) return 'bad';
  return wanted > 0 ? (ratio >= 0.95 * wanted ? 'good' : 'bad') : '';
}

const jointName = (setup, i) => (setup.arm && setup.arm.joints[i] ? setup.arm.joints[i].name : '');
/// "q1 = shoulder_pan_joint, ...", or nothing without a configuration.
const namesText = (setup) => (setup.arm ? setup.arm.joints.map((joint, i) => `q${i + 1} = ${joint.name}`).join('\n') : '');

function resize(rows, count, cells) {
  while (rows.rows.length > count) rows.deleteRow(-1);
  while (rows.rows.length < count) {
    const row = rows.insertRow();
    for (let i = 0; i < cells; ++i) row.insertCell();
  }
}

export function modeTable(page) {
  const {frame: {modes}, setup, chosen} = page, rows = $('rows'), wanted = wantedRatio(page);
  const count = modes ? modes.label.length : 0;
  text('modes_note', !modes ? 'none yet' : `${count}, and ${modes.zero_modes} zero; ` +
    `${['tracked', 'reused', 'solved directly'][modes.origin] || ''}${modes.status ? `; ${modes.status_text}` : ''}` +
    `${wanted > 0 ? `; wanted ratio ${number(wanted, 3)}` : '; no ratio is wanted'}`);
  resize(rows, count, 7);
  for (let i = 0; i < count; ++i) {
    const {cells} = rows.rows[i], f = modes.natural_frequency[i], bound = modes.natural_frequency_bound[i];
    const label = modes.label[i], soft = modes.kind[i] === 5;
    set(rows.rows[i], 'className', label === chosen ? 'chosen' : '');
    if (cells[0].dataset.label !== String(label)) {
      cells[0].dataset.label = label;
      cells[0].replaceChildren(markElement(label), ` ${label}`);
    }
    const texts = [number(f), number(f === null ? null : f / (2 * Math.PI), 3), number(modes.damping_ratio[i], 3),
      modes.kind_text[i], bound === null ? 'none' : number(bound, 2), shapeText(modes.shape_real[i], modes.shape_imag[i])];
    texts.forEach((value, k) => set(cells[k + 1], 'textContent', value));
    set(cells[3], 'className', soft ? '' : judge(modes.damping_ratio[i], wanted));
    set(cells[6], 'title', namesText(setup));
  }
}

export function jointTable({frame: {state}, setup}) {
  const rows = $('joints'), count = state ? state.n : 0;
  resize(rows, count, 6);
  const own = setup.arm && setup.arm.joints.length === count;
  for (let i = 0; i < count; ++i) {
    const {cells} = rows.rows[i], joint = own ? setup.arm.joints[i] : null, q = state.joint_position[i];
    const texts = [`q${i + 1}`, own ? jointName(setup, i) : '–', ...[q, state.reference_joint_position[i],
      state.joint_velocity[i]].map((v) => fixed(v, 4)), fixed(state.joint_torque[i], 3)];
    texts.forEach((value, k) => set(cells[k], 'textContent', value));
    set(cells[2], 'className', joint && (q < joint.lower || q > joint.upper) ? 'bad' : '');
    set(cells[2], 'title', joint ? `limits ${number(joint.lower)} and ${number(joint.upper)}` : '');
  }
}

export function alarms(page) {
  const {frame: {state, sampled, alarms: all}, setup} = page, none = '–', wanted = wantedRatio(page);
  const margin = setup.gain_margin || 1;
  const zero = (count) => [String(count), count ? 'bad' : 'good'];
  const cards = [
    [`smallest ratio ${!all.changes_of_ratio ? 'so far' : wanted > 0 ? 'since it is wanted' : 'since none is wanted'}${wanted > 0 ? `; wanted ${number(wanted, 3)}` : ''}`, number(all.smallest_ratio, 3), judge(all.smallest_ratio, wanted)],
    [`smallest gain margin${setup.gain_margin ? `; wanted ${number(margin, 3)}` : ''}`,
      all.smallest_margin === null ? (sampled ? '∞' : none) : `${number(all.smallest_margin, 3)} ×`,
      all.smallest_margin === null ? (sampled ? 'good' : 'none') : all.smallest_margin < 0.999 * margin ? 'bad' : 'good'],
    ['messages with a bound lost', ...zero(all.bounds_lost)],
    ['messages without modes', ...zero(all.modes_lost)],
    ['latched fault', state && state.fault ? state.fault_text.split(',')[0] : all.faults ? `${all.faults} before` : 'none',
      state && state.fault ? 'bad' : all.faults ? '' : 'good'],
    ['overruns', ...(state ? zero(state.overruns) : [none, 'none'])],
  ];
  fill('alarms', 'cards', () => cards.map(() => {
    const card = document.createElement('div');
    card.setAttribute('role', 'listitem');
    card.append(document.createElement('b'), document.createElement('span'));
    return card;
  }));
  cards.forEach(([name, value, kind], i) => {
    const card = $('alarms').children[i];
    set(card, 'className', kind);
    set(card.firstChild, 'textContent', value);
    set(card.lastChild, 'textContent', name);
  });
  const posture = all.worst_posture.map((q) => +q.toFixed(4)).join(',');
  set($('copy'), 'disabled', !posture);
  text('worst', posture ? `smallest ratio at --q ${posture}` : '');
}

/// Name and value of each row of a list.
export function pairs(id, items) {
  fill(id, JSON.stringify(items), () => items.flatMap(([name, said]) => ['dt', 'dd'].map((tag, i) =>
    Object.assign(document.createElement(tag), {textContent: i ? said : name}))));
}

export function loopNumbers({frame: {state}}, rate) {
  if (!state) return pairs('loop', [['loop', 'no state yet']]);
  const [x, y, z, ...turn] = state.tip_error, size = Math.hypot(...state.tip_wrench.slice(0, 3));
  const ratio = state.mode === 0 ? state.joint_damping_ratio : state.task_damping_ratio;
  pairs('loop', [
    ['tick', `${number(state.tick_time * 1e-3, 2)} µs, longest ${number(state.longest_tick_time * 1e-3, 3)} µs${rate ? `; ${Math.round(rate)} in a second` : ''}`],
    ['tip off by', `${(1e3 * Math.hypot(x, y, z)).toFixed(2)} mm, ${(Math.hypot(...turn) * 180 / Math.PI).toFixed(2)}°`],
    ['force of springs', state.mode === 0 ? 'joint mode: none at the tip' : `${fixed(size, 2)} N at the tip, before limits`],
    ['damping', ratio > 0 ? `designed for ratio ${number(ratio, 3)}${state.damping_level < 1 ? `, lowered to ${number(state.damping_level, 3)} of it` : ''}` : 'given as numbers'],
    ['payload', `${fixed(state.payload_mass, 3)} kg`],
    ['commands', `${state.commands_accepted} accepted, ${state.commands_rejected} refused; ${state.commander ? `sender ${state.commander} commands` : 'nobody commands'}`]]);
}

export function sampledNumbers({frame: {sampled}, setup}, period) {
  pairs('sampled', !sampled ? [['sampled loop', 'not analysed']] : [
    ['gain margin', sampled.gain_margin === null ? '∞' : `${number(sampled.gain_margin, 3)} ×`],
    ['largest |z|', sampled.spectral_radius === null ? '–' : sampled.spectral_radius.toFixed(6)],
    ...(setup.arm && setup.arm.missing_rotors ? [['rotors unknown', `${setup.arm.missing_rotors}: the margin is that of an arm without rotors`]] : []),
    ...(sampled.assumes_text.length ? [['assumes', sampled.assumes_text.join(', ')]] : []),
    ['period', period ? `${number(1e3 * period, 3)} ms` : '–']]);
}

/// A button for each mode and zero mode whose shape can be shown.
export function chips(page, choose) {
  const {frame: {modes}, response, chosen} = page;
  const zero = response ? response.zero_modes.length : 0;
  const labels = [...(modes ? modes.label : []), ...Array.from({length: zero}, (_, i) => `zero ${i + 1}`)];
  const focused = document.activeElement && document.activeElement.closest('#chips') ? document.activeElement.dataset.label : null;
  const fresh = fill('chips', `${labels}|${chosen}`, () => labels.map((label) => {
    const chip = document.createElement('button');
    chip.type = 'button';
    chip.append(...(typeof label === 'number' ? [markElement(label), ` mode ${label}`] : [label]));
    chip.setAttribute('aria-pressed', String(label === chosen));
    chip.dataset.label = label;
    chip.addEventListener('click', () => choose(label));
    return chip;
  }));
  if (fresh && focused) [...$('chips').children].find((chip) => chip.dataset.label === focused)?.focus();
}

function legendItem(mark, said) {
  const item = document.createElement('li');
  item.append(...(mark ? [mark, ' '] : []), said);
  return item;
}
export function legends({setup}, series, wanted) {
  const labels = [...series.modes.keys()].sort((a, b) => a - b);
  fill('legend', `${labels}`, () => labels.map((label) => legendItem(markElement(label, true), String(label))));
  const measured = (setup.identified || []).length > 0;
  fill('pole_legend', `${wanted > 0}|${measured}`, () => [legendItem(null, 'filled: proved; open: no bound'), legendItem(null, 'pale disc: the bound'),
    legendItem(null, 'trail: last 5 s'), ...(wanted > 0 ? [legendItem(null, '- - wanted ratio')] : []), ...(measured ? [legendItem(null, '× measured')] : [])]);
}
