// What to do when a fault has latched, or when nothing is heard of the loop.

// By the text of the fault before its comma, as controller::to_text has it.
const kFaults = {
  'springs restarted too often': 'Set-points or commands let the springs start again and again. Send set-points at a steady pace, and release once.',
  'gap between states': 'The host lost states or ticks. Look for other load on its computer, and whether its thread has real-time priority.',
  'loop at the wrong rate': 'The host calls the loop at another rate than control.period says. Make both agree.',
  collision: 'Free the arm, look for the cause, then release. If nothing was touched, the model lacks friction or a payload: dashpot check-model tells.',
  vibration: 'Gains are too stiff for this posture, delay or gears, or something shakes the arm. Lower the stiffness or look at the gain margin before you release.',
  'tip speed limit exceeded': 'Slow the set-points or motion.linear_velocity down, or raise limits.tip_velocity if it is meant to be faster.',
  'velocity limit exceeded': 'Slow the set-points down. If the arm ran away by itself, check signs of torque and velocity before you release.',
  'tip beyond a wall': 'Lead the tip back by hand or by joint set-points, then release. Goals beyond limits.walls are refused.',
  'position limit exceeded': 'A joint is outside its limits; it returns slowly once the fault is released. Keep goals inside.',
  'state frozen': 'The robot sends the same state again and again. Engage its brakes; check the driver and its connection.',
  'position and velocity contradict each other': 'Engage the brakes. Check units, signs and order of the joints in what the host passes on.',
  'time not after the last': 'Time stamps stand still or go backward. Use a monotonic clock of the robot.',
  'the brake does not stop the arm': "Engage the robot's brakes now. Check signs and units of torques, and the model's masses, before you release.",
  'state not finite': 'The host passes on a number that is none. Check the driver and filters of the velocity.',
  'state of wrong size': 'The host passes on another number of joints than the model has. Check base and tip of robot in the configuration.',
  'state jumped': 'A position leapt farther than the robot can move: an encoder slipped or wrapped, or states were lost. Compare it with the arm.',
  'torque not finite': 'Gains or set-points gave a number that is none. Report it with the log and the configuration.',
};
export const faultAdvice = (text) => Object.entries(kFaults).find(([begin]) => text.startsWith(begin))?.[1] ||
  'Find out what happened before you release.';

/// Fills a notice with a title, rows of text and a link, unless it says so already.
export function notice(section, title, rows, link) {
  const key = JSON.stringify([title, rows]);
  section.hidden = !title;
  if (section.dataset.key === key) return;
  section.dataset.key = key;
  const part = (name, text) => Object.assign(document.createElement(name), {textContent: text});
  const list = document.createElement('ul');
  list.append(...rows.map((row) => part('li', row)));
  const anchor = link ? Object.assign(part('a', link.text), {href: link.href, target: '_blank', rel: 'noopener'}) : '';
  section.replaceChildren(...(title ? [part('h2', title), list, anchor] : []));
}

/// What to check while nothing is heard.
export function silenceAdvice(state, source) {
  if (state === 'gone') {
    return ['dashpot monitor --web has ended, or the tunnel to it has: start it again. The page connects by itself.',
      'The arm may move on; what is shown is old.'];
  }
  if (state === 'log') return ['In the log no message came for that long.'];
  return ['Does the loop still run: dashpot run, dashpot drive, or the host with its publisher?',
    `Does it send to ${source}? The URL has to be the same in both (--lcm-url).`,
    'Across machines: ttl=1 in the URL, and a network and firewall that pass multicast.'];
}
