// Replay of a log: one request at a time, always for the present time.
import {$, listen, setText} from '../shared/dom.js';
import {fixed} from '../shared/numbers.js';

const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 5, 10, 30];

export class Replay {
  time = 0;  // s
  end = Infinity;  // until the log is known
  playing = true;
  speed = kSpeeds.indexOf(1);

  constructor() {
    listen('click', {
      play: () => {
        if (!this.playing && this.time >= this.end) this.time = 0;
        this.setPlaying(!this.playing);
      },
      slower: () => this.setSpeed(-1),
      faster: () => this.setSpeed(1),
    });
    listen('input', {time: () => this.seek(Number($('time').value))});
    this.setSpeed(0);
  }
  setPlaying(on) {
    this.playing = on;
    setText('play', on ? 'Pause' : 'Play');
  }
  setSpeed(step) {
    this.speed = Math.min(kSpeeds.length - 1, Math.max(0, this.speed + step));
    setText('speed', `${kSpeeds[this.speed]} ×`);
  }
  seek(t) {
    this.time = Math.min(t, this.end);
    this.setPlaying(false);
  }
  show() {
    if (document.activeElement !== $('time') || this.playing) $('time').value = this.time;
    setText('time_text', `${fixed(this.time, 2)} s`);
  }

  /// Asks `frameAt` for the frame of each time; it returns whether the frame came.
  async run(end, frameAt) {
    $('replay').hidden = false;
    $('time').max = this.end = end;
    this.time = Math.min(this.time, end);
    let then = performance.now(), shown = null;
    for (;;) {
      await new Promise((done) => setTimeout(done, 66));
      const now = performance.now();
      if (this.playing) this.time = Math.min(this.time + 1e-3 * (now - then) * kSpeeds[this.speed], end);
      if (this.playing && this.time >= end) this.setPlaying(false);
      then = now;
      const asked = this.time;
      if (asked === shown) continue;
      shown = await frameAt(asked) ? asked : null;
      if (shown === null) await new Promise((done) => setTimeout(done, 700));
    }
  }
}
