// The design as a text for other programs, to save or copy; pictures and the address.
import {$, element, listen} from '../shared/dom.js';
import {crisp, cartesianImpedance, frankaRos} from './export_controllers.js';
import {command, configuration, matrices, python} from './export_dashpot.js';

const kFormats = [
  {name: 'configuration of Dashpot', file: 'tuned.yaml', text: configuration},
  {name: 'matrices for dashpot analyze', file: 'system.json', text: matrices},
  {name: 'command', file: 'tuned.sh', text: command},
  {name: 'crisp_controllers', file: 'crisp.yaml', text: crisp},
  {name: 'Cartesian-Impedance-Controller', file: 'controller_config.yaml', text: cartesianImpedance},
  {name: 'franka_ros', file: 'compliance.yaml', text: frankaRos},
  {name: 'Python', file: 'tuned.py', text: python},
];

export function fillExport(page) {
  const asked = page.asked[page.state.edited], answer = page.answer();
  if (!asked || !answer) return;
  const text = kFormats[$('format').value].text({setup: page.setup, q: asked.q, design: asked.design, answer});
  if ($('text').value !== text) $('text').value = text;
}

const tell = (text) => { $('done').textContent = text; };
function save(blob, name) {
  const link = element('a', {href: URL.createObjectURL(blob), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  tell(`${name} is saved by the browser`);
}
const clip = (text, what) => navigator.clipboard.writeText(text)
  .then(() => tell(`${what} is copied`), () => tell('the browser does not allow to copy'));

/// Saves some drawings below each other.
function savePicture() {
  const parts = ['poles', 'time', 'magnitude'].map($), sheet = element('canvas', {
    width: Math.max(...parts.map((part) => part.width)), height: parts.reduce((sum, part) => sum + part.height, 0)});
  const c = sheet.getContext('2d');
  c.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--panel');
  c.fillRect(0, 0, sheet.width, sheet.height);
  let y = 0;
  for (const part of parts) {
    c.drawImage(part, 0, y);
    y += part.height;
  }
  sheet.toBlob((blob) => save(blob, 'tuned.png'));
}

/// Offers the formats, and has the buttons do what they say.
export function listenToExport(store) {
  $('format').replaceChildren(...kFormats.map(({name}, i) => new Option(name, i)));
  listen('click', {
    download: () => save(new Blob([$('text').value], {type: 'text/plain'}), kFormats[$('format').value].file),
    copy: () => clip($('text').value, 'the text'),
    address: () => {
      store.writeAddress();
      clip(location.href, 'the address');
    },
    picture: savePicture,
  });
}
