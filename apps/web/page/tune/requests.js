// Requests to the program, of which the newest counts.

/// Returns the answer, or {error}.
export async function post(token, path, body) {
  try {
    const headers = {'Content-Type': 'application/json', 'X-Dashpot-Token': token};
    return await (await fetch(path, {method: 'POST', body, headers})).json();
  } catch {
    return {error: 'the program does not answer; is it still running?', gone: true};
  }
}

/// Posts to a path, one request at a time: meanwhile the newest of the others waits. `heard` is called with each answer
/// and its request.
export class Newest {
  constructor(token, path, heard) { Object.assign(this, {token, path, heard, busy: false, next: null, last: ''}); }
  ask(question) {
    const body = JSON.stringify(question);
    if (body === this.last) return;
    this.last = this.next = body;
    if (!this.busy) this.run();
  }
  async run() {
    this.busy = true;
    while (this.next) {
      const body = this.next;
      this.next = null;
      this.heard(await post(this.token, this.path, body), JSON.parse(body));  // the request may have changed meanwhile
    }
    this.busy = false;
  }
}
