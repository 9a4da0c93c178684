// The state that is edited, {q, place, motion, touches, edited: 'a' or 'b', a, b}, with undo and the address that holds
// it.

const fits = (a, b) => a !== null && typeof a === typeof b && Array.isArray(a) === Array.isArray(b);

export class Store {
  past = [];
  future = [];

  constructor(start, changed) {
    this.start = JSON.stringify(start);
    this.changed = changed;
    this.read();
    window.addEventListener('hashchange', () => {
      this.read();
      changed(true);
    });
  }
  /// Takes the valid parts of the state in the address.
  read() {
    const start = JSON.parse(this.start);
    this.state = {...start};
    try {
      const told = JSON.parse(decodeURIComponent(location.hash.slice(1)) || '{}');
      for (const key of Object.keys(start)) if (fits(told[key], start[key])) this.state[key] = told[key];
      for (const name of ['a', 'b']) this.state[name] = {...start[name], ...this.state[name]};
      if (this.state.q.length !== start.q.length || !this.state.q.every(Number.isFinite)) this.state.q = start.q;
      if (this.state.edited !== 'b') this.state.edited = 'a';
    } catch {
      this.state = start;
    }
    this.kept = JSON.stringify(this.state);
  }
  /// Changes the state; after its end the change can be undone.
  edit(change, ended) {
    change(this.state);
    if (ended) this.keep();
    this.changed(ended);
  }
  keep() {
    const now = JSON.stringify(this.state);
    if (now === this.kept) return;
    this.past.push(this.kept);
    if (this.past.length > 200) this.past.shift();
    this.future = [];
    this.kept = now;
    this.writeAddress();
  }
  writeAddress() { history.replaceState(null, '', `#${encodeURIComponent(this.kept)}`); }
  undo(from = this.past, to = this.future) {
    if (!from.length) return;
    to.push(this.kept);
    this.kept = from.pop();
    this.state = JSON.parse(this.kept);
    this.writeAddress();
    this.changed(true);
  }
  redo() { this.undo(this.future, this.past); }
}
