// Colour, mark and dash of a mode, which follow from its label alone, and the buttons that choose one.
//
// Seven colours, which people with any kind of colour vision can tell apart (Okabe and Ito, and ink), and six marks: 42
// labels in a row look different. The program numbers modes on by 32 when it has to begin again, and then the first one
// looks like the first one. A label that is text, such as a zero mode's, has the colour of ink.
import {$, button, element, fill} from './dom.js';
import {colour} from './theme.js';

const kMarks = ['M1 0A1 1 0 1 1-1 0A1 1 0 1 1 1 0Z', 'M-.87-.87H.87V.87H-.87Z', 'M0-1.2L1.1.75H-1.1Z',
  'M0-1.25L1.05 0 0 1.25-1.05 0Z', 'M0 1.2L-1.1-.75H1.1Z',
  'M-.42-1.15H.42V-.42H1.15V.42H.42V1.15H-.42V.42H-1.15V-.42H-.42Z'];
const kPaths = kMarks.map((d) => new Path2D(d));
const kDashes = [[], [8, 4], [2, 3], [10, 3, 2, 3]];
const place = (label) => (typeof label === 'number' ? Math.max(0, label - 1) % 32 : 0);
const colourName = (label) => (typeof label === 'number' ? `mode-${place(label) % 7}` : 'ink');
export const modeColour = (label) => colour(colourName(label));
export const modeDash = (label) => kDashes[place(label) % 4];

/// Paints the mark of a mode in its colour; `open` leaves it empty.
export function drawMark(c, label, x, y, r, open = false) {
  const path = kPaths[place(label) % 6];
  c.save();
  c.translate(x, y);
  c.scale(r, r);
  c.setLineDash([]);
  c.fillStyle = c.strokeStyle = modeColour(label);
  c.lineWidth = 1.6 / r;
  if (open) c.stroke(path);
  else c.fill(path);
  c.restore();
}

/// Returns the mark of a mode as an element of the page, with its dash if it is for curves.
export function markElement(label, dashed = false) {
  const dashes = modeDash(label).map((x) => x / 8).join(' '), box = dashed ? '-3 -1.4 6 2.8' : '-1.4 -1.4 2.8 2.8';
  const mark = element('span', {});
  mark.innerHTML = `<svg class="${dashed ? 'mark wide' : 'mark'}" aria-hidden="true" viewBox="${box}">` +
    (dashed ? `<path d="M-3 0H3" stroke="currentColor" stroke-width=".3" stroke-dasharray="${dashes}"/>` : '') +
    `<path d="${kMarks[place(label) % 6]}" fill="currentColor"/></svg>`;
  mark.firstChild.style.color = `var(--${colourName(label)})`;
  return mark.firstChild;
}

/// A button for each {label, text} of a mode or zero mode whose shape can be shown.
export function fillChips(items, chosen, choose) {
  const focused = document.activeElement?.closest('#chips') ? document.activeElement.dataset.label : null;
  const fresh = fill('chips', JSON.stringify([items, chosen]), () => items.map(({label, text}) =>
    button(() => choose(label), {'aria-pressed': label === chosen, 'data-label': label},
      ...(typeof label === 'number' ? [markElement(label), ' '] : []), text)));
  if (fresh && focused) [...$('chips').children].find((chip) => chip.dataset.label === focused)?.focus();
}
