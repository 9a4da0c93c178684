// Gains as matrices: numbers on the diagonal, or rows.

export const isFull = (value) => Array.isArray(value[0]);
export const diagonal = (value) => (isFull(value) ? value.map((row, i) => row[i]) : value);
export const asRows = (value) => (isFull(value) ? value : value.map((x, i) => value.map((_, j) => (i === j ? x : 0))));
/// Whether entries beside the diagonal are zero, or smaller than a size.
export const isDiagonal = (value, size = 0) =>
  asRows(value).every((row, i) => row.every((x, j) => i === j || Math.abs(x) <= size));
/// The diagonal of a matrix that has no more, else the matrix.
export const compact = (value) => (value && isDiagonal(value) ? diagonal(value) : value);

/// How damping or stiffness is given: 'full', 'diagonal', 'ratio' or 'factor'.
export const kindOf = (gain) =>
  (Array.isArray(gain) ? (isFull(gain) ? 'full' : 'diagonal') : gain.ratio !== undefined ? 'ratio' : 'factor');
