// Pointer, wheel and keys of a canvas.

/// Where a pointer is on a canvas, px.
export function placeOf(e, canvas) {
  const box = canvas.getBoundingClientRect();
  return [e.clientX - box.left, e.clientY - box.top];
}

const kArrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};

/// Calls what `on` has of hover([x, y]), drag(dx, dy), click([x, y]), leave(), all() for a double click or 0, and
/// arrow(right, down, shift), which may return false to leave the key; zoom(factor, [x, y]), or without a place for a
/// key, by `step`; and `changed` after each. The wheel zooms after a click or with Ctrl, because the page scrolls by
/// it, or if `greedy` always.
export function listenToGestures(canvas, changed, on, {step = 1.25, wheel = 0.002, greedy = false} = {}) {
  canvas.tabIndex = 0;
  canvas.setAttribute('role', 'img');
  let last = null, way = 0;
  const call = (name, ...values) => {
    const left = !on[name] || on[name](...values) === false;
    if (!left) changed();
    return !left;
  };
  const listen = (name, act, options) => canvas.addEventListener(name, (e) => act(e, placeOf(e, canvas)), options);
  listen('pointerdown', (e, place) => {
    last = place;
    way = 0;
    if (greedy) canvas.setPointerCapture(e.pointerId);
  });
  listen('pointermove', (e, [x, y]) => {
    call('hover', [x, y]);
    if (!last || !(e.buttons & 1)) return;
    const [dx, dy] = [x - last[0], y - last[1]];
    way += Math.hypot(dx, dy);
    last = [x, y];
    call('drag', dx, dy);
  });
  listen('pointerup', (_, place) => {
    last = null;
    if (way < 4) call('click', place);
  });
  for (const name of ['pointercancel', 'pointerleave', 'blur']) {
    listen(name, () => {
      last = null;
      call('leave');
    });
  }
  listen('dblclick', () => call('all'));
  listen('wheel', (e, place) => {
    if (!greedy && document.activeElement !== canvas && !e.ctrlKey) return;
    e.preventDefault();
    call('zoom', Math.exp(-e.deltaY * wheel), place);
  }, {passive: false});
  const keys = {'+': ['zoom', step], '=': ['zoom', step], '-': ['zoom', 1 / step], 0: ['all']};
  listen('keydown', (e) => {
    const taken = kArrows[e.key] ? call('arrow', ...kArrows[e.key], e.shiftKey) : keys[e.key] && call(...keys[e.key]);
    if (taken) e.preventDefault();
  });
}
