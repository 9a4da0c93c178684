// Dragging the tip: the posture that brings it there with its orientation kept, by damped least squares.
import {kinematics} from '/arm.js';

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/// Solves A x = b, k x k and positive definite, by elimination.
function solve(A, b) {
  const k = b.length, rows = A.map((row, i) => [...row, b[i]]);
  for (let i = 0; i < k; ++i) {
    for (let j = i + 1; j < k; ++j) {
      const f = rows[j][i] / rows[i][i];
      for (let m = i; m <= k; ++m) rows[j][m] -= f * rows[i][m];
    }
  }
  const x = Array(k).fill(0);
  for (let i = k - 1; i >= 0; --i) {
    x[i] = (rows[i][k] - rows[i].slice(i + 1, k).reduce((sum, a, m) => sum + a * x[i + 1 + m], 0)) / rows[i][i];
  }
  return x;
}

/// Returns the posture near q whose tip is at `goal` (m) with the rotation of `frame`, or as near as
/// limits and reach allow.
export function reach(arm, q, goal, frame) {
  let found = [...q];
  for (let round = 0; round < 12; ++round) {
    const {joints, tip} = kinematics(arm, found);
    const at = [0, 1, 2].map((r) => tip[r][3]);
    const column = (T, j) => [0, 1, 2].map((r) => T[r][j]);
    const turn = [0, 1, 2].map((j) => cross(column(tip, j), column(frame, j)));  // twice the small turn
    const error = [0, 1, 2].map((r) => goal[r] - at[r]).concat([0, 1, 2].map((r) => 0.5 * (turn[0][r] + turn[1][r] + turn[2][r])));
    if (Math.hypot(...error) < 1e-6) break;
    const J = joints.map(({at: place, axis, prismatic}) => (prismatic ? [...axis, 0, 0, 0]
      : [...cross(axis, at.map((x, r) => x - place[r])), ...axis]));
    const A = error.map((_, i) => error.map((__, j) => J.reduce((sum, col) => sum + col[i] * col[j], i === j ? 1e-4 : 0)));
    const y = solve(A, error);
    const step = J.map((col) => col.reduce((sum, a, i) => sum + a * y[i], 0));
    const scale = Math.min(1, 0.3 / Math.max(...step.map(Math.abs), 1e-9));
    found = found.map((x, i) => Math.min(arm.joints[i].upper ?? Infinity, Math.max(arm.joints[i].lower ?? -Infinity, x + scale * step[i])));
  }
  return found;
}

/// Lets the tip be dragged on the canvas of an ArmView, in the plane of the screen; elsewhere the
/// view turns. Returns what tells where the tip is drawn. `posture` returns {arm, q}; `moved` takes a posture and whether the drag has ended.
export function dragTip(view, posture, moved) {
  const {canvas} = view;
  let drag = null;
  const place = (e) => {
    const box = canvas.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  };
  /// Where the tip is drawn, how many pixels a metre has there, and its frame.
  const tipOnScreen = () => {
    const {arm, q} = posture(), {points, tip} = kinematics(arm, q);
    const p = view.projection(canvas.clientWidth, canvas.clientHeight, points)([0, 1, 2].map((r) => tip[r][3]));
    return {p, tip};
  };
  canvas.addEventListener('pointerdown', (e) => {
    const {p, tip} = tipOnScreen(), [x, y] = place(e);
    if (Math.hypot(x - p[0], y - p[1]) > 22) return;
    drag = {from: [x, y], scale: p[3], tip};
    canvas.setPointerCapture(e.pointerId);
    e.stopImmediatePropagation();
  }, {capture: true});
  canvas.addEventListener('pointermove', (e) => {
    if (!drag) return;
    e.stopImmediatePropagation();
    const [x, y] = place(e), dx = (x - drag.from[0]) / drag.scale, dy = -(y - drag.from[1]) / drag.scale;
    const ct = Math.cos(view.turn), st = Math.sin(view.turn), ck = Math.cos(view.tilt), sk = Math.sin(view.tilt);
    const by = [-st * dx - sk * ct * dy, ct * dx - sk * st * dy, ck * dy];
    const {arm, q} = posture();
    moved(reach(arm, q, [0, 1, 2].map((r) => drag.tip[r][3] + by[r]), drag.tip), false);
  }, {capture: true});
  for (const end of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(end, () => {
      if (drag) moved(posture().q, true);
      drag = null;
    }, {capture: true});
  }
  return () => tipOnScreen().p.slice(0, 2);
}
