// The controller's refusals and warnings of the edited design, and joints outside their limits.
import {$, element} from '../shared/dom.js';
import {isNumber, number, plain} from '../shared/numbers.js';

/// A reason for each joint outside its limits.
function outside(page) {
  return page.setup.arm.joints.flatMap(({name, lower, upper, prismatic}, i) => {
    const x = page.state.q[i], within = x >= (lower ?? -Infinity) - 1e-9 && x <= (upper ?? Infinity) + 1e-9;
    if (within) return [];
    const limits = [lower, upper].map((limit) => (isNumber(limit) ? number(limit) : 'none')).join(' to ');
    const degrees = !prismatic && Math.abs(x) > 2 * Math.PI ? ` Degrees are written as ${plain(x)} deg.` : '';
    return [`${name} at ${number(x)} ${page.unitOf(i)} is outside its limits, ${limits}.${degrees}`];
  });
}

/// {key, reason} of refusals by the program or the controller.
function refusals(problem, answer) {
  if (problem) return [{key: problem.split(':')[0], reason: problem}];
  return (answer ? answer.refused : []).map(({key, reason}) => ({key, reason: key === 'q' ? `Here ${reason}.`
    : `The controller refuses it: ${reason.startsWith(key) ? reason : `${key}: ${reason}`}.`}));
}

export function showRefusals(page) {
  const problem = page.problem[page.state.edited], answer = page.answer(), refused = refusals(problem, answer);
  const unknown = !problem && page.setup.rotors_unknown && !page.design().arm?.reflected_inertia;
  $('reads').textContent = unknown ? 'rotors unknown: fast modes and margin are computed without them' : '';
  const warned = (answer && !problem ? answer.warned : []).map(({reason}) => `Warning: ${reason}`);
  $('refused').replaceChildren(...[...refused.map(({reason}) => reason), ...outside(page), ...warned]
    .map((text) => element('li', {}, text)));
  for (const field of document.querySelectorAll('#design_panel [data-key]')) {
    const hit = refused.find(({key}) => key.replace(/^.*\./, '').replace(/^task_/, '') === field.dataset.key);
    field.classList.toggle('bad', !!hit);
    if (hit) field.title = hit.reason;
    else if (!field.classList.contains('matrix')) field.removeAttribute('title');
    for (const input of field.querySelectorAll('input, select')) {
      input.setAttribute('aria-invalid', !!hit || input.classList.contains('wrong'));
    }
  }
}
