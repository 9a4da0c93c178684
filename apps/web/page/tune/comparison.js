// The table of both designs' modes, their numbers beside each other, and notes on their loops.
import {$, element} from '../shared/dom.js';
import {markElement} from '../shared/mode_marks.js';
import {isNumber, number} from '../shared/numbers.js';
import {drawResponses} from '../shared/response_plots.js';
import {kDesigns, kStyles, nameOf} from './designs.js';

const kMostGood = 1.5;  // a mode that is damped more creeps
const kLeastGood = 0.6;
const kArmKeys = {payload: 'payload', reflected_inertia: 'rotors', viscous_friction: 'friction',
  gear_stiffness: 'gears', gear_damping: "gears' damping", position_sensor: 'where joints are measured'};
/// Name, value of an answer, and how it is written.
const kTotals = [
  ['smallest ratio', (x) => x.smallest_ratio],
  ['fastest pole, 1/s', (x) => x.fastest_pole],
  ['gain margin', (x) => x.gain_margin, (x) => (x === 1e6 ? 'above 1e6' : number(x)), (x) => x !== null && x < 1],
  ['overshoot, %', (x) => (x.release.overshoot === null ? null : x.release.overshoot * 100)],
  ['settling to 2 %, s', (x) => x.release.settling_time],
  ['free motions', (x) => x.soft_or_zero, (x) => (x === null ? number(x) : String(x))]];
/// The same where the tip touches something.
const kTouch = [
  ['least ratio, touching', (x) => x.contact?.damping_ratio ?? null, number, (x) => x !== null && x < 0],
  ['bears touches up to, N/m', (x) => x.contact?.limit ?? null, (x) => (x === 1e9 ? 'above 1e9' : number(x))]];

const cell = (text, kind) => element('td', {class: kind || undefined}, text);
const difference = (a, b) => (isNumber(a) && isNumber(b) ? (b > a ? '+' : '') + number(b - a, 3) : number(null));
const unstable = ({gain_margin: margin}) => margin !== null && margin < 1;

/// The cells of a mode's frequency and ratio; a ratio is good only if the loop is stable and the posture not singular.
function modeCells(mode, answer) {
  if (!mode) return [cell(number(null)), cell(number(null))];
  const ratio = mode.damping_ratio, usable = !unstable(answer) && !answer.refused.some(({key}) => key === 'q');
  const kind = ratio === null ? '' : usable && ratio >= kLeastGood && ratio <= kMostGood ? 'good' : 'bad';
  return [cell(number(mode.natural_frequency)), cell(number(ratio), kind)];
}

/// The parts of the arm in which the two designs differ.
function differentParts({setup, state}) {
  const told = (name, key) => {
    const value = (state[name].arm || {})[key] || setup.robot.keys[key] || setup.model[key] || null;
    if (key === 'payload') return value?.mass > 0 ? [value.mass, value.center || [0, 0, 0], value.inertia] : null;
    if (key === 'position_sensor') return value || 'motor';
    return value && value.map((x) => (x === 'none' ? null : x));
  };
  const differs = (key) => JSON.stringify(told('a', key)) !== JSON.stringify(told('b', key));
  return Object.keys(kArmKeys).filter(differs).map((key) => kArmKeys[key]);
}

/// Notes on the sampled loop of a design, and on its ratio there.
function loopWords(name, found) {
  if (!found) return [];
  const {limit, damping_level: level, assumes, contact} = found;
  return [
    unstable(found) &&
      `${name} is unstable in the sampled loop: an arm would not show its ratios and its motion`,
    level && !level.kept && `No share of the ratio of ${name} leaves the loop the margin asked for: ` +
      'its springs are too stiff, or the ratio too small for them',
    level && level.share < 0.995 &&
      `The ratio of ${name} is lowered to ${number(100 * level.share, 2)} % by the gain margin of the loop`,
    assumes.length > 0 && `The loop of ${name} assumes: ${assumes.join(', ')}`,
    limit && `${name} is limited by a motion at ${number(limit.frequency, 3)} rad/s` +
      `${limit.joint ? `, most of it in ${limit.joint}` : ''}`,
    contact &&
      `${name}: lowest limit along (${contact.direction.map((x) => number(x, 2)).join(', ')})`].filter(Boolean);
}

export function fillComparison(page) {
  const both = kDesigns.map((name) => page.answer(name)), count = Math.max(...both.map((x) => x?.modes.length ?? 0));
  $('rows').replaceChildren(...Array.from({length: count}, (_, i) => {
    const modes = both.map((x) => x?.modes[i]);
    return element('tr', {class: page.chosen === i + 1 ? 'chosen' : ''},
      element('td', {}, markElement(i + 1), ` ${i + 1}`), ...modes.flatMap((mode, k) => modeCells(mode, both[k])),
      cell(difference(...modes.map((mode) => mode?.damping_ratio))));
  }));
  const totals = [...kTotals, ...(page.state.touches > 0 ? kTouch : [])];
  $('totals').replaceChildren(...totals.map(([name, get, write = number, isBad = () => false]) => {
    const values = both.map((x) => (x ? get(x) : null));
    const cells = values.map((x) => cell(write(x), isBad(x) && 'bad'));
    return element('tr', {}, cell(name), ...cells, cell(difference(...values)));
  }));
  const words = kDesigns.flatMap((name) => loopWords(nameOf(name), page.answer(name)));
  $('limits').textContent = words.map((text) => `${text}.`).join(' ');
  const different = differentParts(page);
  $('arms').textContent = different.length ? `A and B are on different arms: ${different.join(', ')}.` : '';
}

/// Draws the step response or release, and the receptance, of both designs.
export function drawMotion(page, {time, magnitude, phase}) {
  const shown = kDesigns.filter((name) => page.answer(name)), step = page.state.motion === 'step';
  const releases = shown.map((name) => page.answer(name).release);
  time.draw({title: `${step ? 'step' : 'release'}, of a distance of 1; time, s`, empty: 'no motion', y: {around: true},
    x: {range: [0, Math.max(...releases.map((release) => release.time.at(-1)), 0.01)], text: ' s'},
    levels: [{value: step ? 1.02 : 0.02, text: ''}, {value: step ? 0.98 : -0.02, text: '2 %'}],
    curves: releases.map((release, i) =>
      ({x: release.time, y: release.value.map((r) => (step ? 1 - r : r)), ...kStyles[shown[i]]}))});
  const mine = page.answer()?.frequency.natural_frequency;
  const responses = shown.map((name) => ({...page.answer(name).frequency, ...kStyles[name]}));
  drawResponses(magnitude, phase, responses, {title: 'receptance', note: 'no response', frequencies: mine});
  $('motion_note').textContent = 'A whole line, B broken';
}
