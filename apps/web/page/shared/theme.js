// Colours of the theme, light or dark (style.css has both), and whether motion is wanted.

let known = new Map();  // name -> colour, because asking the style sheet takes long

export function colour(name) {
  if (!known.has(name)) {
    known.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  }
  return known.get(name);
}

/// Sets the theme that the address or the browser asks for, and lets a button switch it.
export function followTheme(button, changed) {
  const dark = matchMedia('(prefers-color-scheme: dark)'), shown = document.documentElement.dataset;
  const set = (name) => {
    shown.theme = name;
    known = new Map();
    changed();
  };
  const asked = new URLSearchParams(location.search).get('theme');
  const preferred = () => (dark.matches ? 'dark' : 'light');
  set(['dark', 'light'].includes(asked) ? asked : preferred());
  dark.addEventListener('change', () => set(preferred()));
  button.addEventListener('click', () => set(shown.theme === 'dark' ? 'light' : 'dark'));
}

const still = matchMedia('(prefers-reduced-motion: reduce)');
export const reducedMotion = () => still.matches;
