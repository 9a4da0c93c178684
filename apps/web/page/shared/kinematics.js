// The poses of an arm's parts, from the chain of /setup and a posture; vectors and 4 x 4 matrices.

export const kAxes = [0, 1, 2];
const kIdentity = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];
const multiply = (A, B) => A.map((row) => [0, 1, 2, 3].map((j) => row.reduce((sum, a, k) => sum + a * B[k][j], 0)));
export const column = (T, j) => kAxes.map((i) => T[i][j]);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/// a + k b
export const along = (a, k, b) => a.map((x, i) => x + k * b[i]);

/// Two unit vectors that are perpendicular to a unit vector and to each other.
export function perpendiculars(n) {
  const side = cross(n, Math.abs(n[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]), length = Math.hypot(...side) || 1;
  const u = side.map((x) => x / length);
  return [u, cross(n, u)];
}

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

/// Points along the arm from base to tip, joints {at, axis, prismatic}, and the frame of the tip.
export function kinematics(arm, q) {
  let T = kIdentity;
  const points = [[0, 0, 0]], joints = [];
  arm.joints.forEach((joint, i) => {
    const {axis, prismatic} = joint, placed = multiply(T, moved(joint, q[i])), at = column(placed, 3);
    joints.push({at, prismatic, axis: kAxes.map((r) => dot(T[r], axis))});
    points.push(column(multiply(T, moved(joint, 0)), 3), at);
    T = multiply(placed, joint.frame);
    points.push(column(T, 3));
  });
  T = multiply(T, arm.tip);
  points.push(column(T, 3));
  return {points, joints, tip: T};
}
