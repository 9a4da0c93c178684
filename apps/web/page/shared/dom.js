// Elements of a page: found by id, made, and written to only if something changes.

export const $ = (id) => document.getElementById(id);

/// Makes an element. An attribute that is a function listens to the event of its name; undefined is left out.
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === 'function') made.addEventListener(key, value);
    else if (value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

export const button = (click, attributes, ...children) =>
  element('button', {type: 'button', click, ...attributes}, ...children);

/// Listens to an event of the elements with some ids: {id: what it does}.
export function listen(event, actions) {
  for (const [id, act] of Object.entries(actions)) $(id).addEventListener(event, act);
}

export function set(node, key, value) { if (node[key] !== value) node[key] = value; }
export const setText = (id, text) => set($(id), 'textContent', text);

/// Replaces the children of an element when `key` differs from the last time; returns whether it did.
export function fill(id, key, make) {
  if ($(id).dataset.key === key) return false;
  $(id).dataset.key = key;
  $(id).replaceChildren(...make());
  return true;
}

/// Fills a list of names and values.
export function fillPairs(id, items) {
  fill(id, JSON.stringify(items), () => items.flat().map((text, i) => element(i % 2 ? 'dd' : 'dt', {}, text)));
}

/// Keeps the errors of the page.
export function keepErrors(errors) {
  window.addEventListener('error', (e) => errors.push(e.message));
  window.addEventListener('unhandledrejection', (e) => errors.push(String(e.reason)));
}
