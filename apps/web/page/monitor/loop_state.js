// The state of the loop in the frame that is shown: time, age, posture, poles, forces, gains.

const kSilent = 2;  // s without a message

/// Time of a frame since the first one, or in the log, s.
export const timeOf = (page, frame = page.frame) =>
  (page.setup.live ? (frame.utime - page.start) * 1e-6 : page.replay.time);

/// 'waiting' for a first message, 'running', 'silent', 'gone' with the server, or 'log'.
export function loopState(page) {
  if (!page.connected) return 'gone';
  if (!page.frame.messages) return 'waiting';
  if (!page.setup.live) return 'log';
  return age(page) > kSilent ? 'silent' : 'running';
}
export const isGap = (seconds) => seconds > kSilent;

const age = (page) => page.frame.age + (page.setup.live ? (performance.now() - page.arrived) * 1e-3 : 0);
export function ageText(page) {
  const s = Math.floor(age(page));
  return s < 120 ? `${s} s` : s < 7200 ? `${Math.floor(s / 60)} min` : `${Math.floor(s / 3600)} h`;
}

export const posture = ({frame}) => (frame.state || frame.modes || {}).joint_position;

/// The force of the Cartesian springs and dampers at the tip, N, or null.
export function springForce({frame: {state}}) {
  const force = state?.mode === 1 ? state.tip_wrench.slice(0, 3) : [null];
  return force.includes(null) ? null : force;
}

/// The present damping ratio wanted: of the loop's messages, or else of the configuration.
export function wantedRatio({setup, frame: {state}}) {
  if (state) return state.mode === 0 ? state.joint_damping_ratio : state.task_damping_ratio;
  return setup.wanted_ratio.cartesian;
}

/// The eigenvalues of the modes for PoleMap.
export function polesOf({frame: {modes}}) {
  return (modes ? modes.label : []).flatMap((label, i) => [0, 1].map((which) => ({label, which,
    re: modes.eigenvalue_real[i][which], im: modes.eigenvalue_imag[i][which], bound: modes.eigenvalue_bound[i]})))
    .filter(({re, im}) => Number.isFinite(re) && Number.isFinite(im));
}

/// The eigenvalues of modes that were identified from measurements.
export function identifiedPoles({identified}) {
  return (identified || []).flatMap(({natural_frequency: w, damping_ratio: z}) => {
    const im = z < 1 ? w * Math.sqrt(1 - z * z) : 0, split = z > 1 ? w * Math.sqrt(z * z - 1) : 0;
    return [1, -1].map((s) => ({re: -z * w + s * split, im: s * im}));
  });
}

/// Why the arm of the configuration cannot be drawn.
export function otherJoints({setup: {arm}, frame: {state, modes}}) {
  const n = (state || modes || {n: 0}).n;
  if (!n || !arm || n === arm.joints.length) return '';
  const own = `${arm.name} has ${arm.joints.length}`;
  return `other joints: the loop has ${n}, ${own}.\nStart with the --config of this loop.`;
}

/// Whether the modes of the loop match the configuration's gains.
export function hasGainsOfConfiguration({frame: {modes}, response}) {
  if (!modes || !response || modes.natural_frequency.length !== response.natural_frequency.length) return !modes;
  const sorted = (list) => list.filter((v) => v !== null).sort((a, b) => a - b);
  return ['natural_frequency', 'damping_ratio'].every((key) => {
    const a = sorted(modes[key]), b = sorted(response[key]);
    return a.length === b.length && a.every((v, i) => Math.abs(v - b[i]) <= 0.02 * Math.abs(b[i]));
  });
}

/// Ticks in a second, from ticks and times of the states.
export class TickRate {
  first = null;
  rate = null;
  note(state) {
    if (!state) return;
    if (!this.first || state.tick < this.first.tick || state.utime - this.first.utime > 1e7) this.first = state;
    const time = state.utime - this.first.utime;
    if (time > 1e6) this.rate = 1e6 * (state.tick - this.first.tick) / time;
  }
  /// The period of the loop, s: of the configuration, or as measured, or null.
  period({setup}) { return setup.period || (this.rate ? 1 / this.rate : null); }
}
