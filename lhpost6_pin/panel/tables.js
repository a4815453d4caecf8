// What the page lists: axes, interlocks, bars, recordings, faults, log.
import { decimals, factor, follow, make, measure, meter, number, part, show, slug, spoken, trimmed, typedNumber, write } from "./parts.js";

const LISTED = 10, KEPT = 400; // bars below each other; entries of the log on the page

// ------------------------------------------------------------------------------------------------ axes
export function buildAxes(hello, send, complain) {
  const rows = hello.axes.map((axis, k) => {
    const unit = hello.units[axis], free = hello.axes_free.includes(axis);
    const limit = hello.limits.displacement[k] * factor(unit);
    const inputs = ["setpoint", "span"].map((what) => {
      const input = make("input", { type: "number", id: `${what}-${axis}`, step: unit === "deg" ? "0.1" : "1" });
      input.setAttribute("aria-label", `${what} of ${axis} in ${unit}`);
      input.dataset.hint = `${what === "span" ? "Amplitude of the function generator" : "Where the axis rests"}; limit ± ${limit.toPrecision(3)} ${unit}`;
      if (!free) input.dataset.never = `${axis} is locked on this machine`;
      follow(input, () => {
        const value = typedNumber(input);
        if (Number.isFinite(value)) send({ do: what, axis, value: value / factor(unit) });
        else { complain(`The ${what} of ${axis} is no number; enter one in ${unit}, with a decimal point.`); input.dataset.held = "0"; }
      });
      return make("td", {}, input);
    });
    const figures = ["reference", "feedback", "error"].map((what) => make("td", { className: "number", id: `${what}-${axis}` }, make("b", { textContent: "–" })));
    const bar = make("td", {}, Object.assign(meter("", true), { id: `demand-${axis}` }));
    return make("tr", { className: free ? "" : "locked" }, make("th", { scope: "row", textContent: axis }), ...inputs, ...figures,
      make("td", { className: "unit", textContent: unit }), bar);
  });
  part("axes").tBodies[0].replaceChildren(...rows);
}
export function showSettings(hello, state) {
  hello.axes.forEach((axis, k) => {
    const unit = hello.units[axis];
    for (const what of ["setpoint", "span"]) show(part(`${what}-${axis}`), trimmed(state[what][k] * factor(unit), decimals(unit) + 1));
  });
}
export function showPlace(hello, reference, feedback) { // numbers beside them, a few times a second: they are to be read
  hello.axes.forEach((axis, k) => {
    const unit = hello.units[axis], digits = decimals(unit), scale = factor(unit);
    const values = { reference: reference[k] * scale, feedback: feedback[k] * scale, error: (reference[k] - feedback[k]) * scale };
    for (const [what, value] of Object.entries(values)) write(part(`${what}-${axis}`).firstChild, number(value, digits));
    measure(part(`demand-${axis}`), feedback[k] / hello.limits.displacement[k]);
  });
}

// ------------------------------------------------------------------------------------------------ interlocks
function buildInterlocks(interlocks, send, complain) {
  const rows = interlocks.map(({ name }) => {
    const id = `interlock-${slug(name)}`, said = spoken(name);
    const on = make("input", { type: "checkbox", id: `${id}-on` });
    const limit = make("input", { type: "number", id, min: "0", step: "1" });
    on.setAttribute("aria-label", `interlock of ${said} on`);
    limit.setAttribute("aria-label", `limit of ${said} in percent of capacity`);
    on.dataset.hint = "Off: this interlock does not trip";
    const demand = name === "force" || name === "overturning" ? "what the present demand adds to rest" : "the present demand";
    limit.dataset.hint = `Trips when ${demand} passes this share of ${name === "force" ? "what rest leaves of the range" : "the capacity"}`;
    follow(on, () => send({ do: "interlock", name, on: on.checked }));
    follow(limit, () => {
      const value = typedNumber(limit);
      if (value > 0) send({ do: "interlock", name, limit: value / 100 });
      else { complain(`The limit of ${said} is no number above 0; enter one in % of the capacity.`); limit.dataset.held = "0"; }
    });
    const bar = meter("", false);
    bar.id = `${id}-share`;
    bar.querySelector("b").append(make("u"));
    return make("tr", { id: `${id}-row` }, make("td", {}, on), make("th", { scope: "row", textContent: said }), make("td", {}, bar),
      make("td", { id: `${id}-where` }), make("td", {}, limit), make("td", { id: `${id}-state` }));
  });
  const body = part("interlocks").tBodies[0];
  body.replaceChildren(...rows);
  body.dataset.names = interlocks.map(({ name }) => name).join();
}
export function showInterlocks({ interlocks, trip }, send, complain) { // true if the table was built anew
  const built = part("interlocks").tBodies[0].dataset.names !== interlocks.map(({ name }) => name).join();
  if (built) buildInterlocks(interlocks, send, complain);
  const cause = interlocks.find(({ name }) => trip && spoken(trip).startsWith(spoken(name)));
  for (const { name, share, limit, where, on } of interlocks) {
    const id = `interlock-${slug(name)}`, bar = part(`${id}-share`);
    measure(bar, share, limit);
    bar.querySelector("u").style.left = `${100 * Math.min(limit, 1)}%`;
    write(part(`${id}-where`), where ?? "");
    show(part(`${id}-on`), on);
    show(part(id), trimmed(100 * limit, 1));
    const tripped = cause !== undefined && cause.name === name;
    part(`${id}-row`).className = tripped ? "tripped" : on ? "" : "out";
    write(part(`${id}-state`), tripped ? "! tripped" : !on ? "off" : share >= limit ? "! over" : share >= 0.8 * limit ? "near" : "✓");
  }
  return built;
}

// ------------------------------------------------------------------------------------------------ bars
const TITLES = { force: "Force", pressure: "Pressure", spool: "Spool", limits: "Limits" };
export function showBars(bars) {
  const known = Object.entries(bars).map(([group, shares]) => `${group}:${Object.keys(shares)}`).join(";");
  const place = part("bars");
  if (place.dataset.known !== known) {
    place.dataset.known = known;
    place.replaceChildren(...Object.entries(bars).map(([group, shares]) => {
      const names = Object.keys(shares), list = make("div", { className: "list" }, ...names.map((name) => {
        const bar = meter(name, true);
        bar.id = `bar-${group}-${slug(name)}`;
        bar.title = `${TITLES[group] ?? group} ${name}, share of capacity`;
        return bar;
      }));
      list.style.setProperty("--label", `${0.85 * Math.max(...names.map((name) => name.length))}ch`);
      list.style.gridTemplateRows = `repeat(${Math.min(LISTED, names.length)}, auto)`;
      return make("div", { className: names.length > LISTED ? "group wide" : "group" }, make("h2", { textContent: TITLES[group] ?? spoken(group) }), list);
    }));
  }
  for (const [group, shares] of Object.entries(bars))
    for (const [name, share] of Object.entries(shares)) measure(part(`bar-${group}-${slug(name)}`), share);
}

// ------------------------------------------------------------------------------------------------ recordings, faults, log
export function showRecordings(recordings, writing) {
  const list = part("recordings"), known = [...recordings, "", ...writing].join("\n");
  if (list.dataset.known === known) return;
  list.dataset.known = known;
  const none = make("li", { className: "none", textContent: "No recording yet. Every other command reads these files." });
  const items = [...recordings].reverse().map((path) => make("li", { title: path }, make("bdi", { textContent: path })));
  items.unshift(...writing.map((name) => make("li", { className: "none", textContent: `writing ${name} …` })));
  list.replaceChildren(...(items.length ? items : [none]));
}
export function showFaults(faults, send) {
  const list = part("faults"), id = ({ name, where }) => `fault-${slug(name)}-${slug(where)}`;
  const known = faults.map(id).join();
  const built = list.dataset.known !== known;
  if (built) {
    list.dataset.known = known;
    list.replaceChildren(...faults.map((fault) => {
      const box = make("input", { type: "checkbox", id: id(fault) });
      box.setAttribute("role", "switch");
      follow(box, () => send({ do: "fault", name: fault.name, where: fault.where, on: box.checked }));
      return make("li", {}, make("label", {}, box, make("span", { textContent: `${spoken(fault.name)}, ${fault.where}` })));
    }));
  }
  for (const fault of faults) {
    const box = part(id(fault));
    show(box, fault.on);
    box.parentElement.className = fault.on ? "on" : "";
    write(box.nextSibling, `${spoken(fault.name)}, ${fault.where}${fault.on ? " (on)" : ""}`);
  }
  return built;
}
export function addLog(entries) {
  const list = part("log");
  for (const { time, who, what } of entries)
    list.prepend(make("li", {}, make("time", { textContent: time }), make("b", { textContent: who ?? "" }), make("span", { textContent: what })));
  while (list.children.length > KEPT) list.lastChild.remove();
}
export function clearLog() {
  part("log").replaceChildren();
}
