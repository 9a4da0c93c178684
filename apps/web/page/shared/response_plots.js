// Magnitude and phase of receptances over frequency, on two plots that share their View.
import {degrees, isNumber} from './numbers.js';

/// `responses` are {omega, magnitude, phase, unit, natural_frequency, colour, name, dash}, of which the first has its
/// natural frequencies shown, unless others are given; `note` is said where there are none.
export function drawResponses(magnitude, phase, responses, {title, note, frequencies}) {
  if (!responses.length) {
    const empty = {title: '', x: {range: [0, 1]}, y: {}};
    magnitude.draw({...empty, empty: note});
    phase.draw({...empty, empty: '–'});
    return;
  }
  const [{unit, natural_frequency: own}] = responses, turns = responses.map((r) => r.phase.map(degrees));
  const range = [Math.min(...responses.map((r) => r.omega[0])), Math.max(...responses.map((r) => r.omega.at(-1)))];
  const lines = (frequencies || own).filter((f) => f > range[0]).map((value) => ({value}));
  const x = {range, log: true, text: ' rad/s'}, all = turns.flat().filter(isNumber);
  const curves = (values, name, after) => responses.map((r, i) =>
    ({x: r.omega, y: values(r, i), colour: r.colour, name: r.name ?? name, unit: after, width: 2, dash: r.dash}));
  magnitude.draw({title: `${title}, ${unit}`, x: {...x, bare: true}, y: {log: true}, lines,
    curves: curves((r) => r.magnitude, '|H|', ` ${unit}`)});
  phase.draw({title: 'phase, °; frequency, rad/s', x, lines, curves: curves((_, i) => turns[i], 'phase', '°'),
    y: {degrees: true, range: [Math.min(...all, -180), Math.max(...all, 5)]}});
}
