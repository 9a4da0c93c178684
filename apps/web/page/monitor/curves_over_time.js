// Curves of modes and ticks over time: the last minute of a loop, or a whole log.
import {element, fill} from '../shared/dom.js';
import {markElement} from '../shared/mode_marks.js';
import {number, tickText} from '../shared/numbers.js';
import {isGap, timeOf, wantedRatio} from './loop_state.js';

const kMinute = 60;    // s of curves that a live page keeps
const kCurves = ['natural_frequency', 'damping_ratio'];

/// Values at times: `mode` is label -> {natural_frequency, damping_ratio}, lists as long as `time`; null: no such mode.
export class History {
  constructor(time = [], tick = [], status = [], mode = new Map()) { Object.assign(this, {time, tick, status, mode}); }

  append(t, {utime, state, modes}) {
    const last = this.time.at(-1);
    if (t <= last) return;
    if (utime && isGap(t - last)) this.append(t - 1e-3, {});
    this.time.push(t);
    this.tick.push(state ? state.tick_time * 1e-3 : null);
    this.status.push(state ? state.status : 0);
    const labels = modes ? modes.label : [], missing = () => Array(this.time.length - 1).fill(null);
    for (const label of labels) {
      if (!this.mode.has(label)) this.mode.set(label, {natural_frequency: missing(), damping_ratio: missing()});
    }
    for (const [label, curves] of this.mode) {
      for (const key of kCurves) curves[key].push(modes?.[key][labels.indexOf(label)] ?? null);
    }
    const old = this.time.findIndex((time) => time >= t - kMinute);
    if (!old) return;
    for (const list of [this.time, this.tick, this.status]) list.splice(0, old);
    for (const [label, curves] of this.mode) {
      for (const key of kCurves) curves[key].splice(0, old);
      if (kCurves.every((key) => curves[key].every((v) => v === null))) this.mode.delete(label);
    }
  }
  copy() { return new History(...structuredClone([this.time, this.tick, this.status, this.mode])); }
}

/// Draws `history` on the plots for frequencies, ratios and ticks, with the legends.
export function drawCurves(page, {frequency, ratio, ticks}, history, period) {
  const {setup, chosen} = page, {time, mode, tick, status} = history, cursor = timeOf(page), wanted = wantedRatio(page);
  const x = setup.live
    ? {range: [Math.max(cursor - kMinute, time[0] || 0), Math.max(cursor, 1)], text: ' s', reach: 2}
    : {range: [0, setup.duration || 1], text: ' s'};
  const levels = (key) => (setup.identified || []).map((m, i) => ({value: m[key], text: i ? '' : 'measured'}));
  const curves = (key) => [...mode].map(([label, values]) =>
    ({x: time, y: values[key], label, name: `mode ${label}`, width: label === chosen ? 3 : 1.6}));
  frequency.draw({title: 'natural frequency, rad/s; time, s', x, y: {log: true}, curves: curves('natural_frequency'),
    levels: levels('natural_frequency'), cursor, empty: 'natural frequency: no modes'});
  const goal = wanted > 0 ? [{value: wanted, text: `wanted ${number(wanted, 3)}`}] : [];
  ratio.draw({title: 'damping ratio; time, s', x, y: {log: 'auto'}, curves: curves('damping_ratio'),
    levels: [...goal, ...levels('damping_ratio')], cursor, empty: 'damping ratio: no modes'});
  const over = period && tick.some((v) => v > 0.5e6 * period) ? `, period ${tickText(1e6 * period)} µs` : '';
  ticks.draw({title: `tick, µs${over}; strip: status, orange if not ok; time, s`, x, y: {}, cursor, empty: 'no states',
    curves: [{x: time, y: tick, colour: 'accent', name: 'tick', unit: ' µs', width: 1}], strip: strip(time, status)});
  legends([...mode.keys()].sort((a, b) => a - b), wanted > 0, (setup.identified || []).length > 0);
}

/// The times at which the status changes to ok or from it.
function strip(time, status) {
  const all = status.map((s, i) => ({x: time[i], colour: s ? 'bad' : 'good'}));
  return all.filter(({colour}, i) => !i || i + 1 === all.length || colour !== all[i - 1].colour);
}

function legends(labels, wanted, measured) {
  fill('legend', `${labels}`, () => labels.map((label) => element('li', {}, markElement(label, true), ` ${label}`)));
  const said = ['filled: proved; open: no bound', 'pale disc: the bound', 'trail: last 5 s',
    wanted && '- - wanted ratio', measured && '× measured'].filter(Boolean);
  fill('pole_legend', `${said}`, () => said.map((text) => element('li', {}, text)));
}
