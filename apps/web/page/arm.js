// The arm by its kinematics, turned by pointer or keys, with a mode's shape on top.
import {begin, colour, line, modeColour, number, say} from '/draw.js';

const multiply = (A, B) => A.map((row) => [0, 1, 2, 3].map((j) =>
  row[0] * B[0][j] + row[1] * B[1][j] + row[2] * B[2][j] + row[3] * B[3][j]));
const kSides = 14;  // of a joint's cylinder
const kIdentity = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];

function moved(joint, q) {
  const [x, y, z] = joint.axis, o = joint.origin;
  if (joint.prismatic) {
    return [[1, 0, 0, o[0] + q * x], [0, 1, 0, o[1] + q * y], [0, 0, 1, o[2] + q * z], [0, 0, 0, 1]];
  }
  const s = Math.sin(q), c = Math.cos(q), v = 1 - c;
  return [[c + x * x * v, x * y * v - z * s, x * z * v + y * s, o[0]],
    [y * x * v + z * s, c + y * y * v, y * z * v - x * s, o[1]],
    [z * x * v - y * s, z * y * v + x * s, c + z * z * v, o[2]], [0, 0, 0, 1]];
}
const column = (T, j) => [T[0][j], T[1][j], T[2][j]];

/// Points along the arm from base to tip, joints with their axes, and the frame of the tip.
export function kinematics(arm, q) {
  let T = kIdentity;
  const points = [[0, 0, 0]], joints = [];
  arm.joints.forEach((joint, i) => {
    const at = multiply(T, moved(joint, 0));
    const axis = joint.axis, R = T;
    joints.push({at: column(multiply(T, moved(joint, q[i])), 3), prismatic: joint.prismatic,
      axis: [0, 1, 2].map((r) => R[r][0] * axis[0] + R[r][1] * axis[1] + R[r][2] * axis[2])});
    points.push(column(at, 3), joints[i].at);
    T = multiply(multiply(T, moved(joint, q[i])), joint.frame);
    points.push(column(T, 3));
  });
  T = multiply(T, arm.tip);
  points.push(column(T, 3));
  return {points, joints, tip: T};
}

/// `changed` is called when the arm has to be drawn again because of pointer or keys.
export class ArmView {
  constructor(canvas, changed = () => {}) {
    this.canvas = canvas;
    this.changed = changed;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    this.turn = 0.75;
    this.tilt = 0.32;
    this.zoom = 1;
    this.reach = 0;
    let last = null;
    canvas.addEventListener('pointerdown', (e) => {
      last = [e.clientX, e.clientY];
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener('pointermove', (e) => {
      if (!last) return;
      this.orbit((e.clientX - last[0]) * 0.01, (e.clientY - last[1]) * 0.01);
      last = [e.clientX, e.clientY];
    });
    for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, () => { last = null; });
    canvas.addEventListener('wheel', (e) => {
      e.preventDefault();
      this.scale(Math.exp(-e.deltaY * 0.001));
    }, {passive: false});
    canvas.addEventListener('keydown', (e) => {
      const turns = {ArrowLeft: [-.1, 0], ArrowRight: [.1, 0], ArrowUp: [0, -.1], ArrowDown: [0, .1]}[e.key];
      if (turns) this.orbit(...turns);
      else if (e.key === '+' || e.key === '=') this.scale(1.1);
      else if (e.key === '-') this.scale(1 / 1.1);
      else return;
      e.preventDefault();
    });
  }
  orbit(turn, tilt) {
    this.turn -= turn;
    this.tilt = Math.min(1.5, Math.max(-0.2, this.tilt + tilt));
    this.changed();
  }
  scale(factor) {
    this.zoom = Math.min(6, Math.max(0.3, this.zoom * factor));
    this.changed();
  }

  /// `arm` is the chain of /setup, q a posture, `shape` {label, re, im, phase, amplitude} or null.
  /// `scene` may have `walls` [{point, normal, name, stiffness}], planes whose normal points to
  /// where the tip may be, which push back if they have a stiffness, N/m; `force` at the tip, N; `note`, said in the middle instead of an arm. Returns the
  /// tip's frame, or null.
  draw(arm, q, shape, {walls = [], force = null, note = ''} = {}) {
    const {c, w, h} = begin(this.canvas);
    if (note || !arm || !q || q.length !== arm.joints.length) {
      const said = note || (!arm ? 'no arm: start with --config to see it' : 'waiting for a posture');
      say(c, w, h, said);
      this.canvas.setAttribute('aria-label', said);
      return null;
    }
    const rest = kinematics(arm, q);
    const far = Math.max(...rest.points.map((p) => Math.hypot(...p)));
    this.reach = Math.max(this.reach * 0.999, far, 0.1);
    const project = this.projection(w, h, rest.points);
    this.ground(c, project);
    const behind = walls.map((wall, i) => this.wall(c, project, wall, column(rest.tip, 3), 14 + 15 * i));
    let tip = rest.tip;
    if (shape) {
      const size = Math.max(...shape.re.map((x, i) => Math.hypot(x, shape.im[i])), 1e-30);
      const at = (phase) => kinematics(arm, q.map((x, i) => x + shape.amplitude / size *
        (shape.re[i] * Math.cos(phase) - shape.im[i] * Math.sin(phase))));
      c.globalAlpha = 0.3;
      this.body(c, project, rest, true);
      c.globalAlpha = 1;
      c.strokeStyle = modeColour(shape.label);
      c.lineWidth = 1.5;
      c.beginPath();  // the way of the tip over a swing
      for (let i = 0; i <= 48; ++i) {
        const p = project(column(at(i * Math.PI / 24).tip, 3));
        c[i ? 'lineTo' : 'moveTo'](p[0], p[1]);
      }
      c.stroke();
      const there = at(shape.phase);
      this.body(c, project, there, false, typeof shape.label === 'number' ? modeColour(shape.label) : colour('accent'));
      tip = there.tip;
    } else {
      this.body(c, project, rest, false);
    }
    this.triad(c, project, tip);
    if (force) this.arrow(c, project, column(rest.tip, 3), force, 'springs');
    const there = behind.filter(Boolean);
    this.canvas.setAttribute('aria-label', `The arm${shape ? `, swinging in ${typeof shape.label === 'number' ? `mode ${shape.label}` : shape.label}` : ''}` +
      `${there.length ? `; ${there.join('; ')}` : ''}. Arrow keys turn it, plus and minus zoom.`);
    return rest.tip;
  }

  /// A part of a wall in front of the tip, if it is near; returns how far away it is, in words.
  wall(c, project, {point, normal, name, stiffness}, tip, row) {
    const distance = normal.reduce((sum, n, k) => sum + n * (tip[k] - point[k]), 0);
    if (!(Math.abs(distance) < this.reach)) return '';
    const foot = tip.map((x, k) => x - distance * normal[k]), [x, y, z] = normal;
    const other = Math.abs(z) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    let u = [y * other[2] - z * other[1], z * other[0] - x * other[2], x * other[1] - y * other[0]];
    u = u.map((k) => k / Math.hypot(...u));
    const v = [y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0]], half = 0.35 * this.reach;
    const corner = (a, b) => project(foot.map((f, k) => f + half * (a * u[k] + b * v[k])));
    c.beginPath();
    [[-1, -1], [1, -1], [1, 1], [-1, 1]].forEach(([a, b], i) => c[i ? 'lineTo' : 'moveTo'](...corner(a, b).slice(0, 2)));
    c.closePath();
    c.globalAlpha = 0.18;
    const kind = distance < 0 && stiffness === null ? 'bad' : 'accent';
    c.fillStyle = colour(kind);
    c.fill();
    c.globalAlpha = 1;
    c.strokeStyle = c.fillStyle = colour(kind);
    c.lineWidth = 1.2;
    c.stroke();
    const p = project(tip), f = project(foot);
    c.setLineDash([3, 3]);
    line(c, p[0], p[1], f[0], f[1]);
    c.setLineDash([]);
    const depth = number(1e3 * Math.abs(distance), 3), push = Math.max(0, -distance) * stiffness;
    const text = distance >= 0 ? `${name}: ${depth} mm away`
      : stiffness === null ? `${name}: ${depth} mm beyond it` : `${name}: pressed in by ${depth} mm, contact ${number(push, 3)} N`;
    c.textAlign = 'left';
    c.fillText(text, 4, row);
    if (push) this.arrow(c, project, tip, normal.map((n) => n * push), 'contact', 'accent');
    return text;
  }

  /// A force at the tip as an arrow, whose length grows with its logarithm from 1 N on.
  arrow(c, project, at, force, name, style = 'force') {
    const size = Math.hypot(...force);
    if (!(size >= 1)) return;
    const length = 0.12 * this.reach * Math.log10(10 * size);
    const a = project(at), b = project(at.map((x, k) => x + length * force[k] / size));
    c.strokeStyle = c.fillStyle = colour(style);
    c.lineWidth = 3;
    line(c, a[0], a[1], b[0], b[1]);
    const turn = Math.atan2(b[1] - a[1], b[0] - a[0]);
    c.beginPath();
    [[6, 0], [-6, 5], [-6, -5]].forEach(([x, y], i) => c[i ? 'lineTo' : 'moveTo'](
      b[0] + x * Math.cos(turn) - y * Math.sin(turn), b[1] + x * Math.sin(turn) + y * Math.cos(turn)));
    c.closePath();
    c.fill();
    const text = `${name} ${number(size, 3)} N`, wide = c.measureText(text).width;  // kept on the canvas, below what walls say
    const left = b[0] + 10 * Math.cos(turn) - wide * (1 - Math.cos(turn)) / 2;
    c.textAlign = 'left';
    c.fillText(text, Math.min(Math.max(left, 2), this.canvas.clientWidth - wide - 2), Math.max(b[1] + 16 * Math.sin(turn) + 4, 44));
  }

  projection(w, h, points) {
    const mean = [0, 1, 2].map((k) => (Math.min(...points.map((p) => p[k])) + Math.max(...points.map((p) => p[k]))) / 2);
    const f = this.focus = this.focus ? this.focus.map((x, k) => x + 0.1 * (mean[k] - x)) : mean;
    const ct = Math.cos(this.turn), st = Math.sin(this.turn), ck = Math.cos(this.tilt), sk = Math.sin(this.tilt);
    const distance = 4 * this.reach, size = 0.86 * Math.min(w, h) / this.reach * this.zoom;
    return (p) => {
      const x = p[0] - f[0], y = p[1] - f[1], z = p[2] - f[2];
      const side = -st * x + ct * y, depth = ct * x + st * y;
      const up = ck * z - sk * depth, near = ck * depth + sk * z;
      const k = size * distance / Math.max(distance - near, 0.1 * distance);
      return [w / 2 + k * side, h / 2 - k * up, near, k];
    };
  }

  ground(c, project) {
    c.strokeStyle = colour('grid');
    c.lineWidth = 1;
    const half = 0.75 * this.reach, step = half / 5;
    for (let i = -5; i <= 5; ++i) {
      line(c, ...project([i * step, -half, 0]).slice(0, 2), ...project([i * step, half, 0]).slice(0, 2));
      line(c, ...project([-half, i * step, 0]).slice(0, 2), ...project([half, i * step, 0]).slice(0, 2));
    }
  }

  body(c, project, pose, ghost, glow) {
    const thick = 0.05 * this.reach, parts = [];
    for (let i = 1; i < pose.points.length; ++i) {
      const a = project(pose.points[i - 1]), b = project(pose.points[i]);
      if (Math.hypot(a[0] - b[0], a[1] - b[1]) < 0.5) continue;
      const width = thick * (1 - 0.45 * i / pose.points.length) * a[3];
      parts.push({near: (a[2] + b[2]) / 2, draw: () => {
        c.lineCap = 'round';
        for (const [style, extra] of [[colour('edge'), 2], [colour('steel'), 0]]) {
          c.strokeStyle = style;
          c.lineWidth = width + extra;
          line(c, a[0], a[1], b[0], b[1]);
        }
        c.lineCap = 'butt';
      }});
    }
    pose.joints.forEach((joint, i) => {
      const r = thick * (0.85 - 0.35 * i / pose.joints.length);
      const ends = [-1, 1].map((s) => joint.at.map((x, k) => x + s * r * joint.axis[k]));
      parts.push({near: project(joint.at)[2] + r, draw: () => this.drum(c, project, joint, ends, r, glow)});
    });
    if (ghost) parts.forEach((p) => { p.near = 0; });
    parts.sort((a, b) => a.near - b.near).forEach((p) => p.draw());
  }

  /// A joint as a short cylinder along its axis.
  drum(c, project, joint, ends, r, glow) {
    const [x, y, z] = joint.axis;
    const other = Math.abs(z) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    let u = [y * other[2] - z * other[1], z * other[0] - x * other[2], x * other[1] - y * other[0]];
    const length = Math.hypot(...u) || 1;
    u = u.map((k) => k / length);
    const v = [y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0]];
    const ring = (end) => Array.from({length: kSides}, (_, i) => {
      const a = i * 2 * Math.PI / kSides;
      return project(end.map((k, m) => k + r * (Math.cos(a) * u[m] + Math.sin(a) * v[m])));
    });
    const rings = ends.map(ring).sort((a, b) => a[0][2] - b[0][2]);
    const trace = (points) => {
      c.beginPath();
      points.forEach((p, i) => c[i ? 'lineTo' : 'moveTo'](p[0], p[1]));
      c.closePath();
    };
    c.lineWidth = 1.2;
    c.strokeStyle = colour('edge');
    c.fillStyle = colour('steel');
    for (let i = 0; i < kSides; ++i) {  // the mantle
      trace([rings[0][i], rings[0][(i + 1) % kSides], rings[1][(i + 1) % kSides], rings[1][i]]);
      c.fill();
    }
    trace(rings[0]);
    c.fill();
    trace(rings[1]);
    c.fillStyle = glow || colour('joint');
    c.fill();
    c.stroke();
  }

  triad(c, project, T) {
    const at = column(T, 3), size = 0.09 * this.reach;
    c.lineWidth = 2;
    ['#d55e00', '#009e73', '#0072b2'].forEach((style, k) => {
      const end = project(at.map((x, i) => x + size * T[i][k])), p = project(at);
      c.strokeStyle = style;
      line(c, p[0], p[1], end[0], end[1]);
      c.fillStyle = colour('soft');
      c.textAlign = 'center';
      c.fillText('xyz'[k], p[0] + 1.3 * (end[0] - p[0]), p[1] + 1.3 * (end[1] - p[1]) + 4);
    });
  }
}
