// Schedules the drawing of parts of a page.

/// `parts` are {name: function of the time that draws it}. `every` are ms between drawings of a part if only time goes
/// on, `rate` drawings a second at most; nothing is drawn unless `ready`; `drawn` is called after each drawing.
export class Redraw {
  constructor(parts, {every = {}, rate = Infinity, ready = () => true, drawn = () => {}} = {}) {
    Object.assign(this, {parts, every, rate, ready, drawn, timer: 0, due: Infinity, last: -Infinity});
    this.dirty = new Map();  // part -> whether it was someone's wish
    this.drawnAt = {};
  }
  /// Draws parts, or all, in the next frame.
  soon(...parts) {
    for (const part of parts.length ? parts : Object.keys(this.parts)) this.dirty.set(part, true);
    this.request(0);
  }
  /// Draws parts when their time has come.
  later(...parts) {
    for (const part of parts) if (!this.dirty.has(part)) this.dirty.set(part, false);
    this.request(Math.min(...parts.map((part) => this.rest(part, performance.now()))));
  }
  rest(part, now) {
    return this.dirty.get(part) ? 0 : Math.max(0, (this.every[part] || 0) - (now - (this.drawnAt[part] || 0)));
  }
  request(wait) {
    const now = performance.now(), at = Math.max(now + wait, this.last + 1000 / this.rate);
    if (at >= this.due) return;
    clearTimeout(this.timer);
    this.due = at;
    const draw = () => requestAnimationFrame((frame) => this.draw(frame));
    if (at > now) this.timer = setTimeout(draw, at - now);
    else draw();
  }
  draw(now) {
    this.due = Infinity;
    this.last = now;
    if (!this.ready()) return;
    let wait = Infinity;
    for (const part of [...this.dirty.keys()]) {
      const rest = this.rest(part, now);
      if (rest > 0) {
        wait = Math.min(wait, rest);
        continue;
      }
      this.dirty.delete(part);
      this.drawnAt[part] = now;
      this.parts[part](now);
    }
    if (wait < Infinity) this.request(wait);
    this.drawn();
  }
}
