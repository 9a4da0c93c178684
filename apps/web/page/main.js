// Takes frames from the program, keeps the last minute, and has everything drawn.
import {ArmView} from '/arm.js';
import {drawModes, drawResponse, drawTicks} from '/curves.js';
import {modeColour, number} from '/draw.js';
import {PoleMap, drawCircle, sampledPoles} from '/poles.js';

const $ = (id) => document.getElementById(id);
const kMinute = 60;  // s of curves that a live page keeps
const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 5, 10, 30];

const page = {setup: null, frame: null, chosen: null, connected: false, stale: 0, start: null,
  poles: [], tip: null, frames: 0, response: null, responseNote: '', errors: []};
window.dashpot = page;  // to look into, and for tests
window.addEventListener('error', (e) => page.errors.push(e.message));
window.addEventListener('unhandledrejection', (e) => page.errors.push(String(e.reason)));

const arm = new ArmView($('arm')), map = new PoleMap($('poles'));
const series = {time: [], tick: [], status: [], modes: new Map()};
const replay = {time: 0, playing: true, speed: 3, at: null};

// Theme
const dark = matchMedia('(prefers-color-scheme: dark)');
function setTheme(name) { document.documentElement.dataset.theme = name; page.rows = null; }
const asked = new URLSearchParams(location.search).get('theme');
setTheme(asked === 'dark' || asked === 'light' ? asked : dark.matches ? 'dark' : 'light');
dark.addEventListener('change', () => setTheme(dark.matches ? 'dark' : 'light'));
$('theme').addEventListener('click', () => setTheme(document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark'));

// Messages
async function get(path) {
  const answer = await fetch(path);
  const body = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(body.error || answer.statusText), {told: true});
  return body;
}

function link(good, text) {
  page.connected = good;
  $('link').className = `badge ${good ? 'good' : 'bad'}`;
  if ($('link').textContent !== text) $('link').textContent = text;
}

function forget() {
  for (const list of [series.time, series.tick, series.status]) list.length = 0;
  series.modes.clear();
  map.forget();
}

function take(frame) {
  const before = page.frame;
  const fresh = !before || before.messages !== frame.messages;
  page.frame = frame;
  ++page.frames;
  if (!frame.messages) return;
  if (page.start === null) page.start = frame.utime;
  if (page.setup.live && before && frame.utime < before.utime - 1e6) {  // another loop, or its restart
    page.start = frame.utime;
    forget();
  }
  if (fresh) page.stale = performance.now();
  const t = time();
  map.note(t, poles());
  if (page.setup.live && fresh) append(t, frame);
}
const time = () => (page.setup.live ? (page.frame.utime - page.start) * 1e-6 : replay.time);

function append(t, frame) {
  if (series.time.length && t <= series.time[series.time.length - 1]) return;
  if (frame.utime && t - series.time[series.time.length - 1] > 1) append(t - 1e-3, {});  // a gap
  series.time.push(t);
  series.tick.push(frame.state ? frame.state.tick_time * 1e-3 : null);
  series.status.push(frame.state ? frame.state.status : 0);
  const modes = frame.modes;
  (modes ? modes.label : []).forEach((label, i) => {
    if (!series.modes.has(label)) series.modes.set(label, {natural_frequency: [], damping_ratio: []});
    const curves = series.modes.get(label);
    for (const key of ['natural_frequency', 'damping_ratio']) {
      while (curves[key].length < series.time.length - 1) curves[key].push(null);
      curves[key].push(modes[key][i]);
    }
  });
  for (const curves of series.modes.values()) {
    for (const key of ['natural_frequency', 'damping_ratio']) while (curves[key].length < series.time.length) curves[key].push(null);
  }
  let old = 0;
  while (series.time[old] < t - kMinute) ++old;
  if (!old) return;
  for (const list of [series.time, series.tick, series.status]) list.splice(0, old);
  for (const [label, curves] of series.modes) {
    for (const key of ['natural_frequency', 'damping_ratio']) curves[key].splice(0, old);
    if (curves.damping_ratio.every((v) => v === null) && curves.natural_frequency.every((v) => v === null)) series.modes.delete(label);
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
  $('source').textContent = page.setup.source;
  $('source').title = page.setup.source;
  fillPlaces();
  if (page.setup.live) return stream();
  $('replay').hidden = false;
  $('time').max = page.setup.duration;
  link(true, page.setup.damage ? `log: ${page.setup.damage}` : 'log');
  const history = await get('/history');
  forget();
  series.time = history.time;
  series.tick = history.tick_time;
  series.status = history.status;
  for (const [label, curves] of Object.entries(history.mode)) series.modes.set(Number(label), curves);
  pump();
}

function stream() {
  const events = new EventSource('/stream');
  events.onopen = () => link(true, 'connected');
  events.onmessage = (e) => {
    link(true, 'connected');
    take(JSON.parse(e.data));
  };
  events.onerror = () => {
    link(false, 'connection lost; trying again');
    events.close();
    setTimeout(connect, 1000);  // the server may have come back with another arm
  };
}

// Replay: one request at a time, always for the time that it is then
async function pump() {
  let then = performance.now();
  for (;;) {
    await new Promise((done) => setTimeout(done, 33));
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
    link(true, page.setup.damage ? `log: ${page.setup.damage}` : 'log');
    take(frame);
  }
}
function setPlaying(on) {
  replay.playing = on;
  $('play').textContent = on ? 'Pause' : 'Play';
}
function setSpeed(step) {
  replay.speed = Math.min(kSpeeds.length - 1, Math.max(0, replay.speed + step));
  $('speed').textContent = `${kSpeeds[replay.speed]} ×`;
}
$('play').addEventListener('click', () => {
  if (!replay.playing && replay.time >= page.setup.duration) replay.time = 0;
  setPlaying(!replay.playing);
});
$('slower').addEventListener('click', () => setSpeed(-1));
$('faster').addEventListener('click', () => setSpeed(1));
$('time').addEventListener('input', () => {
  replay.time = Math.min(Number($('time').value), page.setup.duration);
  setPlaying(false);
});
setSpeed(0);
page.seek = (t) => {
  replay.time = Math.min(t, page.setup.duration);
  setPlaying(false);
};

// Response, at most once a second, and only where an arm is known
function fillPlaces() {
  const select = $('place'), kept = select.value;
  const joints = page.setup.arm ? page.setup.arm.joints : [];
  const places = [...['x', 'y', 'z', 'about x', 'about y', 'about z'].map((d, i) => [`tip/${i}`, `tip, ${d}`]),
    ...joints.map((joint, i) => [`joint/${i}`, `joint ${i + 1}: ${joint.name}`])];
  select.replaceChildren(...places.map(([value, text]) => new Option(text, value)));
  if (kept && places.some(([value]) => value === kept)) select.value = kept;
  if (!select.value) select.value = 'tip/0';
}
let askedFor = '';
async function askResponse() {
  if (!page.setup || !page.frame || !page.frame.messages || !page.connected || document.hidden) return;
  if (!page.setup.arm) {
    page.responseNote = 'start with --config to see the response';
    return;
  }
  const key = `${$('place').value}/${page.frame.messages}/${page.start}`;
  if (key === askedFor) return;
  askedFor = key;
  try {
    page.response = await get(`/response?at=${$('place').value}${page.setup.live ? '' : `&t=${replay.time.toFixed(6)}`}`);
  } catch (e) {
    page.response = null;
    page.responseNote = e.told ? e.message : 'no response';
  }
}
setInterval(askResponse, 1000);
$('place').addEventListener('change', askResponse);

/// Whether the modes that the loop has are those of the configuration's gains.
function sameGains() {
  const modes = page.frame.modes, response = page.response;
  if (!modes || !response || modes.natural_frequency.length !== response.natural_frequency.length) return !modes;
  const sorted = (list) => list.filter((v) => v !== null).sort((a, b) => a - b);
  return ['natural_frequency', 'damping_ratio'].every((key) => {
    const a = sorted([...modes[key]]), b = sorted([...response[key]]);
    return a.length === b.length && a.every((v, i) => Math.abs(v - b[i]) <= 0.02 * Math.abs(b[i]));
  });
}

// Numbers
function text(id, value) { if ($(id).textContent !== value) $(id).textContent = value; }

function choose(label) {
  page.chosen = page.chosen === label ? null : label;
  page.rows = null;
}

function chips() {
  const modes = page.frame && page.frame.modes;
  const zero = page.response ? page.response.zero_modes.length : 0;
  const labels = [...(modes ? modes.label : []), ...Array.from({length: zero}, (_, i) => `zero ${i + 1}`)];
  const key = `${labels}|${page.chosen}|${document.documentElement.dataset.theme}`;
  if (page.rows === key) return;
  page.rows = key;
  const focused = document.activeElement && document.activeElement.dataset ? document.activeElement.dataset.label : undefined;
  $('chips').replaceChildren(...labels.map((label) => {
    const chip = document.createElement('button');
    chip.type = 'button';
    chip.textContent = typeof label === 'number' ? `mode ${label}` : label;
    chip.style.borderColor = typeof label === 'number' ? modeColour(label) : '';
    chip.setAttribute('aria-pressed', String(label === page.chosen));
    chip.dataset.label = label;
    chip.addEventListener('click', () => choose(label));
    return chip;
  }));
  if (focused) [...$('chips').children].find((chip) => chip.dataset.label === focused)?.focus();
}

function table() {
  const modes = page.frame && page.frame.modes, rows = $('rows');
  const count = modes ? modes.label.length : 0;
  text('modes_note', !modes ? 'none yet' : `${count}, and ${modes.zero_modes} zero; ` +
    `${['tracked', 'reused', 'solved directly'][modes.origin] || ''}${modes.status ? `; ${modes.status_text}` : ''}`);
  while (rows.rows.length > count) rows.deleteRow(-1);
  while (rows.rows.length < count) {
    const row = rows.insertRow();
    for (let i = 0; i < 6; ++i) row.insertCell();
    row.cells[0].append(document.createElement('i'), document.createTextNode(''));
  }
  for (let i = 0; i < count; ++i) {
    const {cells} = rows.rows[i], f = modes.natural_frequency[i], bound = modes.natural_frequency_bound[i];
    rows.rows[i].className = modes.label[i] === page.chosen ? 'chosen' : '';
    cells[0].firstChild.style.background = modeColour(modes.label[i]);
    cells[0].lastChild.data = modes.label[i];
    const texts = [number(f), number(f === null ? null : f / (2 * Math.PI), 3), number(modes.damping_ratio[i], 3),
      modes.kind_text[i], bound === null ? 'none' : number(bound, 2)];
    texts.forEach((value, k) => { if (cells[k + 1].textContent !== value) cells[k + 1].textContent = value; });
  }
}

function alarms() {
  const {state, sampled, alarms: all} = page.frame, none = '–';
  const cards = [
    ['smallest ratio so far', number(all.smallest_ratio, 3), all.smallest_ratio === null ? 'none' : all.smallest_ratio < 0.1 ? 'bad' : ''],
    ['smallest gain margin', all.smallest_margin === null ? (sampled ? '∞' : none) : `${number(all.smallest_margin, 3)} ×`,
      all.smallest_margin === null ? 'none' : all.smallest_margin < 1 ? 'bad' : ''],
    ['messages with a bound lost', String(all.bounds_lost), all.bounds_lost ? 'bad' : ''],
    ['messages without modes', String(all.modes_lost), all.modes_lost ? 'bad' : ''],
    ['latched fault', state && state.fault ? `${state.fault_text} (tick ${state.fault_tick})` : all.faults ? `${all.faults} before` : 'none', state && state.fault ? 'bad' : ''],
    ['overruns', state ? String(state.overruns) : none, state && state.overruns ? 'bad' : ''],
  ];
  if ($('alarms').children.length !== cards.length) {
    $('alarms').replaceChildren(...cards.map(() => {
      const card = document.createElement('div');
      card.append(document.createElement('b'), document.createElement('span'));
      return card;
    }));
  }
  cards.forEach(([name, value, kind], i) => {
    const card = $('alarms').children[i];
    if (card.className !== kind) card.className = kind;
    if (card.firstChild.textContent !== value) card.firstChild.textContent = value;
    if (card.lastChild.textContent !== name) card.lastChild.textContent = name;
  });
  const posture = all.worst_posture.map((q) => +q.toFixed(4)).join(',');
  $('copy').disabled = !posture;
  text('worst', posture ? `smallest ratio at --q ${posture}` : '');
}
$('copy').addEventListener('click', async () => {
  const posture = page.frame.alarms.worst_posture.map((q) => +q.toFixed(6)).join(',');
  try {
    await navigator.clipboard.writeText(posture);
    text('copied', 'copied, rad');
  } catch {
    const range = document.createRange();
    range.selectNodeContents($('worst'));
    getSelection().removeAllRanges();
    getSelection().addRange(range);
    text('copied', 'selected: copy it with Ctrl-C');
  }
});

function sampledNumbers(period) {
  const {sampled} = page.frame;
  const items = !sampled ? [['sampled loop', 'not analysed']] : [
    ['gain margin', sampled.gain_margin === null ? '∞' : `${number(sampled.gain_margin, 3)} ×`],
    ['largest |z|', sampled.spectral_radius === null ? '–' : sampled.spectral_radius.toFixed(6)],
    ...(page.setup.arm && page.setup.arm.missing_rotors
      ? [['rotors unknown', `${page.setup.arm.missing_rotors}: the margin is that of an arm without rotors`]] : []),
    ['period', period ? `${number(1e3 * period, 3)} ms` : '–']];
  const value = items.flat().join('|');
  if ($('sampled').dataset.value === value) return;
  $('sampled').dataset.value = value;
  $('sampled').replaceChildren(...items.flatMap(([name, said]) => {
    const dt = document.createElement('dt'), dd = document.createElement('dd');
    dt.textContent = name;
    dd.textContent = said;
    return [dt, dd];
  }));
}

/// The period of the loop: from the configuration, or from ticks and times.
let first = null;
function period() {
  if (page.setup.period) return page.setup.period;
  const {state} = page.frame;
  if (!state) return null;
  if (!first || state.tick < first.tick) first = state;
  return state.tick - first.tick > 200 ? 1e-6 * (state.utime - first.utime) / (state.tick - first.tick) : null;
}

function shape() {
  if (page.chosen === null || !page.frame) return null;
  const pace = Number($('pace').value), amplitude = Number($('amplitude').value);
  const phase = 2 * Math.PI * pace * performance.now() * 1e-3;
  if (typeof page.chosen === 'string') {
    const row = page.response && page.response.zero_modes[Number(page.chosen.slice(5)) - 1];
    return row ? {label: page.chosen, re: row, im: row.map(() => 0), phase, amplitude} : null;
  }
  const modes = page.frame.modes, i = modes ? modes.label.indexOf(page.chosen) : -1;
  if (i < 0 || modes.shape_real[i].some((x) => x === null)) return null;
  return {label: page.chosen, re: modes.shape_real[i], im: modes.shape_imag[i], phase, amplitude,
    frequency: modes.natural_frequency[i]};
}

// Drawing: arm at each animation frame, the rest thirty times a second
let drawn = 0;
function draw(now) {
  requestAnimationFrame(draw);
  if (!page.setup || !page.frame) return;
  const {frame} = page, moving = shape();
  const q = frame.state ? frame.state.joint_position : frame.modes && frame.modes.joint_position;
  page.tip = arm.draw(page.setup.arm, q, moving);
  if (now - drawn < 32) return;
  drawn = now;
  if (page.setup.live && page.connected) {
    link(true, performance.now() - page.stale > 2000 ? (frame.messages ? 'connected; the loop is silent' : 'connected; waiting for messages') : 'connected');
    if (performance.now() - page.stale > 2000) $('link').className = 'badge bad';
  }
  const {state, modes} = frame;
  const wanted = page.setup.wanted_ratio[state && state.mode === 0 ? 'joint' : 'cartesian'];
  text('clock', frame.messages ? `${time().toFixed(2)} s` : '');
  text('status', state ? (state.fault ? `fault: ${state.fault_text}` : `${['joint', 'Cartesian'][state.mode] || ''} mode, ${state.status_text}`) : '');
  $('status').className = `badge ${!state ? '' : state.fault || state.status ? 'bad' : 'good'}`;
  text('arm_note', page.setup.arm ? `${page.setup.arm.name}, ${page.setup.arm.joints.length} joint${page.setup.arm.joints.length === 1 ? '' : 's'}` +
    (moving && moving.frequency ? `; slowed ${number(Math.max(moving.frequency / (2 * Math.PI) / Number($('pace').value), 0), 2)} times` : '') : '');
  text('amplitude_text', `${(Number($('amplitude').value) * 180 / Math.PI).toFixed(0)}°`);
  text('pace_text', `${Number($('pace').value).toFixed(2)} Hz`);
  if (page.setup.live === false) {
    if (document.activeElement !== $('time') || replay.playing) $('time').value = replay.time;
    text('time_text', `${replay.time.toFixed(2)} s`);
  }
  page.poles = map.draw(poles(), measured(), wanted, page.chosen);
  page.origin = map.origin;
  const T = period();
  drawCircle($('circle'), sampledPoles(frame.sampled, T));
  sampledNumbers(T);
  chips();
  table();
  alarms();
  const t = time(), span = page.setup.live ? [Math.max(t - kMinute, series.time[0] || 0), Math.max(t, 1)] : [0, page.setup.duration || 1];
  const marks = (page.setup.identified || []);
  drawModes($('frequency'), series, 'natural_frequency', 'natural frequency, rad/s', t,
    marks.map((m, i) => ({level: m.natural_frequency, text: i ? '' : 'measured'})), span, page.chosen);
  drawModes($('ratio'), series, 'damping_ratio', 'damping ratio', t, [
    ...(wanted ? [{level: wanted, text: `wanted ${wanted}`}] : []),
    ...marks.map((m, i) => ({level: m.damping_ratio, text: i ? '' : 'measured'}))], span, page.chosen);
  drawTicks($('ticks'), series, t, span, T);
  drawResponse($('magnitude'), $('phase'), page.response, page.responseNote || 'waiting for a posture');
  text('response_note', !page.response ? '' : sameGains() ? 'at this posture' : "of the configuration's gains; the loop's are others");
}
requestAnimationFrame(draw);
connect();
