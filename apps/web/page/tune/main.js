// The page of `dashpot tune`: fields of two designs, and drawings of the program's answers.
import {ArmView} from '../shared/arm_view.js';
import {$, fillPairs, listen} from '../shared/dom.js';
import {fillChips} from '../shared/mode_marks.js';
import {number, rounded} from '../shared/numbers.js';
import {Plot, View} from '../shared/plot.js';
import {PoleMap} from '../shared/pole_map.js';
import {Redraw} from '../shared/redraw.js';
import {followTheme, reducedMotion} from '../shared/theme.js';
import {armFields, loopFields, postureFields} from './arm_fields.js';
import {drawMotion, fillComparison} from './comparison.js';
import {kDesigns, kTaskAxes, nameOf} from './designs.js';
import {dragTip} from './drag_tip.js';
import {fillExport, listenToExport} from './export_panel.js';
import {at, Form} from './form_fields.js';
import {gainFields, structure} from './gain_fields.js';
import {showRefusals} from './refusals.js';
import {Tuning} from './tuning.js';
import {drawWorkspace} from './workspace.js';

/// The fields, built again if the design needs others, and the buttons that follow the state.
function makeFields(page) {
  const form = new Form((change, ended) => page.edit(change, ended)), posture = postureFields(form, page);
  posture.push(form.slider({label: 'touches', key: 'touches', unit: 'N/m', low: 1, high: 1e6, log: true,
    ...at(() => page.state, 'touches')}));
  $('touch').append(posture.at(-1).element);
  let fields = [], built = '';
  return () => {
    const {state, store} = page, key = `${state.edited} ${structure(page.design())}`;
    if (key !== built) {
      built = key;
      const groups = {gains: gainFields(form, page), loop: loopFields(form, page), parts: armFields(form, page)};
      fields = Object.values(groups).flat();
      for (const [id, group] of Object.entries(groups)) $(id).replaceChildren(...group.map((field) => field.element));
    }
    for (const field of [...posture, ...fields]) field.refresh();
    $('design_name').textContent = nameOf(state.edited);
    for (const one of $('which').children) one.setAttribute('aria-pressed', one.dataset.design === state.edited);
    $('undo').disabled = !store.past.length;
    $('redo').disabled = !store.future.length;
    for (const choice of ['place', 'motion']) $(choice).value = state[choice];
  };
}

/// The drawings and texts of the page, by the names of its parts.
function makeParts(page, redraw) {
  const soon = (part) => () => redraw.soon(part), shared = new View();
  const arm = new ArmView($('arm'), soon('arm'));
  const poles = new PoleMap($('poles'), soon('poles'), (label) => page.choose(label));
  const plot = (id, part, view) => new Plot($(id), soon(part), view);
  const motion = {time: plot('time', 'motion'), magnitude: plot('magnitude', 'motion', shared),
    phase: plot('phase', 'motion', shared)};
  const workspace = {ratios: plot('ratios', 'workspace'), margins: plot('margins', 'workspace')};
  page.tipOnScreen = dragTip(arm, page.setup.arm, () => page.state.q,
    (q, ended) => page.edit((state) => { state.q = q.map((x) => rounded(x, 6)); }, ended));
  const polesOf = (name) => (page.answer(name) ? page.answer(name).modes : []).flatMap((mode, i) =>
    mode.eigenvalues.map(([re, im], which) => ({label: i + 1, which, re, im, bound: mode.error_bound})));
  return {
    arm: (now) => {
      const {chosen, setup, state} = page, still = reducedMotion();
      const shape = chosen && page.answer()?.modes[chosen - 1]?.shape.slice(0, setup.q.length);
      arm.draw(setup.arm, state.q, shape ? {label: chosen, re: shape.map(([re]) => re), im: shape.map(([, im]) => im),
        phase: still ? 0 : now / 400, amplitude: 0.25} : null);
      if (shape && !still) redraw.later('arm');
    },
    poles: () => {
      const others = polesOf(page.other()).filter(({im}) => im >= 0);
      page.poles = poles.draw(polesOf(page.state.edited), others, page.wantedRatio(), page.chosen);
    },
    motion: () => drawMotion(page, motion),
    texts: () => {
      fillComparison(page);
      document.body.classList.toggle('old', kDesigns.some((name) => page.old[name]));
      showRefusals(page);
      fillShapes(page);
      fillExport(page);
    },
    workspace: () => drawWorkspace(page, workspace),
  };
}

/// The buttons of modes whose shape can be shown, and the zero modes in words.
function fillShapes(page) {
  const {modes, zero_modes: zero} = page.answer() || {modes: [], zero_modes: []};
  fillChips(modes.map((mode, i) => ({label: i + 1, text: `${number(mode.natural_frequency, 3)} rad/s`})), page.chosen,
    (label) => page.choose(label));
  fillPairs('zero', zero.map((mode, i) => {
    const most = Math.max(...mode.map(Math.abs)), moving = mode.map((x, k) => [k, x / most]);
    return [zero.length > 1 ? `zero mode ${i + 1}` : 'zero mode', moving.filter(([, x]) => Math.abs(x) > 0.15)
      .map(([k, x]) => `joint ${k + 1} ${number(x, 2)}`).join(', ')];
  }));
}

/// Buttons, choices and keys.
function listenToControls(page, redraw) {
  const {setup, store} = page, {arm, robot} = setup, edit = (change) => page.edit(change, true);
  $('source').textContent = robot.config || `${arm.name}, ${robot.urdf.split('/').pop()}`;
  $('source').title = `${robot.urdf}, from ${robot.base} to ${robot.tip}`;
  $('preset').replaceChildren(new Option('your own', ''), ...setup.presets.map(({name}) => new Option(name, name)));
  $('place').replaceChildren(...kTaskAxes.map((name, i) => new Option(`tip ${name}`, `tip/${i}`)),
    ...arm.joints.map(({name}, i) => new Option(name, `joint/${i}`)));
  const choose = (key) => () => edit((state) => { state[key] = $(key).value; });
  const retell = () => {
    page.current = false;
    redraw.soon('texts');
  };
  listen('change', {place: choose('place'), motion: choose('motion'), format: retell});
  listen('change', {preset: () => {
    const preset = setup.presets.find(({name}) => name === $('preset').value);
    if (preset) edit((state) => { Object.assign(state[state.edited], structuredClone(preset.design)); });
    $('preset').value = '';
  }});
  const show = (name) => {
    edit((state) => { state.edited = name; });
    redraw.soon();
  };
  for (const button of $('which').children) button.addEventListener('click', () => show(button.dataset.design));
  listen('click', {undo: () => store.undo(), redo: () => store.redo(),
    copy_over: () => edit((state) => { state[page.other()] = structuredClone(state[state.edited]); })});
  window.addEventListener('keydown', (e) => {
    const key = e.key.toLowerCase(), control = e.ctrlKey || e.metaKey;
    if (e.target.matches?.('textarea, select, input:not([type=range], [type=checkbox])')) return;
    if (control && (key === 'z' || key === 'y')) {
      if (key === 'y' || e.shiftKey) store.redo();
      else store.undo();
      e.preventDefault();
    } else if (!control && !e.altKey && kDesigns.includes(key)) {
      show(key);
    }
  });
}

const setup = await (await fetch('/setup')).json();
const redraw = new Redraw({}, {every: {arm: 60}, drawn: () => page.noteDrawn()});
const page = window.dashpot = new Tuning(setup, () => {  // to look into, and for tests
  refresh();
  redraw.soon('arm');
}, (...parts) => redraw.soon(...parts));
const refresh = makeFields(page);
redraw.parts = makeParts(page, redraw);
listenToExport(page.store);
listenToControls(page, redraw);
followTheme($('theme'), () => redraw.soon());
window.addEventListener('resize', () => redraw.soon());
page.store.changed(true);
page.ready = true;
