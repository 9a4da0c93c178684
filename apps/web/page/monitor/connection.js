// Messages from the program: its set-up, then frames as a stream, or the frames of a log.
import {Replay} from './replay.js';

export async function get(path) {
  const answer = await fetch(path), body = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(body.error || answer.statusText), {told: true});
  return body;
}

/// Calls `heard`: linked(whether, text), begin(setup) when the program is reached, history(curves) of a log, and
/// take(frame).
export class Connection {
  constructor(heard) { Object.assign(this, {heard, connected: false, replay: new Replay()}); }

  link(connected, said) {
    this.connected = connected;
    this.heard.linked(connected, said);
  }
  async open() {
    const setup = await get('/setup').catch(() => null);
    if (!setup) {
      this.lose('no connection');
      return;
    }
    this.heard.begin(setup);
    if (setup.live) this.stream();
    else await this.replayLog(setup.duration, setup.damage ? `log: ${setup.damage}` : 'log');
  }
  lose(said) {
    this.link(false, `${said}; trying again`);
    setTimeout(() => this.open(), 1000);  // the server may have come back with another arm
  }
  async replayLog(duration, said) {
    this.link(true, said);
    this.heard.history(await get('/history'));
    this.replay.run(duration, async (time) => {
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
      events.close();
      this.lose('connection lost');
    };
  }
}
