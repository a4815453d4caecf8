// Orders: what may be done now, why not otherwise, and what comes next.
import { GRAVITY, factor, make, part, show, typedNumber, write } from "./parts.js";

let hello = null, state = null, send = () => {}, complain = () => {}, loading = null, refused = 0;

const swept = () => part("wave").value === "sweep";
const source = () => (part("source-motion").checked ? "motion" : "generator");
const checked = (group) => [...part(`${group}-axes`).querySelectorAll("input:checked")].map((box) => box.value);

// ------------------------------------------------------------------------------------------------ programs
function generator() {
  const found = { do: "generator", wave: part("wave").value, frequency: part("frequency").valueAsNumber, axes: checked("generator") };
  if (swept()) return { ...found, to: part("to").valueAsNumber, duration: part("duration").valueAsNumber };
  return { ...found, cycles: part("cycles").value === "" ? null : part("cycles").valueAsNumber };
}
function motion() {
  return { do: "motion", name: part("motion").value, scale: part("motion-scale").valueAsNumber, axes: checked("motion").join("") };
}
function still() { // the axes of the generator whose span is zero
  return checked("generator").filter((axis) => state.span[hello.axes.indexOf(axis)] === 0);
}
function amiss() { // why the chosen program cannot be run, in words
  const chosen = source(), fields = chosen === "motion" ? ["motion-scale"] : swept() ? ["frequency", "to", "duration"] : ["frequency", "cycles"];
  for (const id of fields) {
    const value = typedNumber(part(id));
    if (!(value > 0) && !(id === "cycles" && part(id).value === "" && !part(id).validity.badInput)) return `the ${id.replace("motion-", "")} must be a number above 0`;
  }
  if (!checked(chosen).length) return "choose an axis of the program";
  if (chosen === "motion") return part("motion").value ? "" : "no motion to choose";
  const none = still();
  return none.length === checked(chosen).length ? `set a span of ${none.join(", ")} first: it is 0` : "";
}
function peaks(found, axis) { // of one axis of the generator: amplitude, and of sines velocity and acceleration
  const k = hello.axes.indexOf(axis), unit = hello.units[axis], scale = factor(unit), span = Math.abs(state.span[k]);
  const place = `${axis} ± ${Number((span * scale).toPrecision(4))} ${unit}`;
  if (found.wave === "triangle" || span === 0) return place;
  const turn = 2 * Math.PI * (swept() ? Math.max(found.frequency, found.to) : found.frequency);
  const speed = span * turn, acceleration = speed * turn, angle = unit === "deg" || unit === "rad";
  const rates = angle ? `${(speed * scale).toFixed(1)} ${unit}/s, ${(acceleration * scale).toFixed(1)} ${unit}/s²`
    : `${speed.toFixed(2)} m/s, ${(acceleration / GRAVITY).toFixed(2)} g`;
  const beyond = [speed > hello.limits.velocity[k] && "velocity", acceleration > hello.limits.acceleration[k] && "acceleration"].filter(Boolean);
  return `${place}, ${rates}${beyond.length ? ` (! beyond the ${beyond.join(" and ")} limit)` : ""}`;
}
export function described() { // the chosen program in a line
  if (source() === "motion") return `${part("motion").value}, scale ${part("motion-scale").value}, axes ${checked("motion").join(", ")}`;
  const found = generator();
  const length = swept() ? ` to ${found.to} Hz in ${found.duration} s` : found.cycles === null ? ", until stopped" : `, ${found.cycles} cycles`;
  return `${found.wave} ${found.frequency} Hz${length}; ${found.axes.map((axis) => peaks(found, axis)).join("; ")}`;
}
function run() { // loads the chosen program, and runs it unless it is refused
  const { state: now, number } = state.program;
  if (now !== "stopped") { send({ do: "run", number }); return; }
  loading = { after: number, refused };
  send(source() === "motion" ? motion() : generator());
}
function proceed() { // after each state: the chosen program is run once it is loaded, by its number
  if (!loading) return;
  const { number, checking } = state.program;
  if (loading.refused !== refused || state.trip || state.pressure !== "high" || state.you.role !== "operator") { loading = null; return; }
  if (checking !== null || number <= loading.after) return;
  loading = null;
  send({ do: "run", number });
}
export function waits() { // the name of the program that is being checked, or ""
  return state?.program.checking ?? (loading ? (source() === "motion" ? part("motion").value : part("wave").value) : "");
}
export function noteRefusal() {
  refused++;
}
export function forget() { // a connection that is lost takes a half-given order with it
  loading = null;
  state = null;
}

// ------------------------------------------------------------------------------------------------ what may be done
function reasons() { // by id: why not, or ""
  const { pressure, platen, trip, program, operator, recording, you, barred } = state, busy = program.state !== "stopped";
  const mine = you.role === "operator" ? "" : operator ? `you are watching: ${operator} has the controls` : "take control first";
  const tripped = trip ? "tripped: reset first" : "", parked = platen === "parked" || trip || !hello.parks ? "" : "park the platen first";
  const raised = tripped || (pressure !== "high" ? "high pressure first" : platen === "moving" ? "the platen is moving" : platen !== "raised" ? "raise the platen first" : "");
  const waiting = waits() ? `${waits()} is being checked; wait` : "";
  const sourced = mine || (busy ? "stop the program first" : waiting);
  return {
    "pressure-off": mine || (pressure === "off" ? "pressure is off" : pressure === "high" ? "low pressure first" : ""),
    "pressure-low": mine || (pressure === "low" ? "pressure is low" : pressure === "off" ? tripped : parked),
    "pressure-high": mine || (pressure === "high" ? "pressure is high" : pressure === "off" ? "low pressure first" : tripped),
    raise: mine || tripped || (pressure !== "high" ? "high pressure first" : platen === "raised" ? "already raised" : platen === "moving" ? "the platen is moving" : waiting || barred.raise),
    park: mine || tripped || (platen === "parked" ? "already parked" : platen === "moving" ? "the platen is moving" : busy ? "stop the program first" : waiting || barred.park),
    trip: trip ? "already tripped" : "", // anybody may
    reset: mine || (trip ? "" : "not tripped"),
    run: mine || raised || waiting || (program.state === "running" ? "running" : program.state === "stopping" ? "stopping" : busy ? "" : amiss()),
    hold: mine || tripped || (program.state === "holding" ? "holding" : program.state === "running" ? "" : "no program is running"),
    stop: mine || tripped || (program.state === "stopping" ? "stopping" : busy || waiting ? "" : "no program is running"),
    take: you.role === "operator" ? "you have the controls" : operator ? `${operator} has the controls and must release them first` : "",
    release: you.role === "operator" ? "" : "you do not have the controls",
    record: mine || (recording || pressure !== "off" ? "" : "nothing to record: pressure is off"),
    "record-name": mine || (recording ? "recording" : ""),
    name: "",
    ...Object.fromEntries(hello.axes.flatMap((axis) => [[`setpoint-${axis}`, mine || raised || waiting], [`span-${axis}`, mine || waiting]])),
    ...Object.fromEntries([...part("program").querySelectorAll("fieldset input, fieldset select")].map(({ id }) => [id, sourced])),
    ...Object.fromEntries([...part("interlocks").querySelectorAll("input")].map(({ id }) => [id, mine])),
    ...Object.fromEntries([...part("faults").querySelectorAll("input")].map(({ id }) => [id, ""])), // a trainer may be a watcher
  };
}
function upNext() { // the id of what comes next, and the step in words
  const { pressure, platen, trip, program, operator, you, barred } = state;
  if (trip) return ["reset", `Tripped: ${trip}. ${you.role === "operator" ? "Remove the cause, then Reset." : ""}`];
  if (you.role !== "operator") return operator ? ["", `You are watching: ${operator} has the controls.`] : ["take", "Nobody has the controls. Enter your name and Take control."];
  if (pressure === "off") return ["pressure-low", "Next: Low pressure opens the session with the plant."];
  if (pressure === "low") return ["pressure-high", "Next: High pressure, the controller takes over."];
  if (platen === "held") return ["raise", `The platen is held where it stopped. ${barred.raise ? `Before Raise: ${barred.raise}.` : "Next: Raise or Park."}`];
  if (platen === "parked" && barred.raise) return ["", `Before Raise: ${barred.raise}.`];
  if (platen === "parked") return ["raise", "Next: Raise the platen to its zero position."];
  if (platen === "moving") return ["", "The platen is moving, please wait."];
  if (waits()) return ["", `Checking ${waits()} against the capacity of the table. Run waits until it is loaded; Stop cancels.`];
  if (program.state === "running") return ["", `${program.name} is running. Hold pauses it, Stop ends it.`];
  if (program.state === "holding") return ["run", `${program.name} is held. Run goes on, Stop ends it.`];
  if (program.state === "stopping") return ["", "Returning to the setpoint."];
  if (source() === "generator" && still().length && still().length === checked("generator").length)
    return [`span-${still()[0]}`, `Next: set the span of ${still()[0]}, for instance ${hello.units[still()[0]] === "deg" ? "1 deg" : "100 mm"}; or choose a motion.`];
  const why = amiss();
  return ["run", why ? `Next: ${why}.` : `Ready: Run checks and starts the ${source() === "motion" ? "motion" : "function generator"}.`];
}
export function lock(why) { // all controls
  for (const control of document.querySelectorAll("header button, main button, main input, main select")) {
    if (control.closest("#scopes")) continue;
    control.disabled = true;
    control.title = why;
    control.classList.remove("next");
  }
}
export function refresh(found) { // with a state
  state = found;
  proceed();
  for (const [id, why] of Object.entries(reasons())) {
    const control = part(id), reason = control.dataset.never || why, title = reason || control.dataset.hint || "";
    if (control.disabled !== Boolean(reason)) control.disabled = Boolean(reason);
    if (control.title !== title) control.title = title;
  }
  const [next, step] = upNext();
  for (const marked of document.querySelectorAll("main .next")) if (marked.id !== next) marked.classList.remove("next");
  part(next)?.classList.add("next");
  return step;
}

// ------------------------------------------------------------------------------------------------ building
function boxes(group, axes, free, on) {
  part(`${group}-axes`).replaceChildren(...axes.map((axis) => {
    const box = make("input", { type: "checkbox", id: `${group}-${axis}`, value: axis, checked: on(axis) && free.includes(axis) });
    if (!free.includes(axis)) box.dataset.never = `${axis} is locked on this machine`;
    return make("label", {}, box, axis);
  }));
}
function chosen() {
  part("generator-box").classList.toggle("chosen", source() === "generator");
  part("motion-box").classList.toggle("chosen", source() === "motion");
  for (const field of document.querySelectorAll(".swept")) field.hidden = !swept();
  for (const field of document.querySelectorAll(".unswept")) field.hidden = swept();
  part("frequency-label").textContent = swept() ? "From [Hz]" : "Frequency [Hz]";
  part("motion-title").textContent = part("motion-title").title = hello?.motions.find(({ name }) => name === part("motion").value)?.title ?? "";
}
export function buildPrograms(found) {
  hello = found;
  part("wave").replaceChildren(...found.waves.map((wave) => new Option(wave)));
  part("motion").replaceChildren(...found.motions.map(({ name }) => new Option(name)));
  part("scope-axis").replaceChildren(...found.axes.map((axis) => new Option(axis)));
  part("scope-actuator").replaceChildren(...found.actuators.map((name) => new Option(name)));
  const first = found.axes_free[0];
  boxes("generator", found.axes, found.axes_free, (axis) => axis === first);
  boxes("motion", found.axes.filter((axis) => axis.length === 1), found.axes_free, () => true);
  chosen();
}
function escape(e) { // the emergency stop by key
  if (e.key !== "Escape" || e.repeat || !state || state.trip) return;
  e.preventDefault();
  loading = null;
  send({ do: "trip" });
}
export function connectControls(sender, complainer) {
  [send, complain] = [sender, complainer];
  const orders = { raise: { do: "raise" }, park: { do: "park" }, trip: { do: "trip" }, reset: { do: "reset" }, hold: { do: "hold" }, release: { do: "release" } };
  for (const to of ["off", "low", "high"]) orders[`pressure-${to}`] = { do: "pressure", to };
  for (const [id, order] of Object.entries(orders)) part(id).addEventListener("click", () => send(order));
  part("run").addEventListener("click", run);
  part("stop").addEventListener("click", () => { loading = null; send({ do: "stop" }); });
  part("take").addEventListener("click", () => { sendName(); send({ do: "take" }); });
  part("name").addEventListener("change", sendName);
  part("record").addEventListener("click", () => {
    const name = part("record-name").value.trim() || part("record-name").placeholder;
    send(state?.recording ? { do: "record", on: false } : { do: "record", on: true, name });
  });
  for (const group of ["generator", "motion"])
    part(`${group}-box`).addEventListener("change", (e) => {
      if (e.target.name !== "source") part(`source-${group}`).checked = true; // who sets a field wants its program
      chosen();
    });
  document.addEventListener("keydown", escape);
  part("view").addEventListener("load", () => { // a key pressed in the 3-D view counts too
    try { part("view").contentWindow.addEventListener("keydown", escape); } catch { /* a view from elsewhere keeps its keys */ }
  });
}
export function sendName() {
  const name = part("name").value.trim();
  try { localStorage.setItem("panel-name", name); } catch { /* a browser that keeps nothing */ }
  if (name) send({ do: "name", name });
}
export function showRecording({ recording, recordings, writing }) {
  part("recording").className = recording ? "note on" : "note";
  const files = `${recordings.length} file${recordings.length === 1 ? "" : "s"}`;
  write(part("recording"), recording ? `● ${recording.name}, ${recording.seconds.toFixed(1)} s` : files);
  write(part("record"), recording ? "Stop recording" : "Record");
  let k = 1; // the first free name is proposed
  while (writing.includes(`test-${k}`) || recordings.some((path) => path.split("/").includes(`test-${k}`) || path.includes(`test-${k}.`))) k++;
  part("record-name").placeholder = `test-${k}`;
  if (recording) show(part("record-name"), "");
}
