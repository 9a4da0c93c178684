// The step response or release, and the receptance, of both designs.
import {$} from '../shared/dom.js';
import {drawResponses} from '../shared/response_plots.js';
import {kDesigns, kStyles} from './designs.js';

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
