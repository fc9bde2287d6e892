// Small things that every part of the page uses. Text is only ever set as text.

export const $ = (id) => document.getElementById(id);

export function text(id, value) {
  const element = $(id), wanted = String(value);
  if (element.textContent !== wanted) element.textContent = wanted;
}

export function number(value, digits = 2) {
  if (value === null || value === undefined) return "–";
  return value.toLocaleString("en", { maximumFractionDigits: digits }).replace("-", "−").replace(/^−0$/, "0");
}

export function make(tag, ...children) {
  const element = document.createElement(tag);
  element.append(...children);
  return element;
}

export function fill(parent, count, create, update) { // rows are kept and written anew: making them 30 times a second costs
  while (parent.children.length > count) parent.lastElementChild.remove();
  while (parent.children.length < count) parent.append(create());
  for (let i = 0; i < count; i++) update(parent.children[i], i);
}
