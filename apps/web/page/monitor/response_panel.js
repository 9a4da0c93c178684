// The receptance of the loop at its posture, asked for at most once a second, if an arm is known and has moved.
import {$, setText} from '../shared/dom.js';
import {drawResponses} from '../shared/response_plots.js';
import {get} from './connection.js';
import {hasGainsOfConfiguration, otherJoints, posture} from './loop_state.js';

export class ResponsePanel {
  asked = '';
  note = '';

  /// `changed` is called when `page.response`, or the reason for its absence, changes.
  constructor(page, plots, changed) {
    Object.assign(this, {page, plots, changed});
    setInterval(() => this.ask(), 1000);
    $('place').addEventListener('change', () => this.ask());
  }
  /// Offers the places of an arm.
  fillPlaces(arm) {
    const select = $('place'), kept = select.value;
    select.replaceChildren(
      ...['x', 'y', 'z', 'about x', 'about y', 'about z'].map((axis, i) => new Option(`tip, ${axis}`, `tip/${i}`)),
      ...(arm ? arm.joints : []).map((joint, i) => new Option(`q${i + 1}: ${joint.name}`, `joint/${i}`)));
    select.value = kept;
    if (!select.value) select.value = 'tip/0';
  }
  async ask() {
    const {page} = this, {setup, frame} = page;
    if (!setup || !frame || !frame.messages || !page.connected || document.hidden) return;
    const other = otherJoints(page), q = posture(page);
    if (!setup.arm || other || !q) {
      const note = other ? '–' : setup.arm ? 'waiting for a posture' : 'start with --config to see the response';
      if (page.response || note !== this.note) this.answer(null, note);
      return;
    }
    const at = $('place').value;
    const key = [at, frame.state && frame.state.mode, page.start, ...q.map((x) => x.toFixed(3))].join();
    if (key === this.asked || page.paused) return;
    this.asked = key;
    try {
      this.answer(await get(`/response?at=${at}${setup.live ? '' : `&t=${page.replay.time.toFixed(6)}`}`), '');
    } catch (e) {
      this.answer(null, e.told ? e.message : 'no response');
      if (!e.told) this.asked = '';
    }
  }
  answer(response, note) {
    this.page.response = response;
    this.note = note;
    this.changed();
  }
  draw() {
    const {response} = this.page, {magnitude, phase} = this.plots;
    drawResponses(magnitude, phase, response ? [{...response, colour: 'accent'}] : [], {title: '|H|', note: this.note});
  }
  showNote() {
    setText('response_note', !this.page.response ? ''
      : hasGainsOfConfiguration(this.page) ? 'at this posture' : "of the configuration's gains; the loop's are others");
  }
}
