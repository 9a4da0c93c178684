// Ratios and margins over many postures: requested in the background, drawn, with buttons to go to the worst.
import {$, button, fill} from '../shared/dom.js';
import {number, rounded} from '../shared/numbers.js';
import {kDesigns, kStyles, nameOf} from './designs.js';
import {post} from './requests.js';

const kPostures = 2000;
const kMost = 100;  // postures in a part
const kRest = 150;  // ms without a change before the next part
const kPart = 20;   // ms, intended duration of a part
const kWorst = {smallest_ratio: 'ratio', gain_margin: 'margin'};

/// The numbers of many postures for the designs, a part at a time, and paused while something moves: a slider waits for
/// one part at most. A changed design begins again.
export class Workspace {
  constructor(token, changed) {
    Object.assign(this, {token, changed, found: {}, asked: {}, busy: false, count: 25, moved: -Infinity});
  }
  look(designs) {
    for (const [name, design] of Object.entries(designs)) {
      const key = JSON.stringify(design);
      if (this.asked[name] === key) continue;
      this.asked[name] = key;
      this.found[name] = {postures: 0, smallest_ratio: [], gain_margin: [], worst: {}, error: ''};
    }
    if (!this.busy) this.run();
  }
  async run() {
    this.busy = true;
    const isOpen = ([, {postures, error}]) => postures < kPostures && !error;
    for (let open; (open = Object.entries(this.found).find(isOpen));) {
      for (let left; (left = this.moved + kRest - performance.now()) > 0;) {
        await new Promise((done) => setTimeout(done, left));
      }
      const [name] = open, found = this.found[name], began = performance.now(), first = found.postures;
      const count = Math.min(this.count, kPostures - first);
      const body = `{"design":${this.asked[name]},"seed":1,"first":${first},"count":${count}}`;
      const part = await post(this.token, '/workspace', body);
      this.count = Math.round(Math.min(kMost, Math.max(2, count * kPart / (performance.now() - began))));
      if (this.found[name] !== found) continue;  // of a design that has changed
      Workspace.add(found, part);
      this.changed();
    }
    this.busy = false;
  }
  static add(found, part) {
    if (part.error) {
      found.error = part.error;
      return;
    }
    found.postures += part.count;
    for (const key of Object.keys(kWorst)) {
      found[key].push(...part[key].filter((x) => x !== null));
      const worst = part.worst[key];
      if (worst && !(found.worst[key]?.value <= worst.value)) found.worst[key] = worst;
    }
  }
}

/// The share of postures, in %, with less: at most 200 points, with both ends.
function share(values) {
  const sorted = Float64Array.from(values).sort(), n = sorted.length, count = Math.min(n, 200);
  const at = Array.from({length: count}, (_, i) => Math.round(i * (n - 1) / Math.max(count - 1, 1)));
  return {x: at.map((i) => sorted[i]), y: at.map((i) => 100 * (i + 1) / n)};
}

/// Draws the shares of ratios or margins of both designs.
function drawShares(plot, found, key, title) {
  const curves = kDesigns.map((name) => ({...share(found[name]?.[key] || []), ...kStyles[name], unit: ' %'}))
    .filter((curve) => curve.x.length > 1);
  const ends = curves.flatMap(({x}) => [x[0], x.at(-1)]), low = Math.min(...ends), high = Math.max(...ends);
  const margin = key === 'gain_margin', log = margin && low > 0, room = 0.03 * (high - low || 1);
  const range = !curves.length ? [0, 1] : log ? [low / 1.1, high * 1.1] : [low - room, high + room];
  plot.draw({title, x: {range, log, text: ''}, y: {range: [0, 100]}, curves, empty: 'no postures yet',
    lines: margin && !log ? [] : [{value: margin ? 1 : 0}]});
}

export function drawWorkspace(page, {ratios, margins}) {
  const {found} = page.workspace;
  drawShares(ratios, found, 'smallest_ratio', 'postures with a smaller ratio, %; smallest ratio');
  drawShares(margins, found, 'gain_margin', 'postures with less margin, %; gain margin');
  $('workspace_note').textContent = kDesigns.filter((name) => found[name])
    .map((name) => `${nameOf(name)}: ${found[name].error || `${found[name].postures} postures`}`).join(', ');
  const text = (name, key, value) => `${nameOf(name)}: worst ${kWorst[key]} ${number(value, 3)}`;
  const worst = kDesigns.flatMap((name) => Object.entries(found[name]?.worst || {})
    .map(([key, {value, q}]) => ({text: text(name, key, value), to: {q: q.map((x) => rounded(x, 8)), edited: name}})));
  fill('worst', worst.map((one) => one.text).join(), () => worst.map((one) =>
    button(() => page.edit((state) => Object.assign(state, structuredClone(one.to)), true), {}, one.text)));
}
