// Elements of the page.

export function element(id) {
  return document.getElementById(id);
}

export function newElement(tag, properties = {}) {
  return Object.assign(document.createElement(tag), properties);
}
