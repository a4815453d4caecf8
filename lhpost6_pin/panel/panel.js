// The panel: the websocket, and the state of the table on the page.
import { buildPrograms, connectControls, described, forget, lock, noteRefusal, refresh, sendName, showRecording, waits } from "./controls.js";
import { part, write } from "./parts.js";
import { addSamples, newest, prepareScopes } from "./scopes.js";
import { addLog, buildAxes, clearLog, showBars, showFaults, showInterlocks, showPlace, showRecordings, showSettings } from "./tables.js";

const AGAIN = 1000, SILENT = 4000, READ = 120; // [ms] until the next attempt; without a message until the connection counts as lost; between numbers
const LOST = "Connection lost, trying again. The controls are disabled; the table is left to the server's interlocks.";
const KEY = ownKey();
let socket = null, hello = null, known = "", heard = 0, read = 0;

function ownKey() { // by which the server recognises this page after a lost connection
  const made = [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  try {
    const kept = sessionStorage.getItem("panel-key") ?? made;
    sessionStorage.setItem("panel-key", kept);
    return kept;
  } catch { return made; /* a browser that keeps nothing */ }
}
function send(order) { // a new order takes the answer to the last one off the page
  if (socket?.readyState !== WebSocket.OPEN) return;
  dismiss();
  socket.send(JSON.stringify(order));
}
function complain(what) {
  noteRefusal();
  write(part("refusal"), what);
  part("refusal-box").hidden = false;
}
function dismiss() {
  part("refusal-box").hidden = true;
  part("refusal").textContent = "";
}
function notify(what) { // stays until it is dismissed
  write(part("notice"), what);
  part("notice-box").hidden = false;
}

// ------------------------------------------------------------------------------------------------ messages
function greet(found) {
  hello = found;
  document.body.classList.remove("lost");
  clearLog(); // the server tells it anew
  const shape = JSON.stringify(found);
  if (shape !== known) { // another server: its axes, motions and actuators
    known = shape;
    buildAxes(found, send, complain);
    buildPrograms(found);
    prepareScopes(found);
    part("trainer").hidden = !found.trainer;
  }
  const view = new URL(found.view, location.href).href;
  if (part("view").src !== view) part("view").src = view;
  socket.send(JSON.stringify({ do: "join", key: KEY }));
  if (part("name").value) sendName();
}
function steps({ pressure, platen }) {
  const reached = pressure === "off" ? 0 : pressure === "low" ? 1 : platen === "raised" ? 3 : 2;
  ["off", "low", "high", "raised"].forEach((name, k) => {
    const step = part(`step-${name}`);
    step.className = k < reached ? "done" : k === reached ? "here" : k === 3 && platen === "moving" ? "going" : "";
    if (k === reached) step.setAttribute("aria-current", "step"); else step.removeAttribute("aria-current");
  });
}
function progress({ name, state, time, duration }) {
  const busy = state !== "stopped";
  write(part("program-name"), busy ? `${name}, ${state}` : `${waits() ? "Checking" : "Chosen"}: ${described()}`);
  write(part("progress-text"), !busy ? "" : state === "stopping" ? "coming to rest" : duration === null ? `${time.toFixed(1)} s, until stopped` : `${time.toFixed(1)} of ${duration.toFixed(1)} s`);
  part("progress").value = busy && duration ? Math.min(time / duration, 1) : 0;
  write(part("program-state"), !busy && waits() ? "checking" : state);
  write(part("run"), !busy && waits() ? "Checking" : "Run");
}
function link({ link: { text, title } }) {
  write(part("link"), text);
  part("link").title = title;
}
function tell(state) {
  write(part("machine"), state.machine);
  write(part("pressure-state"), state.pressure);
  write(part("platen-state"), state.platen);
  write(part("time"), `${state.time.toFixed(2)} s`);
  write(part("role"), state.you.role);
  write(part("operator"), state.operator === null ? "nobody" : state.you.role === "operator" ? `${state.operator} (you)` : state.operator);
  write(part("watchers"), String(state.watchers));
  write(part("trip-reason"), state.trip ?? "not tripped");
  document.body.classList.toggle("tripped", Boolean(state.trip));
  link(state);
  steps(state);
  showSettings(hello, state);
  showInterlocks(state, send, complain);
  if (hello.trainer) showFaults(state.faults, send);
  showRecording(state);
  showRecordings(state.recordings, state.writing);
  addLog(state.log);
  addSamples(state.scope);
  if (performance.now() - read > READ) {
    read = performance.now();
    showBars(state.bars);
    if (newest("feedback")) showPlace(hello, newest("reference"), newest("feedback"));
  }
  write(part("next-step"), refresh(state));
  write(part("next-sign"), state.trip ? "!" : "→");
  progress(state.program);
}
function take(message) {
  heard = performance.now();
  if (message.kind === "hello") greet(message);
  else if (message.kind === "refusal") complain(message.what);
  else if (message.kind === "notice") notify(message.what);
  else if (message.kind === "state" && hello) tell(message);
}

// ------------------------------------------------------------------------------------------------ connection
function lose() {
  hello = null;
  document.body.classList.remove("tripped");
  document.body.classList.add("lost");
  forget();
  lock("no connection to the panel's server");
  write(part("next-step"), LOST);
  write(part("next-sign"), "!");
  for (const id of ["link", "role"]) write(part(id), "–");
}
function connect() {
  const address = new URL(`socket${location.search}`, location.href); // what opened the page opens the socket
  address.protocol = address.protocol.replace("http", "ws");
  address.hash = "";
  const mine = (socket = new WebSocket(address));
  heard = performance.now();
  mine.onmessage = ({ data }) => { if (mine === socket) take(JSON.parse(data)); };
  mine.onclose = () => {
    if (mine !== socket) return;
    socket = null;
    lose();
    setTimeout(connect, AGAIN);
  };
}
setInterval(() => { // a server that fell silent, or a computer that slept
  if (socket && performance.now() - heard > SILENT) {
    const silent = socket;
    socket = null;
    silent.close();
    lose();
    connect();
  }
}, AGAIN);

part("refusal-close").addEventListener("click", dismiss);
part("notice-close").addEventListener("click", () => { part("notice-box").hidden = true; });
try { part("name").value = localStorage.getItem("panel-name") ?? ""; } catch { /* a browser that keeps nothing */ }
connectControls(send, complain);
lock("no connection to the panel's server");
connect();
