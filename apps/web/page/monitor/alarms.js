// Alarms as cards, the worst posture to copy, and the numbers of the loop.
import {$, element, fill, fillPairs, listen, set, setText} from '../shared/dom.js';
import {degrees, fixed, number} from '../shared/numbers.js';
import {wantedRatio} from './loop_state.js';
import {judge} from './tables.js';

const kNone = '–';
const goal = (wanted) => (wanted > 0 ? `; wanted ${number(wanted, 3)}` : '');
const count = (n) => [String(n), n ? 'bad' : 'good'];

/// Cards {name, value, kind}.
function cards(page) {
  const {frame: {state, sampled, alarms}, setup} = page, wanted = wantedRatio(page), margin = setup.gain_margin || 1;
  const since = !alarms.changes_of_ratio ? 'so far' : wanted > 0 ? 'since it is wanted' : 'since none is wanted';
  const {smallest_ratio: ratio, smallest_margin: least} = alarms, fault = state && state.fault;
  return [
    [`smallest ratio ${since}${goal(wanted)}`, number(ratio, 3), judge(ratio, wanted)],
    [`smallest gain margin${goal(setup.gain_margin)}`,
      ...(least !== null ? [`${number(least, 3)} ×`, least < 0.999 * margin ? 'bad' : 'good']
        : sampled ? ['∞', 'good'] : [kNone, 'none'])],
    ['messages with a bound lost', ...count(alarms.bounds_lost)],
    ['messages without modes', ...count(alarms.modes_lost)],
    ['latched fault', fault ? state.fault_text.split(',')[0] : alarms.faults ? `${alarms.faults} before` : 'none',
      fault ? 'bad' : alarms.faults ? '' : 'good'],
    ['overruns', ...(state ? count(state.overruns) : [kNone, 'none'])],
  ];
}

export function fillAlarms(page) {
  const all = cards(page);
  fill('alarms', 'cards', () => all.map(() => element('div', {role: 'listitem'}, element('b'), element('span'))));
  all.forEach(([name, value, kind], i) => {
    const card = $('alarms').children[i];
    set(card, 'className', kind);
    set(card.firstChild, 'textContent', value);
    set(card.lastChild, 'textContent', name);
  });
  const posture = page.frame.alarms.worst_posture.map((q) => +q.toFixed(4)).join(',');
  set($('copy'), 'disabled', !posture);
  setText('worst', posture ? `smallest ratio at --q ${posture}` : '');
}

/// Lets a button copy the worst posture, or select it if the browser does not allow copying.
export function copyWorstPosture(page) {
  listen('click', {copy: async () => {
    try {
      await navigator.clipboard.writeText(page.frame.alarms.worst_posture.map((q) => +q.toFixed(6)).join(','));
      setText('copied', 'copied, rad');
    } catch {
      getSelection().selectAllChildren($('worst'));
      setText('copied', 'selected: copy it with Ctrl-C');
    }
  }});
}

export function fillLoopNumbers(page, rate) {
  const {state} = page.frame;
  if (!state) {
    fillPairs('loop', [['loop', 'no state yet']]);
    return;
  }
  const [x, y, z, ...turn] = state.tip_error, joint = state.mode === 0, level = state.damping_level;
  const ratio = wantedRatio(page), force = Math.hypot(...state.tip_wrench.slice(0, 3));
  fillPairs('loop', [
    ['tick', `${number(state.tick_time * 1e-3, 2)} µs, longest ${number(state.longest_tick_time * 1e-3, 3)} µs` +
      `${rate ? `; ${Math.round(rate)} in a second` : ''}`],
    ['tip off by', `${fixed(1e3 * Math.hypot(x, y, z), 2)} mm, ${fixed(degrees(Math.hypot(...turn)), 2)}°`],
    ['force of springs', joint ? 'joint mode: none at the tip' : `${fixed(force, 2)} N at the tip, before limits`],
    ['damping', ratio > 0 ? `designed for ratio ${number(ratio, 3)}` +
      `${level < 1 ? `, lowered to ${number(level, 3)} of it` : ''}` : 'given as numbers'],
    ['energy tank', state.energy_store === null ? 'none' : `${number(state.energy_store, 3)} J` +
      `${state.spring_share < 1 ? `, springs weakened to ${number(state.spring_share, 3)}` : ''}`],
    ['payload', `${fixed(state.payload_mass, 3)} kg`],
    ['commands', `${state.commands_accepted} accepted, ${state.commands_rejected} refused; ` +
      `${state.commander ? `sender ${state.commander} commands` : 'no commander'}`]]);
}

export function fillSampledNumbers({frame: {sampled}, setup: {arm}}, period) {
  const missing = arm && arm.missing_rotors, assumed = sampled ? sampled.assumes_text : [];
  fillPairs('sampled', !sampled ? [['sampled loop', 'not analysed']] : [
    ['gain margin', sampled.gain_margin === null ? '∞' : `${number(sampled.gain_margin, 3)} ×`],
    ['largest |z|', fixed(sampled.spectral_radius, 6)],
    ...(missing ? [['rotors unknown', `${missing}: the margin is computed for an arm without rotors`]] : []),
    ...(assumed.length ? [['assumes', assumed.join(', ')]] : []),
    ['period', period ? `${number(1e3 * period, 3)} ms` : kNone]]);
}
