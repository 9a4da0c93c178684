// Dragging the tip: the posture that brings it there with its orientation kept, by damped least squares.
import {placeOf} from '../shared/gestures.js';
import {along, column, cross, kAxes, kinematics} from '../shared/kinematics.js';

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

/// Returns the posture near q whose tip is at `goal` (m) with the rotation of `frame`, or as near as limits and reach
/// allow.
function reach(arm, q, goal, frame) {
  let found = [...q];
  for (let round = 0; round < 12; ++round) {
    const {joints, tip} = kinematics(arm, found), at = column(tip, 3);
    const turn = kAxes.map((j) => cross(column(tip, j), column(frame, j)));  // twice the small turn
    const error = along(goal, -1, at).concat(kAxes.map((r) => 0.5 * (turn[0][r] + turn[1][r] + turn[2][r])));
    if (Math.hypot(...error) < 1e-6) break;
    const J = joints.map(({at: place, axis, prismatic}) =>
      (prismatic ? [...axis, 0, 0, 0] : [...cross(axis, along(at, -1, place)), ...axis]));
    const A = error.map((_, i) => error.map((__, j) => J.reduce((sum, c) => sum + c[i] * c[j], i === j ? 1e-4 : 0)));
    const y = solve(A, error), step = J.map((c) => c.reduce((sum, a, i) => sum + a * y[i], 0));
    const scale = Math.min(1, 0.3 / Math.max(...step.map(Math.abs), 1e-9));
    found = along(found, scale, step).map((x, i) =>
      Math.min(arm.joints[i].upper ?? Infinity, Math.max(arm.joints[i].lower ?? -Infinity, x)));
  }
  return found;
}

/// Lets the tip be dragged on the canvas of an ArmView, in the plane of the screen; elsewhere the view turns. Returns
/// what tells where the tip is drawn. `posture` returns q; `moved` takes a posture and whether the drag has ended.
export function dragTip(view, arm, posture, moved) {
  const {canvas} = view, first = {capture: true};
  let drag = null;
  const tipOnScreen = () => {
    const {points, tip} = kinematics(arm, posture());
    const [x, y, , scale] = view.projection(canvas.clientWidth, canvas.clientHeight, points)(column(tip, 3));
    return {at: [x, y], scale, tip};
  };
  canvas.addEventListener('pointerdown', (e) => {
    const from = placeOf(e, canvas), there = tipOnScreen();
    if (Math.hypot(from[0] - there.at[0], from[1] - there.at[1]) > 22) return;
    drag = {...there, from};
    canvas.setPointerCapture(e.pointerId);
    e.stopImmediatePropagation();
  }, first);
  canvas.addEventListener('pointermove', (e) => {
    if (!drag) return;
    e.stopImmediatePropagation();
    const [dx, dy] = along(placeOf(e, canvas), -1, drag.from).map((x) => x / drag.scale), {right, up} = view.screen();
    moved(reach(arm, posture(), along(along(column(drag.tip, 3), dx, right), -dy, up), drag.tip), false);
  }, first);
  for (const end of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(end, () => {
      if (drag) moved(posture(), true);
      drag = null;
    }, first);
  }
  return () => tipOnScreen().at;
}
