// Small helpers of all files of the page: its parts by id, units, bars, inputs that follow the state.
export const part = (id) => document.getElementById(id);
export const slug = (text) => text.replace(/[^A-Za-z0-9]+/g, "-");
export const spoken = (name) => name.replace(/_/g, " ");
export const GRAVITY = 9.80665; // [m/s2] standard gravity, unit of accelerations on the page
const FACTORS = { mm: 1e3, m: 1, deg: 180 / Math.PI, rad: 1 };

export function factor(unit) { // SI to what is shown
  return FACTORS[unit] ?? 1;
}
export function decimals(unit) {
  return { mm: 1, m: 4, deg: 3, rad: 5 }[unit] ?? 3;
}
export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}
export function write(element, text) { // only what changes: the page stays selectable and calm
  if (element.textContent !== text) element.textContent = text;
}
export function number(value, digits) { // never "-0.0"
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−");
}

export function meter(name, middle) { // a bar from the middle, or from the left
  const box = make("div", { className: middle ? "meter middle" : "meter" });
  if (name) box.append(make("small", { textContent: name }));
  box.append(make("b", {}, make("i")), make("span"));
  return box;
}
export function measure(box, share, limit = 1) { // near from 80 % of the limit on, over from the limit on: colour, pattern, weight and sign
  const bar = box.querySelector("i"), figure = box.querySelector("span"), middle = box.classList.contains("middle");
  const width = (middle ? 50 : 100) * Math.min(Math.abs(share), 1);
  bar.style.width = `${width}%`;
  bar.style.left = middle ? `${share < 0 ? 50 - width : 50}%` : "0";
  const state = Math.abs(share) >= limit ? "over" : Math.abs(share) >= 0.8 * limit ? "near" : "";
  bar.className = figure.className = state;
  write(figure, `${state === "over" ? "!" : ""}${number(100 * share, 0)} %`);
}

const HELD = 800; // [ms] that an order may take until the state shows it
export function follow(input, onChange) { // an input that shows the state, but not while one types, nor until an order is answered
  input.addEventListener("input", () => { input.dataset.typed = "1"; });
  input.addEventListener("change", () => {
    delete input.dataset.typed;
    input.dataset.held = String(performance.now() + HELD);
    onChange();
  });
  input.addEventListener("blur", () => { delete input.dataset.typed; });
}
export function show(input, value) {
  if (input.dataset.typed || performance.now() < Number(input.dataset.held ?? 0)) return;
  if (input.type === "checkbox") { if (input.checked !== value) input.checked = value; }
  else if (input.value !== value) {
    input.value = value;
    if (document.activeElement === input) input.select?.(); // what is typed next replaces it, as in a field just entered
  }
}
export function typedNumber(input) { // "05" is what some browsers leave of "0,5"
  return /^-?0\d/.test(input.value) ? NaN : input.valueAsNumber;
}
export function trimmed(value, digits) { // for an input: 100, not 100.000
  return String(Number(value.toFixed(digits)));
}
