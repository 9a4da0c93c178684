// What the page is about, with undo and the address that holds it; and requests of which the
// newest counts.

/// The state is {q, place, motion, edited: 'a' or 'b', a, b}.
export class Store {
  constructor(start, changed) {
    this.start = JSON.stringify(start);
    this.changed = changed;
    this.past = [];
    this.future = [];
    this.read();
    window.addEventListener('hashchange', () => {
      this.read();
      changed(true);
    });
  }
  /// Takes the state of the address, as far as it has the form of one.
  read() {
    this.state = JSON.parse(this.start);
    try {
      const told = JSON.parse(decodeURIComponent(location.hash.slice(1)) || '{}');
      const fits = (a, b) => typeof a === typeof b && Array.isArray(a) === Array.isArray(b);
      for (const key of Object.keys(this.state)) {
        if (key in told && told[key] !== null && fits(told[key], this.state[key])) this.state[key] = told[key];
      }
      for (const name of ['a', 'b']) this.state[name] = {...JSON.parse(this.start)[name], ...this.state[name]};
      if (this.state.q.length !== JSON.parse(this.start).q.length || !this.state.q.every(Number.isFinite)) this.state.q = JSON.parse(this.start).q;
      if (this.state.edited !== 'b') this.state.edited = 'a';
    } catch {
      this.state = JSON.parse(this.start);
    }
    this.kept = JSON.stringify(this.state);
  }
  design(name = this.state.edited) { return this.state[name]; }
  /// Changes the state; where the change has ended, it can be undone.
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
    this.address();
  }
  address() { history.replaceState(null, '', `#${encodeURIComponent(this.kept)}`); }
  undo(from = this.past, to = this.future) {
    if (!from.length) return;
    to.push(this.kept);
    this.kept = from.pop();
    this.state = JSON.parse(this.kept);
    this.address();
    this.changed(true);
  }
  redo() { this.undo(this.future, this.past); }
}

/// Asks the server, one question at a time: while one is under way the newest of the others waits.
export class Newest {
  constructor(token, heard) { Object.assign(this, {token, heard, busy: false, next: null, last: ''}); }
  ask(path, question) {
    const body = JSON.stringify(question);
    if (body === this.last) return;
    this.last = body;
    this.next = {path, body};
    if (!this.busy) this.run();
  }
  async run() {
    this.busy = true;
    while (this.next) {
      const {path, body} = this.next;
      this.next = null;
      this.heard(await post(this.token, path, body), JSON.parse(body));  // what was asked may have changed since
    }
    this.busy = false;
  }
}

/// Returns the answer, or {error}.
export async function post(token, path, body) {
  try {
    const answer = await fetch(path, {method: 'POST', body, headers: {'Content-Type': 'application/json', 'X-Dashpot-Token': token}});
    return await answer.json();
  } catch {
    return {error: 'the program does not answer; is it still running?', gone: true};
  }
}

/// The numbers of many postures for the designs, a part at a time, and none while something moves: a
/// slider waits for one part at most. A design that changes begins again.
export class Workspace {
  constructor(token, changed) {
    Object.assign(this, {token, changed, found: {}, asked: {}, busy: false, part: 25, moved: -Infinity});
  }
  look(designs) {
    for (const [name, design] of Object.entries(designs)) {
      const key = JSON.stringify(design);
      if (this.asked[name] !== key) {
        this.asked[name] = key;
        this.found[name] = {postures: 0, smallest_ratio: [], gain_margin: [], worst: {}, error: '', began: performance.now(), took: null};
      }
    }
    if (!this.busy) this.run();
  }
  async run() {
    this.busy = true;
    const open = () => Object.keys(this.found).find((name) => this.found[name].postures < Workspace.kPostures && !this.found[name].error);
    for (let name = open(); name; name = open()) {
      for (let left; (left = this.moved + Workspace.kRest - performance.now()) > 0;) await new Promise((done) => setTimeout(done, left));
      const found = this.found[name];
      const count = Math.min(this.part, Workspace.kPostures - found.postures), began = performance.now();
      const body = `{"design":${this.asked[name]},"seed":1,"first":${found.postures},"count":${count}}`;
      const part = await post(this.token, '/workspace', body);
      // As many as take about 20 ms: a long delay of the loop makes each slower.
      this.part = Math.round(Math.min(Workspace.kPart, Math.max(2, count * 20 / (performance.now() - began))));
      if (this.found[name] !== found) continue;  // of a design that has changed
      if (part.error) {
        found.error = part.error;
      } else {
        found.postures += part.count;
        for (const key of ['smallest_ratio', 'gain_margin']) {
          found[key].push(...part[key].filter((x) => x !== null));
          const worst = part.worst[key];
          if (worst && (!found.worst[key] || worst.value < found.worst[key].value)) found.worst[key] = worst;
        }
        if (found.postures >= Workspace.kPostures) found.took = performance.now() - found.began;
      }
      this.changed();
    }
    this.busy = false;
  }
}
Workspace.kPostures = 2000;
Workspace.kPart = 100;
Workspace.kRest = 150;  // ms
