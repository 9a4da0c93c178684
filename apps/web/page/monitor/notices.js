// Faults of the loop, and what to do: a latched fault, silence, modes that lag.
import {$, element, set, setText} from '../shared/dom.js';
import {fixed} from '../shared/numbers.js';
import {ageText, isGap, loopState, timeOf} from './loop_state.js';

const kOldModes = 5;   // s that modes may lag behind the state

// By the text of the fault before its comma, as controller::to_text has it.
const kFaults = {
  'springs restarted too often':
    'Set-points or commands let the springs start again and again. Send set-points at a steady pace; release once.',
  'gap between states':
    'The host lost states or ticks. Look for other load on its computer, and whether it has real-time priority.',
  'loop at the wrong rate': 'The host calls the loop at another rate than control.period says. Make both agree.',
  collision:
    'Free the arm, look for the cause, then release. If nothing was touched, the model lacks friction or a payload: ' +
    'dashpot check-model shows which.',
  vibration:
    'Gains are too stiff for this posture, delay or gears, or something shakes the arm. Lower the stiffness or look ' +
    'at the gain margin before you release.',
  'tip speed limit exceeded':
    'Slow the set-points or motion.linear_velocity down, or raise limits.tip_velocity if it is meant to be faster.',
  'velocity limit exceeded':
    'Slow the set-points down. If the arm ran away by itself, check signs of torque and velocity before you release.',
  'tip beyond a wall':
    'Lead the tip back by hand or by joint set-points, then release. Goals beyond limits.walls are refused.',
  'position limit exceeded':
    'A joint is outside its limits; it returns slowly once the fault is released. Keep goals inside.',
  'state frozen':
    'The robot sends the same state again and again. Engage its brakes; check the driver and its connection.',
  'position and velocity contradict each other':
    'Engage the brakes. Check units, signs and order of the joints in what the host passes on.',
  'time not after the last': 'Time stamps stand still or go backward. Use a monotonic clock of the robot.',
  'the brake does not stop the arm':
    "Engage the robot's brakes now. Check signs and units of torques, and the model's masses, before you release.",
  'state not finite': 'The host passes on NaN or infinity. Check the driver and filters of the velocity.',
  'state of wrong size':
    'The host passes on another number of joints than the model has. Check base and tip in the configuration.',
  'state jumped':
    'A position jumped further than the robot can move. Check encoders for slip or wrap, and whether states were lost.',
  'torque not finite': 'Gains or set-points gave NaN or infinity. Report it with the log and the configuration.',
};
export const faultAdvice = (text) => Object.entries(kFaults).find(([begin]) => text.startsWith(begin))?.[1] ||
  'Find out what happened before you release.';

/// Fills a notice with a title, rows of text and a link, or hides it.
function fillNotice(id, {title, rows, link} = {}) {
  const section = $(id), key = JSON.stringify([title, rows]);
  section.hidden = !title;
  if (section.dataset.key === key) return;
  section.dataset.key = key;
  section.replaceChildren(...(!title ? [] : [element('h2', {}, title),
    element('ul', {}, ...rows.map((row) => element('li', {}, row))),
    link ? element('a', {href: link.href, target: '_blank', rel: 'noopener'}, link.text) : '']));
}

/// The notice while no messages come, or modes are old.
function silence(page, now, lag) {
  if (now === 'gone') {
    return {title: `No connection to the monitor: what is shown is ${ageText(page)} old`,
      rows: ['dashpot monitor --web has ended, or the tunnel to it has: start it again. The page connects by itself.',
        'The arm may move on; what is shown is old.']};
  }
  if (now === 'silent') {
    return {title: `The loop is silent for ${ageText(page)}: what is shown is old`,
      rows: ['Does the loop still run: dashpot run, dashpot drive, or the host with its publisher?',
        `Does it send to ${page.setup.source}? The URL has to be the same in both (--lcm-url).`,
        'Across machines: ttl=1 in the URL, and a network and firewall that pass multicast.']};
  }
  if (now === 'log' && isGap(page.frame.age)) {
    return {title: `No message for ${ageText(page)} before this time`,
      rows: ['In the log no message came for that long.']};
  }
  return lag <= kOldModes ? {} : {title: `Modes are ${Math.floor(lag)} s older than the state`,
    rows: ['Is the analysis on (analysis.where), and does its status say why it stopped?']};
}

const fault = ({fault_text: text, fault_tick: tick}) => ({title: `Fault: ${text}`,
  rows: [faultAdvice(text), `It latched at tick ${tick}. ` +
    'The brake acts until dashpot_release, dashpot_reset, or dashpot command --release.'],
  link: {text: 'docs/safety.md: faults', href: '/safety.md'}});

/// The badge in the header: whether messages come.
export function showLink(page, now = 'waiting') {
  const waits = now === 'waiting' && page.connected, kinds = {running: 'good', log: page.setup?.damage ? 'bad' : ''};
  setText('link', now === 'silent' ? `silent for ${ageText(page)}`
    : waits ? `${page.link}; waiting for messages` : page.link);
  $('link').className = `badge ${kinds[now] ?? (waits ? '' : 'bad')}`;
}

/// Shows the state of the loop: badges, clock, notices, and pale parts that are old.
export function showLoopState(page) {
  const {frame} = page, {state, modes} = frame, now = loopState(page), quiet = now === 'silent' || now === 'gone';
  const lag = state && modes ? (state.utime - modes.utime) * 1e-6 : 0, faulty = state && state.fault;
  showLink(page, now);
  document.querySelector('main').classList.toggle('gone', quiet);
  for (const id of ['pole_panel', 'mode_panel']) $(id).classList.toggle('gone', !quiet && lag > kOldModes);
  fillNotice('silence', silence(page, now, lag));
  fillNotice('fault', faulty ? fault(state) : {});
  setText('clock', frame.messages ? `${page.paused ? 'paused at ' : ''}${fixed(timeOf(page), 2)} s` : '');
  setText('status', !state ? '' : faulty ? `fault: ${state.fault_text}`
    : `${['joint', 'Cartesian'][state.mode] || ''} mode, ${state.status_text}`);
  set($('status'), 'className', `badge ${!state || quiet ? '' : faulty || state.status ? 'bad' : 'good'}`);
}
