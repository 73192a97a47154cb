/** Elements of the page: found, filled and shown without touching what has not changed. */

export const $ = (id) => document.getElementById(id);

export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function toggle(element, attribute, on) {
  if (element.hasAttribute(attribute) !== on) element.toggleAttribute(attribute, on);
}

export function set(element, attribute, value) {
  if (element.getAttribute(attribute) !== value) element.setAttribute(attribute, value);
}

/** Make an element: `make('td', {class: 'l'}, 'text' | element, ...)`. */
export function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/**
 * Let the children of `parent` be one element an item, kept by the item's key; `create(item)` makes one,
 * `update(element, item)` fills it.
 */
export function each(parent, items, key, create, update) {
  const known = new Map([...parent.children].map((child) => [child.dataset.key, child]));
  items.forEach((item, k) => {
    const name = String(key(item));
    let child = known.get(name);
    if (child) known.delete(name);
    else {
      child = create(item);
      child.dataset.key = name;
    }
    if (parent.children[k] !== child) parent.insertBefore(child, parent.children[k] ?? null);
    update(child, item);
  });
  for (const child of known.values()) child.remove();
}
