// The two designs that the page compares, and their gains as matrices: numbers on the diagonal, or rows.

export const kDesigns = ['a', 'b'];
export const kTaskAxes = ['x', 'y', 'z', 'rx', 'ry', 'rz'];
export const nameOf = (design) => design.toUpperCase();
/// How the curves of a design look.
export const kStyles = {a: {name: 'A', colour: 'accent', width: 2, dash: []},
  b: {name: 'B', colour: 'force', width: 2, dash: [7, 4]}};

export const isFull = (value) => Array.isArray(value[0]);
export const diagonal = (value) => (isFull(value) ? value.map((row, i) => row[i]) : value);
export const asRows = (value) => (isFull(value) ? value : value.map((x, i) => value.map((_, j) => (i === j ? x : 0))));
/// Whether entries off the diagonal are at most `size`.
export const isDiagonal = (value, size = 0) =>
  asRows(value).every((row, i) => row.every((x, j) => i === j || Math.abs(x) <= size));
/// The diagonal of a diagonal matrix; otherwise the matrix.
export const compact = (value) => (value && isDiagonal(value) ? diagonal(value) : value);

/// The form of damping or stiffness: 'full', 'diagonal', 'ratio' or 'factor'.
export const kindOf = (gain) =>
  (Array.isArray(gain) ? (isFull(gain) ? 'full' : 'diagonal') : gain.ratio !== undefined ? 'ratio' : 'factor');
