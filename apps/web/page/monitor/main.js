// The page of `dashpot monitor --web`: takes frames from the program and redraws what changed.
import {ArmView} from '../shared/arm_view.js';
import {$, keepErrors, listen, setText} from '../shared/dom.js';
import {fillChips} from '../shared/mode_marks.js';
import {Plot, View} from '../shared/plot.js';
import {PoleMap} from '../shared/pole_map.js';
import {Redraw} from '../shared/redraw.js';
import {followTheme} from '../shared/theme.js';
import {copyWorstPosture, fillAlarms, fillLoopNumbers, fillSampledNumbers} from './alarms.js';
import {drawArm, shapes, showArmTexts} from './arm_panel.js';
import {Connection} from './connection.js';
import {History, drawCurves} from './curves_over_time.js';
import {TickRate, identifiedPoles, loopState, polesOf, posture, springForce, timeOf,
  wantedRatio} from './loop_state.js';
import {showLink, showLoopState} from './notices.js';
import {ResponsePanel} from './response_panel.js';
import {drawCircle, sampledPoles} from './sampled_circle.js';
import {fillJointTable, fillModeTable} from './tables.js';

const kEvery = {arm: 140, poles: 240, numbers: 330, curves: 950};  // ms between drawings, if only time goes on
const kRate = 25;  // drawings in a second
const kRestart = 1e6;  // us: if time goes back further, a loop has started

/// `latest` is the frame that came last, `frame` the one that is shown.
class Page {
  setup = null; frame = null; latest = null; frames = 0;
  connected = false; link = ''; arrived = 0; start = null; paused = false;
  chosen = null; response = null; poles = []; origin = null; tip = null; errors = [];

  history = new History();
  held = null;  // the history that is shown while the page is paused
  ticks = new TickRate();
  seen = {};    // what parts were drawn of
  times = new View();

  constructor() {
    keepErrors(this.errors);
    const {times} = this, omegas = new View(), soon = (part) => () => this.redraw.soon(part);
    this.redraw = new Redraw({arm: () => this.drawArm(), poles: () => this.drawPoles(), curves: () => this.drawCurves(),
      response: () => this.panel.draw(), numbers: () => this.showNumbers(),
    }, {every: kEvery, rate: kRate, ready: () => this.setup && this.frame});
    this.view = new ArmView($('arm'), soon('arm'));
    this.map = new PoleMap($('poles'), soon('poles'), (label) => this.choose(label));
    const plot = (id, part, view) => new Plot($(id), soon(part), view);
    this.plots = {frequency: plot('frequency', 'curves', times), ratio: plot('ratio', 'curves', times),
      ticks: plot('ticks', 'curves', times), magnitude: plot('magnitude', 'response', omegas),
      phase: plot('phase', 'response', omegas)};
    this.panel = new ResponsePanel(this, this.plots, () => this.redraw.soon('response', 'numbers'));
    this.connection = new Connection({take: (frame) => this.take(frame), begin: (setup) => this.begin(setup),
      linked: (connected, said) => this.linked(connected, said), history: ({time, tick_time: tick, status, mode}) => {
        const modes = Object.entries(mode).map(([label, curves]) => [Number(label), curves]);
        this.forget(new History(time, tick, status, new Map(modes)));
      }});
    this.replay = this.connection.replay;
    followTheme($('theme'), () => this.redraw.soon());
    new ResizeObserver(() => this.redraw.soon()).observe(document.querySelector('main'));
    setInterval(() => {  // ages grow by themselves, trails end
      if (this.setup?.live && this.frame) this.redraw.later('numbers', 'poles');
    }, 2000);
    copyWorstPosture(this);
    const swing = () => this.redraw.soon('arm', 'numbers');
    listen('input', {amplitude: swing, pace: swing});
    const zoom = (factor) => () => {
      if (factor) this.plots.frequency.zoom(factor);
      else times.shown = null;
      this.redraw.soon('curves');
    };
    listen('click', {zoom_in: zoom(2), zoom_out: zoom(.5), zoom_all: zoom(0), pause: () => this.pause(!this.paused)});
    this.connection.open();
  }

  begin(setup) {
    this.setup = setup;
    setText('source', setup.source);
    $('source').title = setup.source;
    this.panel.fillPlaces(setup.arm);
    $('pause').hidden = !setup.live;
  }
  linked(connected, said) {
    this.connected = connected;
    this.link = said;
    if (this.frame) this.redraw.later('numbers');
    else showLink(this);
  }
  forget(history = new History()) {
    this.history = history;
    this.map.forget();
  }

  take(frame) {
    const before = this.latest, {live} = this.setup, {messages, state, modes, sampled, utime} = frame;
    const fresh = !before || before.messages !== messages || before.utime !== utime;
    this.latest = frame;
    ++this.frames;
    this.arrived = performance.now();
    if (this.start === null && messages) this.start = utime;
    if (live && before && utime < before.utime - kRestart) {
      this.start = utime;
      this.forget();
    }
    if (live && fresh && messages) this.history.append(timeOf(this, frame), frame);
    if (this.paused) return;
    this.frame = frame;
    this.redraw.later('numbers', ...(fresh || !live ? ['curves'] : []));
    if (messages && fresh) this.map.note(timeOf(this), polesOf(this));
    if (this.differs('arm', state && [posture(this), springForce(this)], 4)) this.redraw.later('arm');
    const eigenvalues = modes && [modes.eigenvalue_real, modes.eigenvalue_imag, sampled && sampled.sequence];
    if (this.differs('poles', eigenvalues, 3)) this.redraw.later('poles');
  }
  /// Whether numbers differ visibly from the last time.
  differs(part, numbers, digits) {
    const decimals = (x) => Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(x) + .1)));
    const key = numbers ? numbers.flat(3).map((x) => (x ? x.toFixed(decimals(x)) : x)).join() : 'none';
    if (this.seen[part] === key) return false;
    this.seen[part] = key;
    return true;
  }

  /// While the page is paused, messages are kept for the curves, and what is shown stays.
  pause(on) {
    this.paused = on;
    this.held = on ? this.history.copy() : null;
    setText('pause', on ? 'Go on' : 'Pause');
    $('pause').setAttribute('aria-pressed', on);
    if (!on && this.latest) this.frame = this.latest;
    this.redraw.soon();
  }
  choose(label) {
    this.chosen = this.chosen === label ? null : label;
    this.redraw.soon();
  }
  seek(t) { this.replay.seek(t); }

  drawArm() {
    if (drawArm(this, this.view) && ['running', 'log'].includes(loopState(this))) this.redraw.later('arm');
  }
  drawPoles() {
    const {frame: {sampled}, map} = this;
    this.ticks.note(this.frame.state);
    const period = this.ticks.period(this);
    this.poles = map.draw(polesOf(this), identifiedPoles(this.setup), wantedRatio(this), this.chosen);
    this.origin = map.origin;
    $('circle').hidden = !sampled;
    if (sampled) drawCircle($('circle'), sampledPoles(sampled, period));
    fillSampledNumbers(this, period);
  }
  drawCurves() {
    drawCurves(this, this.plots, this.held || this.history, this.ticks.period(this));
  }
  showNumbers() {
    this.ticks.note(this.frame.state);
    showLoopState(this);
    showArmTexts(this);
    if (!this.setup.live) this.replay.show();
    this.panel.showNote();
    fillChips(shapes(this), this.chosen, (label) => this.choose(label));
    fillModeTable(this);
    fillJointTable(this);
    fillLoopNumbers(this, this.ticks.rate);
    fillAlarms(this);
  }
}

window.dashpot = new Page();  // to look into, and for tests
