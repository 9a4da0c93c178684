// The arm by its kinematics, turned by pointer or keys, with a mode's shape on top.
import {begin, line, say, trace} from './canvas.js';
import {listenToGestures} from './gestures.js';
import {along, column, dot, kAxes, kinematics, perpendiculars} from './kinematics.js';
import {modeColour} from './mode_marks.js';
import {number} from './numbers.js';
import {colour} from './theme.js';

const kSides = 14;  // of a joint's cylinder
const kFrameColours = ['#d55e00', '#009e73', '#0072b2'];

/// `changed` is called when pointer or keys require the arm to be drawn again.
export class ArmView {
  constructor(canvas, changed = () => {}) {
    Object.assign(this, {canvas, turn: 0.75, tilt: 0.32, zoom: 1, reach: 0});
    listenToGestures(canvas, changed, {
      drag: (dx, dy) => this.orbit(dx * 0.01, dy * 0.01),
      zoom: (factor) => { this.zoom = Math.min(6, Math.max(0.3, this.zoom * factor)); },
      arrow: (right, down) => this.orbit(right * 0.1, down * 0.1),
    }, {step: 1.1, wheel: 0.001, greedy: true});
  }
  orbit(turn, tilt) {
    this.turn -= turn;
    this.tilt = Math.min(1.5, Math.max(-0.2, this.tilt + tilt));
  }

  /// `arm` is the chain of /setup, q a posture, `shape` {label, re, im, phase, amplitude} or null. `scene` may have
  /// `walls` [{point, normal, name, stiffness}], planes whose normal points to where the tip may be, which push back if
  /// they have a stiffness, N/m; `force` at the tip, N; `note`, said in the middle instead of an arm. Returns the
  /// tip's frame, or null.
  draw(arm, q, shape, {walls = [], force = null, note = ''} = {}) {
    const {c, w, h} = begin(this.canvas);
    if (note || !arm || !q || q.length !== arm.joints.length) {
      const said = note || (!arm ? 'no arm: start with --config to see it' : 'waiting for a posture');
      say(c, w, h, said);
      this.canvas.setAttribute('aria-label', said);
      return null;
    }
    const rest = kinematics(arm, q), restTip = column(rest.tip, 3);
    this.reach = Math.max(this.reach * 0.999, ...rest.points.map((p) => Math.hypot(...p)), 0.1);
    const project = this.projection(w, h, rest.points);
    this.ground(c, project);
    const near = walls.map((wall, i) => this.wall(c, project, wall, restTip, 14 + 15 * i)).filter(Boolean);
    const pose = shape ? this.swing(c, project, arm, q, shape, rest) : rest;
    const glow = shape && (typeof shape.label === 'number' ? modeColour(shape.label) : colour('accent'));
    this.body(c, project, pose, glow);
    this.triad(c, project, pose.tip);
    if (force) this.arrow(c, project, restTip, force, 'springs');
    const mode = shape && (typeof shape.label === 'number' ? `mode ${shape.label}` : shape.label);
    this.canvas.setAttribute('aria-label', `The arm${mode ? `, swinging in ${mode}` : ''}` +
      `${near.length ? `; ${near.join('; ')}` : ''}. Arrow keys turn it, plus and minus zoom.`);
    return rest.tip;
  }

  /// The arm at rest, pale, and the way of its tip over a swing; returns the pose within it.
  swing(c, project, arm, q, {label, re, im, phase, amplitude}, rest) {
    const size = Math.max(...re.map((x, i) => Math.hypot(x, im[i])), 1e-30);
    const at = (angle) => kinematics(arm, q.map((x, i) =>
      x + amplitude / size * (re[i] * Math.cos(angle) - im[i] * Math.sin(angle))));
    c.globalAlpha = 0.3;
    this.body(c, project, rest, null, true);
    c.globalAlpha = 1;
    c.strokeStyle = modeColour(label);
    c.lineWidth = 1.5;
    trace(c, Array.from({length: 49}, (_, i) => project(column(at(i * Math.PI / 24).tip, 3))));
    c.stroke();
    return at(phase);
  }

  /// A part of a wall in front of the tip, if it is near; returns how far away it is, in words.
  wall(c, project, {point, normal, name, stiffness}, tip, row) {
    const distance = dot(normal, along(tip, -1, point)), half = 0.35 * this.reach;
    if (!(Math.abs(distance) < this.reach)) return '';
    const foot = along(tip, -distance, normal), [u, v] = perpendiculars(normal);
    const corner = ([a, b]) => project(along(along(foot, half * a, u), half * b, v));
    trace(c, [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(corner), true);
    c.globalAlpha = 0.18;
    c.strokeStyle = c.fillStyle = colour(distance < 0 && stiffness === null ? 'bad' : 'accent');
    c.fill();
    c.globalAlpha = 1;
    c.lineWidth = 1.2;
    c.stroke();
    c.setLineDash([3, 3]);
    line(c, ...project(tip).slice(0, 2), ...project(foot).slice(0, 2));
    c.setLineDash([]);
    const depth = number(1e3 * Math.abs(distance), 3), push = Math.max(0, -distance) * stiffness;
    const text = `${name}: ${distance >= 0 ? `${depth} mm away` : stiffness === null ? `${depth} mm beyond it`
      : `pressed in by ${depth} mm, contact ${number(push, 3)} N`}`;
    c.textAlign = 'left';
    c.fillText(text, 4, row);
    if (push) this.arrow(c, project, tip, normal.map((n) => n * push), 'contact', 'accent');
    return text;
  }

  /// A force at the tip as an arrow, whose length grows with its logarithm from 1 N on.
  arrow(c, project, at, force, name, style = 'force') {
    const size = Math.hypot(...force), length = 0.12 * this.reach * Math.log10(10 * size);
    if (!(size >= 1)) return;
    const [ax, ay] = project(at), [bx, by] = project(along(at, length / size, force));
    c.strokeStyle = c.fillStyle = colour(style);
    c.lineWidth = 3;
    line(c, ax, ay, bx, by);
    const turn = Math.atan2(by - ay, bx - ax), cos = Math.cos(turn), sin = Math.sin(turn);
    trace(c, [[6, 0], [-6, 5], [-6, -5]].map(([x, y]) => [bx + x * cos - y * sin, by + x * sin + y * cos]), true);
    c.fill();
    const text = `${name} ${number(size, 3)} N`, wide = c.measureText(text).width;
    const left = bx + 10 * cos - wide * (1 - cos) / 2, right = this.canvas.clientWidth - wide - 2;
    c.textAlign = 'left';
    c.fillText(text, Math.min(Math.max(left, 2), right), Math.max(by + 16 * sin + 4, 44));  // below what walls say
  }

  /// Returns the function from a point to x, y (px), how near it is, and how many px a metre has there.
  projection(w, h, points) {
    const middle = kAxes.map((k) => points.map((p) => p[k])).map((all) => (Math.min(...all) + Math.max(...all)) / 2);
    const f = this.focus = this.focus ? this.focus.map((x, k) => x + 0.1 * (middle[k] - x)) : middle;
    const {right, up, toward} = this.screen();
    const distance = 4 * this.reach, size = 0.86 * Math.min(w, h) / this.reach * this.zoom;
    return (p) => {
      const from = along(p, -1, f), near = dot(toward, from);
      const k = size * distance / Math.max(distance - near, 0.1 * distance);
      return [w / 2 + k * dot(right, from), h / 2 - k * dot(up, from), near, k];
    };
  }
  /// Directions of the screen as the arm sees them.
  screen() {
    const ct = Math.cos(this.turn), st = Math.sin(this.turn), ck = Math.cos(this.tilt), sk = Math.sin(this.tilt);
    return {right: [-st, ct, 0], up: [-sk * ct, -sk * st, ck], toward: [ck * ct, ck * st, sk]};
  }

  ground(c, project) {
    c.strokeStyle = colour('grid');
    c.lineWidth = 1;
    const half = 0.75 * this.reach;
    for (let i = -5; i <= 5; ++i) {
      const at = i * half / 5;
      line(c, ...project([at, -half, 0]).slice(0, 2), ...project([at, half, 0]).slice(0, 2));
      line(c, ...project([-half, at, 0]).slice(0, 2), ...project([half, at, 0]).slice(0, 2));
    }
  }

  /// The links and joints, the nearest last; a `ghost` in the order of the chain.
  body(c, project, {points, joints}, glow, ghost = false) {
    const thick = 0.05 * this.reach, parts = [];
    for (let i = 1; i < points.length; ++i) {
      const a = project(points[i - 1]), b = project(points[i]);
      if (Math.hypot(a[0] - b[0], a[1] - b[1]) < 0.5) continue;
      const width = thick * (1 - 0.45 * i / points.length) * a[3];
      parts.push({near: (a[2] + b[2]) / 2, draw: () => {
        c.lineCap = 'round';
        for (const [style, extra] of [['edge', 2], ['steel', 0]]) {
          c.strokeStyle = colour(style);
          c.lineWidth = width + extra;
          line(c, a[0], a[1], b[0], b[1]);
        }
        c.lineCap = 'butt';
      }});
    }
    joints.forEach((joint, i) => {
      const r = thick * (0.85 - 0.35 * i / joints.length);
      parts.push({near: project(joint.at)[2] + r, draw: () => this.drum(c, project, joint, r, glow)});
    });
    if (!ghost) parts.sort((a, b) => a.near - b.near);
    for (const part of parts) part.draw();
  }

  /// A joint as a short cylinder along its axis.
  drum(c, project, {at, axis}, r, glow) {
    const [u, v] = perpendiculars(axis);
    const ring = (side) => Array.from({length: kSides}, (_, i) => {
      const a = i * 2 * Math.PI / kSides;
      return project(along(along(along(at, side * r, axis), r * Math.cos(a), u), r * Math.sin(a), v));
    });
    const [back, front] = [-1, 1].map(ring).sort((a, b) => a[0][2] - b[0][2]);
    c.lineWidth = 1.2;
    c.strokeStyle = colour('edge');
    c.fillStyle = colour('steel');
    for (let i = 0; i < kSides; ++i) {  // the mantle
      trace(c, [back[i], back[(i + 1) % kSides], front[(i + 1) % kSides], front[i]], true);
      c.fill();
    }
    trace(c, back, true);
    c.fill();
    trace(c, front, true);
    c.fillStyle = glow || colour('joint');
    c.fill();
    c.stroke();
  }

  /// The axes of a frame.
  triad(c, project, T) {
    const at = column(T, 3), [x, y] = project(at);
    c.lineWidth = 2;
    kFrameColours.forEach((style, k) => {
      const [ex, ey] = project(along(at, 0.09 * this.reach, column(T, k)));
      c.strokeStyle = style;
      line(c, x, y, ex, ey);
      c.fillStyle = colour('soft');
      c.textAlign = 'center';
      c.fillText('xyz'[k], x + 1.3 * (ex - x), y + 1.3 * (ey - y) + 4);
    });
  }
}
