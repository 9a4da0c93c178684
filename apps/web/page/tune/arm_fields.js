// The fields of the posture, the loop and the arm: payload, rotors, gears, friction.
import {$} from '../shared/dom.js';
import {isNumber, plain} from '../shared/numbers.js';
import {at, readNumbers, textInput} from './form_fields.js';

/// Fields of the posture; the last writes all of it.
export function postureFields(form, page) {
  const {arm, postures, q} = page.setup, posture = () => page.state.q, setPosture = (to) => { page.state.q = to; };
  const fields = arm.joints.map(({name, prismatic, lower, upper}, i) => {
    const [low, high] = isNumber(lower) && isNumber(upper) ? [lower, upper] : [-Math.PI, Math.PI];
    return form.slider({label: name, key: 'q', unit: prismatic ? 'm' : 'rad', low, high, ...at(posture, i)});
  });
  if (postures.length) {
    const shown = () => postures.findIndex((one) => one.every((x, i) => x === posture()[i])) + 1;
    fields.unshift(form.slider({label: 'of the list', key: 'q', unit: `of ${postures.length}`,
      low: 1, high: Math.max(postures.length, 2), get: () => shown() || 1,
      set: (k) => setPosture([...postures[Math.min(postures.length, Math.max(1, Math.round(k))) - 1]])}));
  }
  $('posture').append(...fields.map((field) => field.element));
  const unitOf = (i) => page.unitOf(i), units = [...new Set(q.map((_, i) => unitOf(i)))].join(' or ');
  const all = textInput($('q'), {wanted: `${q.length} numbers in ${units}; 45 deg is one`, get: posture,
    text: (values) => values.map(plain).join(', '), take: (words) => {
      const values = readNumbers(words, unitOf);
      if (!values || values.length !== q.length) return false;
      page.edit(() => setPosture(values), true);
      return true;
    }});
  $('q').parentElement.append(all.note);
  return [...fields, all];
}

export function loopFields(form, page) {
  const design = () => page.design();
  const slider = (key, label, unit, low, high, log, more) =>
    form.slider({label, key, unit, low, high, log, ...at(design, key), ...more});
  return [
    slider('period', 'period', 'ms', 0.1, 20, true,
      {get: () => design().period * 1000, set: (x) => { design().period = x / 1000; }}),
    slider('delay', 'delay', 'ticks', 0, 10, false, {set: (x) => { design().delay = Math.round(x); }}),
    slider('cutoff', 'low-pass', 'Hz', 1, 1000, true),
    form.check({label: 'velocity differenced', key: 'difference_velocity', ...at(design, 'difference_velocity')}),
    slider('integral_time', 'integral', 's', 0.1, 100, true),
    slider('gain_margin', 'margin asked for', '', 1, 10, false)];
}

export function armFields(form, page) {
  const {setup} = page, loaded = setup.robot.keys, {published} = setup;
  const arm = () => (page.design().arm = page.design().arm || {});
  const set = (key, value) => {
    if (value === null) delete arm()[key];
    else arm()[key] = value;
  };
  const joints = (key, label, unit, none) => form.list({label, key, unit, count: setup.arm.joints.length, none,
    get: () => arm()[key] || null, set: (x) => set(key, x)});
  const carried = {mass: setup.model.payload, center: [0, 0, 0], ...loaded.payload}, {inertia} = carried;
  const payload = () => arm().payload || carried, measured = loaded.position_sensor || 'motor';
  /// Another mass with the same radii of gyration.
  const massOf = (mass) => ({...payload(), mass,
    ...(inertia && {inertia: inertia.map((line) => line.map((x) => x * mass / carried.mass))})});
  return [
    form.slider({label: `payload${inertia ? ', its inertia grows with it' : ''}`, key: 'payload', unit: 'kg',
      low: 0, high: 20, get: () => payload().mass, set: (x) => set('payload', massOf(x))}),
    form.list({label: 'its centre', key: 'payload', unit: 'm', count: 3, get: () => payload().center,
      set: (x) => set('payload', {...payload(), center: x || [0, 0, 0]})}),
    joints('reflected_inertia', 'rotors', 'kg m²'),
    ...(!published ? [] : [form.button(`Rotors as published for ${published.name}`,
      () => page.edit(() => set('reflected_inertia', published.reflected_inertia), true))]),
    joints('viscous_friction', 'friction', 'N m s/rad'),
    joints('gear_stiffness', 'gears', 'N m/rad', 'none'),
    joints('gear_damping', 'their damping', 'N m s/rad'),
    form.choice({label: 'joints measured', key: 'position_sensor',
      options: [['motor', 'at the motors'], ['link', 'at the links']],
      get: () => arm().position_sensor || measured, set: (x) => set('position_sensor', x === measured ? null : x)})];
}
