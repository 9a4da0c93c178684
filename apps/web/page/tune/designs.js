// The two designs that the page compares.

export const kDesigns = ['a', 'b'];
export const kTaskAxes = ['x', 'y', 'z', 'rx', 'ry', 'rz'];
export const nameOf = (design) => design.toUpperCase();
/// How the curves of a design look.
export const kStyles = {a: {name: 'A', colour: 'accent', width: 2, dash: []},
  b: {name: 'B', colour: 'force', width: 2, dash: [7, 4]}};
