// Gains as matrices: numbers on the diagonal, or rows.

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
