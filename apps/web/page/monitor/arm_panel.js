// The arm with the swinging shape of the chosen mode.
import {$, setText} from '../shared/dom.js';
import {degrees, fixed, number} from '../shared/numbers.js';
import {reducedMotion} from '../shared/theme.js';
import {otherJoints, posture, springForce} from './loop_state.js';

const kZero = 'zero ';  // labels of zero modes begin so
const value = (id) => Number($(id).value);

/// The label and text of each mode and zero mode whose shape can be shown.
export function shapes({frame: {modes}, response}) {
  const zero = (response ? response.zero_modes : []).map((_, i) => `${kZero}${i + 1}`);
  return [...(modes ? modes.label : []).map((label) => ({label, text: `mode ${label}`})),
    ...zero.map((label) => ({label, text: label}))];
}

/// The present shape of the chosen mode for ArmView, with its frequency; or null.
function swing({chosen, frame: {modes}, response}) {
  if (chosen === null) return null;
  const phase = 2 * Math.PI * value('pace') * (reducedMotion() ? 0 : performance.now() * 1e-3);
  const swinging = {label: chosen, phase, amplitude: value('amplitude')};
  if (typeof chosen === 'string') {
    const row = response && response.zero_modes[Number(chosen.slice(kZero.length)) - 1];
    return row ? {...swinging, re: row, im: row.map(() => 0)} : null;
  }
  const i = modes ? modes.label.indexOf(chosen) : -1;
  if (i < 0 || modes.shape_real[i].includes(null)) return null;
  return {...swinging, re: modes.shape_real[i], im: modes.shape_imag[i], frequency: modes.natural_frequency[i]};
}

/// Draws the arm; returns whether a shape swings.
export function drawArm(page, view) {
  const {arm} = page.setup, shape = swing(page);
  page.tip = view.draw(arm, posture(page), shape,
    {walls: arm ? arm.walls : [], force: springForce(page), note: otherJoints(page)});
  return shape !== null && !reducedMotion();
}

export function showArmTexts(page) {
  const {arm} = page.setup, pace = value('pace'), shape = swing(page), count = arm ? arm.joints.length : 0;
  const slowed = shape && shape.frequency && !reducedMotion() ? shape.frequency / (2 * Math.PI) / pace : 0;
  setText('arm_note', !arm ? '' : `${arm.name}, ${count} joint${count === 1 ? '' : 's'}` +
    `${slowed ? `; slowed ${number(slowed, 2)} times` : ''}`);
  setText('amplitude_text', `${fixed(degrees(value('amplitude')), 0)}°`);
  setText('pace_text', `${fixed(pace, 2)} Hz`);
  $('pace_label').hidden = reducedMotion();
}
