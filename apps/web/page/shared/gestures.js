// Pointer, wheel and keys of a canvas.

/// Where a pointer is on a canvas, px.
export function placeOf(e, canvas) {
  const box = canvas.getBoundingClientRect();
  return [e.clientX - box.left, e.clientY - box.top];
}

const kArrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};

/// Calls what `on` has of hover([x, y]), drag(dx, dy), click([x, y]), leave(), all() for a double click or 0, and
/// arrow(right, down, shift), which returns whether it takes the key; and zoom(factor, [x, y]), or without a place for a
/// key, by `step`. The wheel zooms after a click or with Ctrl, because the page scrolls by it, or if `greedy` always.
export function listenToGestures(canvas, on, {step = 1.25, wheel = 0.002, greedy = false} = {}) {
  canvas.tabIndex = 0;
  canvas.setAttribute('role', 'img');
  let last = null, way = 0;
  canvas.addEventListener('pointerdown', (e) => {
    last = placeOf(e, canvas);
    way = 0;
    if (greedy) canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener('pointermove', (e) => {
    const [x, y] = placeOf(e, canvas);
    on.hover?.([x, y]);
    if (!last || !(e.buttons & 1)) return;
    const [dx, dy] = [x - last[0], y - last[1]];
    way += Math.hypot(dx, dy);
    last = [x, y];
    on.drag?.(dx, dy);
  });
  const end = () => {
    last = null;
    on.leave?.();
  };
  canvas.addEventListener('pointerup', (e) => {
    last = null;
    if (way < 4) on.click?.(placeOf(e, canvas));
  });
  for (const name of ['pointercancel', 'pointerleave', 'blur']) canvas.addEventListener(name, end);
  canvas.addEventListener('dblclick', () => on.all?.());
  canvas.addEventListener('wheel', (e) => {
    if (!greedy && document.activeElement !== canvas && !e.ctrlKey) return;
    e.preventDefault();
    on.zoom(Math.exp(-e.deltaY * wheel), placeOf(e, canvas));
  }, {passive: false});
  canvas.addEventListener('keydown', (e) => {
    if (kArrows[e.key]) {
      if (!on.arrow?.(...kArrows[e.key], e.shiftKey)) return;
    } else if (e.key === '+' || e.key === '=') {
      on.zoom(step);
    } else if (e.key === '-') {
      on.zoom(1 / step);
    } else if (e.key === '0' && on.all) {
      on.all();
    } else {
      return;
    }
    e.preventDefault();
  });
}
