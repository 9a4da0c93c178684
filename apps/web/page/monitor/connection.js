// Messages from the program: what it is started with, then frames as a stream, or those of a log.
import {Replay} from './replay.js';

export async function get(path) {
  const answer = await fetch(path), body = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(body.error || answer.statusText), {told: true});
  return body;
}

/// Calls linked(whether, in words), begin(setup) when the program is reached, history(curves) of a log, and take(frame).
export class Connection {
  constructor(heard) { Object.assign(this, {heard, connected: false, replay: new Replay()}); }

  link(connected, said) {
    this.connected = connected;
    this.heard.linked(connected, said);
  }
  async open() {
    let setup = null;
    while (!setup) {
      setup = await get('/setup').catch(() => null);
      if (setup) break;
      this.link(false, 'no connection; trying again');
      await new Promise((done) => setTimeout(done, 1000));
    }
    this.heard.begin(setup);
    if (setup.live) {
      this.stream();
      return;
    }
    const said = setup.damage ? `log: ${setup.damage}` : 'log';
    this.link(true, said);
    this.heard.history(await get('/history'));
    this.replay.run(setup.duration, async (time) => {
      const frame = await get(`/frame?t=${time.toFixed(6)}`).catch(() => null);
      if (frame && !this.connected) this.link(true, said);
      if (frame) this.heard.take(frame);
      else this.link(false, 'connection lost; trying again');
      return frame !== null;
    });
  }
  stream() {
    const events = new EventSource('/stream');
    events.onopen = () => this.link(true, 'connected');
    events.onmessage = (e) => {
      if (!this.connected) this.link(true, 'connected');
      this.heard.take(JSON.parse(e.data));
    };
    events.onerror = () => {
      this.link(false, 'connection lost; trying again');
      events.close();
      setTimeout(() => this.open(), 1000);  // the server may have come back with another arm
    };
  }
}
