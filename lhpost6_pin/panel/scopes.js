// Scopes: reference and feedback of the last seconds, drawn at the screen's rate.
import { GRAVITY, factor, part } from "./parts.js";

const CAPACITY = 1 << 17; // samples kept: the longest window at the full rate
const BEHIND = 0.12; // [s] that the scopes stand behind the newest sample: between two messages they go on smoothly
const LEFT = 52, RIGHT = 6, TOP = 15, BOTTOM = 15; // [pixels] around a plot
const SOURCES = ["reference", "feedback", "acceleration_reference", "acceleration", "force"];

let times, rows, widths, count = 0, offset = null, hello = null;
const ranges = new Map();

export function prepareScopes(found) {
  hello = found;
  widths = { force: Math.max(found.actuators.length, 1) };
  times = new Float64Array(CAPACITY);
  rows = Object.fromEntries(SOURCES.map((name) => [name, new Float32Array(CAPACITY * (widths[name] ?? 6))]));
  count = 0;
  ranges.clear();
}
export function addSamples(scope) { // true if there are new ones
  if (!scope || !scope.t.length) return false;
  if (count && scope.t[0] < times[(count - 1) % CAPACITY]) { count = 0; offset = null; } // a clock that began anew
  scope.t.forEach((t, k) => {
    const at = count % CAPACITY;
    times[at] = t;
    for (const name of SOURCES) if (scope[name]?.[k]) rows[name].set(scope[name][k].slice(0, widths[name] ?? 6), at * (widths[name] ?? 6));
    count++;
  });
  const seen = performance.now() / 1000 - scope.t[scope.t.length - 1];
  offset = offset === null || Math.abs(seen - offset) > 0.5 ? seen : offset + 0.05 * (seen - offset);
  return true;
}
export function newest(name) {
  const width = widths[name] ?? 6, at = (count - 1) % CAPACITY;
  return count ? rows[name].subarray(at * width, (at + 1) * width) : null;
}

function firstAfter(time) { // index of the first sample not before a time
  let low = Math.max(0, count - CAPACITY), high = count;
  while (low < high) {
    const mid = (low + high) >> 1;
    if (times[mid % CAPACITY] < time) low = mid + 1; else high = mid;
  }
  return low;
}
function nice(step) { // 1, 2 or 5 times a power of ten
  const power = 10 ** Math.floor(Math.log10(step)), share = step / power;
  return (share <= 1 ? 1 : share <= 2 ? 2 : share <= 5 ? 5 : 10) * power;
}
function even(span) { // the largest of 1, 2 or 5 times a power of ten that fits three times: three to seven lines
  const power = 10 ** Math.floor(Math.log10(span / 3)), share = span / 3 / power;
  return (share < 2 ? 1 : share < 5 ? 2 : 5) * power;
}
function range(key, low, high, least) { // grows at once, shrinks when half of it would do
  if (!(low <= high)) [low, high] = [-least, least];
  const mid = (low + high) / 2, half = Math.max((high - low) / 2, least);
  let [a, b] = ranges.get(key) ?? [mid, mid];
  if (mid - half < a || mid + half > b || 2.5 * half < b - a) [a, b] = [mid - 1.15 * half, mid + 1.15 * half];
  ranges.set(key, [a, b]);
  return [a, b];
}

function curve(pen, { data, width, column, scale }, from, to, x, y) {
  pen.beginPath();
  let last = -1, low = 0, high = 0, before = -Infinity;
  for (let k = from; k < to; k++) { // several samples on a pixel: their least and greatest
    const at = k % CAPACITY, value = data[at * width + column] * scale, t = times[at], pixel = Math.floor(x(t));
    if (pixel !== last || t - before > 0.5) {
      if (last >= 0 && high > low) { pen.lineTo(last, y(low)); pen.lineTo(last, y(high)); }
      if (t - before > 0.5) pen.moveTo(x(t), y(value)); else pen.lineTo(x(t), y(value));
      [last, low, high] = [pixel, value, value];
    } else { low = Math.min(low, value); high = Math.max(high, value); }
    before = t;
  }
  pen.stroke();
}
function sketch(canvas, key, title, curves, least, head, seconds) {
  const sharp = window.devicePixelRatio, width = canvas.clientWidth, height = canvas.clientHeight;
  if (!width || !height) return;
  if (canvas.width !== Math.round(width * sharp) || canvas.height !== Math.round(height * sharp))
    [canvas.width, canvas.height] = [Math.round(width * sharp), Math.round(height * sharp)];
  const pen = canvas.getContext("2d");
  pen.setTransform(sharp, 0, 0, sharp, 0, 0);
  pen.clearRect(0, 0, width, height);
  const to = firstAfter(head + 1e-9), from = Math.min(firstAfter(head - seconds), to);
  let low = Infinity, high = -Infinity;
  for (const { data, width: n, column, scale } of curves)
    for (let k = from; k < to; k++) {
      const value = data[(k % CAPACITY) * n + column] * scale;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  const [a, b] = range(key, low, high, least), right = width - RIGHT, foot = height - BOTTOM;
  const x = (t) => right + ((t - head) / seconds) * (right - LEFT), y = (v) => foot - ((v - a) / (b - a)) * (foot - TOP);
  pen.font = "11px system-ui, sans-serif";
  pen.lineWidth = 1;
  pen.fillStyle = "#57606a";
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  const step = even(b - a), digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  for (let v = Math.ceil(a / step) * step; v <= b; v += step) {
    const up = Math.round(y(v)) + 0.5, level = Math.abs(v) < step / 1e3 ? 0 : v;
    pen.strokeStyle = level === 0 ? "#aab3bc" : "#e4e8ec";
    pen.beginPath(); pen.moveTo(LEFT, up); pen.lineTo(right, up); pen.stroke();
    pen.fillText(level.toFixed(digits).replace("-", "−"), LEFT - 5, up);
  }
  pen.textBaseline = "alphabetic";
  pen.textAlign = "center";
  const pace = nice(seconds / 8);
  for (let back = 0; back <= seconds + 1e-9; back += pace) {
    const across = Math.round(x(head - back)) + 0.5;
    pen.strokeStyle = "#e4e8ec";
    pen.beginPath(); pen.moveTo(across, TOP); pen.lineTo(across, foot); pen.stroke();
    const last = back === 0;
    pen.textAlign = last ? "right" : "center";
    pen.fillText(last ? "0 s" : `−${Number(back.toFixed(2))}`, last ? right : across, height - 3);
  }
  pen.strokeStyle = "#9aa4ae";
  pen.strokeRect(LEFT + 0.5, TOP + 0.5, right - LEFT - 1, foot - TOP - 1);
  pen.textAlign = "left";
  pen.fillStyle = "#1b1f24";
  pen.font = "600 12px system-ui, sans-serif";
  pen.fillText(title, LEFT, TOP - 4);
  pen.save();
  pen.beginPath();
  pen.rect(LEFT, TOP, right - LEFT, foot - TOP);
  pen.clip();
  pen.lineJoin = "round";
  for (const drawn of curves) {
    [pen.strokeStyle, pen.lineWidth] = drawn.reference ? ["#b4bcc4", 5] : ["#0072b2", 1.6];
    curve(pen, drawn, Math.max(from - 1, count - CAPACITY, 0), to, x, y);
  }
  pen.restore();
}
function draw() {
  requestAnimationFrame(draw);
  if (!hello) return;
  const last = count ? times[(count - 1) % CAPACITY] : 0;
  const head = offset === null ? last : Math.min(last, performance.now() / 1000 - offset - BEHIND);
  const seconds = Number(part("scope-window").value), axis = Math.max(part("scope-axis").selectedIndex, 0), leg = Math.max(part("scope-actuator").selectedIndex, 0);
  const name = hello.axes[axis], unit = hello.units[name], angle = unit === "deg" || unit === "rad";
  const spin = angle ? factor(unit) : 1 / GRAVITY, spun = angle ? `${unit}/s²` : "g";
  const pair = (first, second, scale) => [{ data: rows[first], width: 6, column: axis, scale, reference: true }, { data: rows[second], width: 6, column: axis, scale }];
  sketch(part("scope-displacement"), `d${axis}`, `Displacement ${name} [${unit}]`, pair("reference", "feedback", factor(unit)), angle ? 0.02 : 0.5, head, seconds);
  sketch(part("scope-acceleration"), `a${axis}`, `Acceleration ${name} [${spun}]`, pair("acceleration_reference", "acceleration", spin), angle ? 1 : 0.005, head, seconds);
  const force = [{ data: rows.force, width: widths.force, column: leg, scale: 1e-3 }];
  sketch(part("scope-force"), `f${leg}`, `Force ${hello.actuators[leg] ?? ""} [kN]`, force, 1, head, seconds);
}
requestAnimationFrame(draw);
