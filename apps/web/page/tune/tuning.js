// The model of the page of `dashpot tune`: the edited state, and the program's answers on both designs.
import {$, keepErrors} from '../shared/dom.js';
import {rounded} from '../shared/numbers.js';
import {kDesigns} from './designs.js';
import {Newest, post} from './requests.js';
import {Store} from './store.js';
import {Workspace} from './workspace.js';

const kTogether = 15;  // ms that one answer waits for the other design's, to be drawn in one frame

export class Tuning {
  errors = []; poles = [];
  answers = {a: null, b: null};
  asked = {a: null, b: null};       // the requests of the answers
  problem = {a: '', b: ''};         // why there is no newer answer
  old = {a: false, b: false};       // whether the answers are of other designs
  chosen = null;                    // number of the mode whose shape is shown
  current = false;                  // whether all that is shown is of the state
  later = 0;                        // timer of what is drawn soon

  /// `changed` is called when the state has changed, `redraw` with the names of parts to be drawn again.
  constructor(setup, changed, redraw) {
    keepErrors(this.errors);
    Object.assign(this, {setup, redraw});
    const {q, designs: [a, b]} = setup;
    this.store = new Store({q, place: 'tip/0', motion: 'step', touches: 0, edited: 'a', a, b}, () => {
      this.current = false;
      this.workspace.moved = performance.now();
      changed();
      this.ask();
    });
    this.workspace = new Workspace(setup.token, () => redraw('workspace'));
    this.questions = Object.fromEntries(kDesigns.map((name) =>
      [name, new Newest(setup.token, '/design', (heard, asked) => this.hear(name, heard, asked))]));
  }

  get state() { return this.store.state; }
  design(name = this.state.edited) { return this.state[name]; }
  answer(name = this.state.edited) { return this.answers[name]; }
  other() { return this.state.edited === 'a' ? 'b' : 'a'; }
  edit(change, ended) { this.store.edit(change, ended); }
  unitOf(joint) { return this.setup.arm.joints[joint]?.prismatic ? 'm' : 'rad'; }
  wantedRatio() { return this.design().damping.ratio || this.design().joint_damping.ratio || 0.7; }
  /// The matrix of damping that acts, or null if the answer belongs to other springs.
  actingDamping() {
    const asked = this.asked[this.state.edited];
    return this.answer() && asked.design.mode === this.design().mode ? this.answer().gains.damping : null;
  }
  choose(label) {
    this.chosen = this.chosen === label ? null : label;
    this.redraw('arm', 'poles', 'texts');
  }

  ask() {
    const {q, place, touches} = this.state, touch = touches > 0 ? {touches} : {};
    for (const name of kDesigns) this.questions[name].ask({q, place, ...touch, design: this.design(name)});
  }
  hear(name, heard, asked) {
    this.problem[name] = heard.error || '';
    this.old[name] = !!heard.error;
    if (!heard.error) this.answers[name] = heard;
    this.asked[name] = asked;
    $('link').textContent = heard.gone ? heard.error : '';
    $('link').className = 'badge bad';
    clearTimeout(this.later);
    const waits = kDesigns.some((one) => one !== name && this.questions[one].busy);
    this.later = setTimeout(() => {
      this.later = 0;
      this.redraw('arm', 'poles', 'motion', 'texts');
    }, waits ? kTogether : 0);
    const {a, b} = this.state, all = Object.values(this.questions);
    if (all.every((question) => !question.busy || !question.next)) this.workspace.look({a, b});
  }
  /// Notes whether all that is shown is of the state.
  noteDrawn() {
    const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
    this.current = !this.later && kDesigns.every((name) => this.asked[name] &&
      same(this.asked[name].design, this.design(name)) && same(this.asked[name].q, this.state.q) &&
      (this.asked[name].touches || 0) === this.state.touches);
  }

  /// Sets the damping for the wanted ratio at this posture: the matrix for all modes, or a diagonal with that smallest
  /// ratio.
  async propose(key, full) {
    const {edited: name, q, place} = this.state, ratio = this.wantedRatio();
    const ask = (damping) =>
      post(this.setup.token, '/design', JSON.stringify({q, place, design: {...this.design(name), [key]: damping}}));
    const first = await ask({ratio}), singular = first.refused?.find((refused) => refused.key === 'q')?.reason || '';
    const whole = first.error || singular ? null : first.gains.damping;
    const {damping, error} = full || !whole ? {damping: whole, error: first.error}
      : await this.scaleDiagonal(whole.map((row, i) => row[i]), ratio, ask);
    this.problem[name] = damping ? '' : singular || error || 'damping: no diagonal gives the ratio';
    const round = (x) => (full ? x.map((entry) => rounded(entry, 6)) : rounded(x, 6));
    if (damping) this.edit((state) => { state[name][key] = damping.map(round); }, true);
    else this.redraw('texts');
  }
  /// Scales a diagonal until its smallest ratio is `ratio`: {damping}, or {error}.
  async scaleDiagonal(damping, ratio, ask) {
    for (let turn = 1, scaled = damping; ; ++turn) {
      const {error, smallest_ratio: smallest} = await ask(scaled);
      if (error || !(smallest > 0)) return {error};
      if (turn === 8 || Math.abs(smallest - ratio) < 1e-3) return {damping: scaled};
      scaled = scaled.map((x) => x * ratio / smallest);
    }
  }
}
