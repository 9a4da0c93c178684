// Takes frames from the program, keeps the last minute, and has drawn again what changed.
import {faultAdvice, notice, silenceAdvice} from '/advice.js';
import {ArmView} from '/arm.js';
import {Plot, View, drawResponse} from '/curves.js';
import {followTheme, number, redrawer, reducedMotion, tickText} from '/draw.js';
import {alarms, chips, jointTable, legends, loopNumbers, modeTable, sampledNumbers, text, wantedRatio} from '/panels.js';
import {PoleMap, drawCircle, sampledPoles} from '/poles.js';

const $ = (id) => document.getElementById(id);
const kMinute = 60;    // s of curves that a live page keeps
const kSilent = 2;     // s without a message
const kOldModes = 5;   // s that modes may lag behind the state
const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 5, 10, 30];

const page = {setup: null, frame: null, chosen: null, connected: false, arrived: 0, start: null, paused: false,
  poles: [], tip: null, frames: 0, response: null, responseNote: '', errors: []};
window.dashpot = page;  // to look into, and for tests
window.addEventListener('error', (e) => page.errors.push(e.message));
window.addEventListener('unhandledrejection', (e) => page.errors.push(String(e.reason)));

// What has to be drawn again, and when it was drawn last
const kParts = ['arm', 'poles', 'numbers', 'curves', 'response'];
const kEvery = {arm: 140, poles: 240, numbers: 330, curves: 950, response: 0};  // ms, if only time goes on
const dirty = new Map(), drawnAt = {};  // part -> 'soon' (at someone's wish) or 'later'
const request = redrawer((now) => draw(now), 25);
function soon(...parts) {
  for (const part of parts.length ? parts : kParts) dirty.set(part, 'soon');
  request();
}
function later(...parts) {
  let wait = Infinity;
  for (const part of parts) {
    if (!dirty.has(part)) dirty.set(part, 'later');
    wait = Math.min(wait, kEvery[part] - (performance.now() - (drawnAt[part] || 0)));
  }
  request(Math.max(0, wait));
}

const arm = new ArmView($('arm'), () => soon('arm'));
const map = new PoleMap($('poles'), () => soon('poles'), choose);
const times = page.times = new View(), omegas = new View();
const overTime = () => soon('curves'), overOmega = () => soon('response');
const plots = {frequency: new Plot($('frequency'), overTime, times), ratio: new Plot($('ratio'), overTime, times),
  ticks: new Plot($('ticks'), overTime, times), magnitude: new Plot($('magnitude'), overOmega, omegas),
  phase: new Plot($('phase'), overOmega, omegas)};
const empty = () => ({time: [], tick: [], status: [], modes: new Map()});
let series = empty(), held = null;  // what came, and while the page is paused what it shows
const replay = {time: 0, playing: true, speed: 3, at: null};
followTheme($('theme'), () => soon());
new ResizeObserver(() => soon()).observe(document.querySelector('main'));
setInterval(() => page.setup && page.setup.live && page.frame && later('numbers', 'poles'), 2000);  // ages grow by themselves, trails end

// Messages
async function get(path) {
  const answer = await fetch(path);
  const body = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(body.error || answer.statusText), {told: true});
  return body;
}

function link(good, said) {
  page.connected = good;
  page.link = said;
  if (page.frame) later('numbers');
  else showLink('waiting');
}
function showLink(state) {
  text('link', state === 'silent' ? `silent for ${ageText()}` : state === 'waiting' && page.connected ? `${page.link}; waiting for messages` : page.link);
  $('link').className = `badge ${{running: 'good', log: page.setup && page.setup.damage ? 'bad' : ''}[state] ?? (state === 'waiting' && page.connected ? '' : 'bad')}`;
}

function forget() {
  series = empty();
  map.forget();
}

function take(frame) {
  const before = page.latest;
  const fresh = !before || before.messages !== frame.messages || before.utime !== frame.utime;
  page.latest = frame;
  ++page.frames;
  page.arrived = performance.now();
  if (page.start === null && frame.messages) page.start = frame.utime;
  if (page.setup.live && before && frame.utime < before.utime - 1e6) {  // another loop, or its restart
    page.start = frame.utime;
    forget();
  }
  if (page.setup.live && fresh && frame.messages) append(timeOf(frame), frame);
  if (page.paused) return;
  page.frame = frame;
  later('numbers', ...(fresh || !before ? ['curves'] : []));
  if (frame.messages && fresh) map.note(time(), poles());
  if (differs('arm', frame.state, [posture(), force()], 4)) later('arm');
  if (differs('poles', frame.modes, [frame.modes && frame.modes.eigenvalue_real, frame.modes && frame.modes.eigenvalue_imag, frame.sampled && frame.sampled.sequence], 3)) later('poles');
}
/// Whether numbers are others than the last time, as far as anyone would see.
const seen = {};
function differs(part, exists, numbers, digits) {
  const key = exists ? numbers.flat(3).map((x) => (x ? x.toFixed(Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(x) + .1)))) : x)).join() : 'none';
  if (seen[part] === key) return false;
  seen[part] = key;
  return true;
}
/// The force of the Cartesian springs and dampers at the tip, N, or null.
function force() {
  const s = page.frame.state;
  return s && s.mode === 1 && s.tip_wrench.slice(0, 3).every((x) => x !== null) ? s.tip_wrench.slice(0, 3) : null;
}
const timeOf = (frame) => (page.setup.live ? (frame.utime - page.start) * 1e-6 : replay.time);
const time = () => timeOf(page.frame);

/// How the loop is: 'waiting' for a first message, 'running', 'silent', 'gone' with the server, 'log'.
function state() {
  if (!page.connected) return 'gone';
  if (!page.frame.messages) return 'waiting';
  if (!page.setup.live) return 'log';
  return age() > kSilent && !page.paused ? 'silent' : 'running';
}
/// s since the last message: as the server says, and the time since then.
const age = () => page.frame.age + (page.setup.live ? (performance.now() - page.arrived) * 1e-3 : 0);
function ageText() {
  const s = Math.floor(age());
  return s < 120 ? `${s} s` : s < 7200 ? `${Math.floor(s / 60)} min` : `${Math.floor(s / 3600)} h`;
}

const kCurves = ['natural_frequency', 'damping_ratio'];
function append(t, frame) {
  if (series.time.length && t <= series.time[series.time.length - 1]) return;
  if (frame.utime && t - series.time[series.time.length - 1] > kSilent) append(t - 1e-3, {});  // a gap
  series.time.push(t);
  series.tick.push(frame.state ? frame.state.tick_time * 1e-3 : null);
  series.status.push(frame.state ? frame.state.status : 0);
  const modes = frame.modes;
  (modes ? modes.label : []).forEach((label, i) => {
    if (!series.modes.has(label)) series.modes.set(label, {natural_frequency: [], damping_ratio: []});
    const curves = series.modes.get(label);
    for (const key of kCurves) {
      while (curves[key].length < series.time.length - 1) curves[key].push(null);
      curves[key].push(modes[key][i]);
    }
  });
  for (const curves of series.modes.values()) {
    for (const key of kCurves) while (curves[key].length < series.time.length) curves[key].push(null);
  }
  let old = 0;
  while (series.time[old] < t - kMinute) ++old;
  if (!old) return;
  for (const list of [series.time, series.tick, series.status]) list.splice(0, old);
  for (const [label, curves] of series.modes) {
    for (const key of kCurves) curves[key].splice(0, old);
    if (kCurves.every((key) => curves[key].every((v) => v === null))) series.modes.delete(label);
  }
}

function poles() {
  const modes = page.frame && page.frame.modes, all = [];
  (modes ? modes.label : []).forEach((label, i) => {
    [0, 1].forEach((which) => {
      const re = modes.eigenvalue_real[i][which], im = modes.eigenvalue_imag[i][which];
      if (Number.isFinite(re) && Number.isFinite(im) && re !== null && im !== null) all.push({label, which, re, im, bound: modes.eigenvalue_bound[i]});
    });
  });
  return all;
}

function measured() {
  return (page.setup.identified || []).flatMap(({natural_frequency: w, damping_ratio: z}) => {
    const im = z < 1 ? w * Math.sqrt(1 - z * z) : 0, split = z > 1 ? w * Math.sqrt(z * z - 1) : 0;
    return [1, -1].map((s) => ({re: -z * w + s * split, im: s * im}));
  });
}

async function connect() {
  for (;;) {
    try {
      page.setup = await get('/setup');
      break;
    } catch {
      link(false, 'no connection; trying again');
      await new Promise((done) => setTimeout(done, 1000));
    }
  }
  text('source', page.setup.source);
  $('source').title = page.setup.source;
  fillPlaces();
  $('pause').hidden = !page.setup.live;
  if (page.setup.live) return stream();
  $('replay').hidden = false;
  $('time').max = page.setup.duration;
  link(true, page.setup.damage ? `log: ${page.setup.damage}` : 'log');
  const history = await get('/history');
  forget();
  Object.assign(series, {time: history.time, tick: history.tick_time, status: history.status});
  for (const [label, curves] of Object.entries(history.mode)) series.modes.set(Number(label), curves);
  pump();
}

function stream() {
  const events = new EventSource('/stream');
  events.onopen = () => link(true, 'connected');
  events.onmessage = (e) => {
    if (!page.connected) link(true, 'connected');
    take(JSON.parse(e.data));
  };
  events.onerror = () => {
    link(false, 'connection lost; trying again');
    events.close();
    setTimeout(connect, 1000);  // the server may have come back with another arm
  };
}

/// While the page is paused, messages are kept for the curves, and what is shown stays.
function setPaused(on) {
  page.paused = on;
  held = on ? structuredClone(series) : null;
  text('pause', on ? 'Go on' : 'Pause');
  $('pause').setAttribute('aria-pressed', String(on));
  if (!on && page.latest) page.frame = page.latest;
  soon();
}
$('pause').addEventListener('click', () => setPaused(!page.paused));

// Replay: one request at a time, always for the time that it is then
async function pump() {
  let then = performance.now();
  for (;;) {
    await new Promise((done) => setTimeout(done, 66));
    const now = performance.now();
    if (replay.playing) {
      replay.time = Math.min(replay.time + 1e-3 * (now - then) * kSpeeds[replay.speed], page.setup.duration);
      if (replay.time >= page.setup.duration) setPlaying(false);
    }
    then = now;
    if (replay.at === replay.time && page.connected) continue;
    const wanted = replay.time;
    const frame = await get(`/frame?t=${wanted.toFixed(6)}`).catch(() => null);
    if (!frame) {
      link(false, 'connection lost; trying again');
      await new Promise((done) => setTimeout(done, 700));
      continue;
    }
    replay.at = wanted;
    if (!page.connected) link(true, page.setup.damage ? `log: ${page.setup.damage}` : 'log');
    take(frame);
    later('curves');  // the time itself moves
  }
}
function setPlaying(on) {
  replay.playing = on;
  text('play', on ? 'Pause' : 'Play');
}
function setSpeed(step) {
  replay.speed = Math.min(kSpeeds.length - 1, Math.max(0, replay.speed + step));
  text('speed', `${kSpeeds[replay.speed]} ×`);
}
$('play').addEventListener('click', () => {
  if (!replay.playing && replay.time >= page.setup.duration) replay.time = 0;
  setPlaying(!replay.playing);
});
$('slower').addEventListener('click', () => setSpeed(-1));
$('faster').addEventListener('click', () => setSpeed(1));
$('time').addEventListener('input', () => page.seek(Number($('time').value)));
setSpeed(0);
$('zoom_in').addEventListener('click', () => plots.frequency.zoom(1 / 2));
$('zoom_out').addEventListener('click', () => plots.frequency.zoom(2));
$('zoom_all').addEventListener('click', () => plots.frequency.all());
page.seek = (t) => {
  replay.time = Math.min(t, page.setup.duration);
  setPlaying(false);
};

// Response, at most once a second, where an arm is known and moved
function fillPlaces() {
  const select = $('place'), kept = select.value;
  const joints = page.setup.arm ? page.setup.arm.joints : [];
  const places = [...['x', 'y', 'z', 'about x', 'about y', 'about z'].map((d, i) => [`tip/${i}`, `tip, ${d}`]),
    ...joints.map((joint, i) => [`joint/${i}`, `q${i + 1}: ${joint.name}`])];
  select.replaceChildren(...places.map(([value, said]) => new Option(said, value)));
  if (kept && places.some(([value]) => value === kept)) select.value = kept;
  if (!select.value) select.value = 'tip/0';
}
/// Why the arm of the configuration cannot be drawn: said once, in the middle of its panel.
function otherJoints() {
  const {state: s, modes} = page.frame, n = s ? s.n : modes ? modes.n : 0, own = page.setup.arm ? page.setup.arm.joints.length : n;
  return n && n !== own ? `other joints: the loop has ${n}, ${page.setup.arm.name} has ${own}.\nStart with the --config of this loop.` : '';
}
const posture = () => (page.frame.state || page.frame.modes || {}).joint_position;
let askedFor = '';
async function askResponse() {
  if (!page.setup || !page.frame || !page.frame.messages || !page.connected || document.hidden) return;
  const other = otherJoints(), q = posture();
  if (!page.setup.arm || other || !q) {
    const note = other ? '–' : page.setup.arm ? 'waiting for a posture' : 'start with --config to see the response';
    if (page.response || note !== page.responseNote) soon('response');
    page.responseNote = note;
    page.response = null;
    return;
  }
  const key = [$('place').value, page.frame.state && page.frame.state.mode, page.start, ...q.map((x) => x.toFixed(3))].join();
  if (key === askedFor || page.paused) return;
  askedFor = key;
  try {
    page.response = await get(`/response?at=${$('place').value}${page.setup.live ? '' : `&t=${replay.time.toFixed(6)}`}`);
  } catch (e) {
    page.response = null;
    page.responseNote = e.told ? e.message : 'no response';
    if (!e.told) askedFor = '';
  }
  soon('response', 'numbers');
}
setInterval(askResponse, 1000);
$('place').addEventListener('change', askResponse);

/// Whether the modes that the loop has are those of the configuration's gains.
function sameGains() {
  const modes = page.frame.modes, response = page.response;
  if (!modes || !response || modes.natural_frequency.length !== response.natural_frequency.length) return !modes;
  const sorted = (list) => list.filter((v) => v !== null).sort((a, b) => a - b);
  return kCurves.every((key) => {
    const a = sorted([...modes[key]]), b = sorted([...response[key]]);
    return a.length === b.length && a.every((v, i) => Math.abs(v - b[i]) <= 0.02 * Math.abs(b[i]));
  });
}

function choose(label) {
  page.chosen = page.chosen === label ? null : label;
  soon();
}
$('copy').addEventListener('click', async () => {
  const worst = page.frame.alarms.worst_posture.map((q) => +q.toFixed(6)).join(',');
  try {
    await navigator.clipboard.writeText(worst);
    text('copied', 'copied, rad');
  } catch {
    const range = document.createRange();
    range.selectNodeContents($('worst'));
    getSelection().removeAllRanges();
    getSelection().addRange(range);
    text('copied', 'selected: copy it with Ctrl-C');
  }
});
for (const id of ['amplitude', 'pace']) $(id).addEventListener('input', () => soon('arm', 'numbers'));

/// Period of the loop and ticks in a second: from the configuration, or from ticks and times.
let first = null, rate = null;
function period() {
  const {state: s} = page.frame;
  if (s && (!first || s.tick < first.tick || s.utime - first.utime > 1e7)) first = s;
  if (s && s.utime - first.utime > 1e6) rate = 1e6 * (s.tick - first.tick) / (s.utime - first.utime);
  return page.setup.period || (rate ? 1 / rate : null);
}

function shape() {
  if (page.chosen === null || !page.frame) return null;
  const pace = Number($('pace').value), amplitude = Number($('amplitude').value);
  const phase = reducedMotion() ? 0 : 2 * Math.PI * pace * performance.now() * 1e-3;  // at rest: how far it goes
  if (typeof page.chosen === 'string') {
    const row = page.response && page.response.zero_modes[Number(page.chosen.slice(5)) - 1];
    return row ? {label: page.chosen, re: row, im: row.map(() => 0), phase, amplitude} : null;
  }
  const modes = page.frame.modes, i = modes ? modes.label.indexOf(page.chosen) : -1;
  if (i < 0 || modes.shape_real[i].some((x) => x === null)) return null;
  return {label: page.chosen, re: modes.shape_real[i], im: modes.shape_imag[i], phase, amplitude,
    frequency: modes.natural_frequency[i]};
}

// Drawing
const kDraw = {
  arm() {
    const moving = shape();
    page.tip = arm.draw(page.setup.arm, posture(), moving, {walls: page.setup.arm ? page.setup.arm.walls : [], force: force(), note: otherJoints()});
    if (moving && !reducedMotion() && ['running', 'log'].includes(state())) later('arm');
  },
  poles() {
    const {frame} = page, T = period();
    page.poles = map.draw(poles(), measured(), wantedRatio(page), page.chosen);
    page.origin = map.origin;
    $('circle').hidden = !frame.sampled;
    if (frame.sampled) drawCircle($('circle'), sampledPoles(frame.sampled, T));
    sampledNumbers(page, T);
  },
  numbers,
  curves,
  response() {
    drawResponse(plots.magnitude, plots.phase, page.response, page.responseNote);
  },
};

function numbers() {
  const {frame, setup} = page, {state: s, modes} = frame, now = state(), quiet = now === 'silent' || now === 'gone';
  showLink(now);
  document.querySelector('main').classList.toggle('gone', quiet);
  const lag = s && modes ? (s.utime - modes.utime) * 1e-6 : 0;
  for (const id of ['pole_panel', 'mode_panel']) $(id).classList.toggle('gone', !quiet && lag > kOldModes);
  notice($('silence'), ...(quiet ? [now === 'gone' ? `No connection to the monitor: what is shown is ${ageText()} old` : `The loop is silent for ${ageText()}: what is shown is old`, silenceAdvice(now, setup.source)]
    : now === 'log' && frame.age > kSilent ? [`No message for ${ageText()} before this time`, silenceAdvice(now)]
      : lag > kOldModes ? [`Modes are ${Math.floor(lag)} s older than the state`, ['Is the analysis on (analysis.where), and does its status say why it stopped?']] : [null, []]));
  notice($('fault'), ...(s && s.fault ? [`Fault: ${s.fault_text}`, [faultAdvice(s.fault_text), `It latched at tick ${s.fault_tick}. ` +
    'The brake acts until dashpot_release, dashpot_reset, or dashpot command --release.'], {text: 'docs/safety.md: faults', href: '/safety.md'}] : [null, []]));
  text('clock', frame.messages ? `${page.paused ? 'paused at ' : ''}${time().toFixed(2)} s` : '');
  text('status', s ? (s.fault ? `fault: ${s.fault_text}` : `${['joint', 'Cartesian'][s.mode] || ''} mode, ${s.status_text}`) : '');
  $('status').className = `badge ${!s || quiet ? '' : s.fault || s.status ? 'bad' : 'good'}`;
  const moving = shape(), pace = Number($('pace').value);
  text('arm_note', setup.arm ? `${setup.arm.name}, ${setup.arm.joints.length} joint${setup.arm.joints.length === 1 ? '' : 's'}` +
    (moving && moving.frequency && !reducedMotion() ? `; slowed ${number(moving.frequency / (2 * Math.PI) / pace, 2)} times` : '') : '');
  text('amplitude_text', `${(Number($('amplitude').value) * 180 / Math.PI).toFixed(0)}°`);
  text('pace_text', `${pace.toFixed(2)} Hz`);
  $('pace_label').hidden = reducedMotion();
  if (!setup.live) {
    if (document.activeElement !== $('time') || replay.playing) $('time').value = replay.time;
    text('time_text', `${replay.time.toFixed(2)} s`);
  }
  text('response_note', !page.response ? '' : sameGains() ? 'at this posture' : "of the configuration's gains; the loop's are others");
  period();
  chips(page, choose);
  modeTable(page);
  jointTable(page);
  loopNumbers(page, rate);
  alarms(page);
}

function curves() {
  const data = held || series, t = time(), live = page.setup.live, wanted = wantedRatio(page), T = period();
  const x = {range: live ? [Math.max(t - kMinute, data.time[0] || 0), Math.max(t, 1)] : [0, page.setup.duration || 1], text: ' s', reach: live ? kSilent : Infinity};
  const marks = page.setup.identified || [];
  const levels = (key) => marks.map((m, i) => ({value: m[key], text: i ? '' : 'measured'}));
  const of = (key) => [...data.modes].map(([label, all]) => ({x: data.time, y: all[key], label, name: `mode ${label}`, width: label === page.chosen ? 3 : 1.6}));
  plots.frequency.draw({title: 'natural frequency, rad/s; time, s', x, y: {log: true}, curves: of('natural_frequency'), levels: levels('natural_frequency'), cursor: t,
    empty: 'natural frequency: no modes'});
  plots.ratio.draw({title: 'damping ratio; time, s', x, y: {log: 'auto'}, curves: of('damping_ratio'), cursor: t, empty: 'damping ratio: no modes',
    levels: [...(wanted > 0 ? [{value: wanted, text: `wanted ${number(wanted, 3)}`}] : []), ...levels('damping_ratio')]});
  const over = T && data.tick.some((v) => v > 0.5e6 * T) ? `, period ${tickText(1e6 * T)} µs` : '';
  plots.ticks.draw({title: `tick, µs${over}; strip: status, orange if not ok; time, s`, x, y: {}, cursor: t, empty: 'no states',
    curves: [{x: data.time, y: data.tick, colour: 'accent', name: 'tick', unit: ' µs', width: 1}],
    strip: strip(data)});
  legends(page, data, wanted);
}
/// Where the status changes to ok or from it.
function strip({time: at, status}) {
  const all = [];
  status.forEach((s, i) => {
    const name = s ? 'bad' : 'good';
    if (!all.length || all[all.length - 1].colour !== name || i + 1 === status.length) all.push({x: at[i], colour: name});
  });
  return all;
}

function draw(now) {
  if (!page.setup || !page.frame) return;
  let wait = Infinity;
  for (const [part, how] of [...dirty]) {
    const rest = how === 'later' ? kEvery[part] - (now - (drawnAt[part] || 0)) : 0;
    if (rest > 0) {
      wait = Math.min(wait, rest);
      continue;
    }
    dirty.delete(part);
    drawnAt[part] = now;
    kDraw[part]();
  }
  if (wait < Infinity) request(wait);
}
connect();
