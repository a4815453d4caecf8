// The page's own part: meshcat's commands into its viewer, and a bar that drives meshcat's animation.
const part = (id) => document.getElementById(id);
let viewer = null;
try {
  viewer = new MeshCat.Viewer(part("meshcat-pane"));
} catch (why) {
  part("undrawn").hidden = false;
  throw why;
}
for (const packed of JSON.parse(part("commands").textContent))
  viewer.handle_command_bytearray(Uint8Array.from(atob(packed), (c) => c.charCodeAt(0)));
const { start, step, live, bare } = JSON.parse(part("settings").textContent);
document.body.classList.toggle("bare", bare);
const animator = viewer.animator;
const shown = (seconds) => seconds.toFixed(2);
const FITS = 1.5; // width over height in which the camera sees the whole table
let known = 0, camera = null, field = 0;

const SMOOTH = 1000 / 33; // [ms] that a frame may take: thirty a second, and some to spare
const JUDGED = 15, COARSEST = 0.4; // frames judged together; least share of the screen's pixels, along each side
const STILL = 300; // [ms] without a command from a server: its table is at rest
let share = 1, drawn = 1, frames = 0, since = 0, told = -Infinity;

function fit() { // a narrower window sees as much in width
  if (viewer.camera !== camera) { camera = viewer.camera; field = Math.tan((camera.fov * Math.PI) / 360); }
  const short = Math.max(1, (FITS * window.innerHeight) / window.innerWidth);
  camera.fov = (360 / Math.PI) * Math.atan(field * short);
  camera.updateProjectionMatrix();
  viewer.set_dirty();
}

function adopt() { // an animation that has come: at once from a file, by and by from a server
  known = animator.duration;
  part("bar").hidden = part("keys").hidden = known === 0;
  part("time").max = known;
  animator.mixer.timeScale = Number(part("speed").value);
  repeat();
  show_histories();
}
function repeat() {
  for (const action of animator.actions) action.repetitions = part("loop").checked ? Infinity : 1;
}
function resolve(wanted) {
  if (wanted === drawn) return;
  drawn = wanted;
  viewer.renderer.setPixelRatio(drawn * window.devicePixelRatio);
  viewer.set_dirty();
}
function keep_pace(now) { // a computer too slow for every pixel draws fewer while the table moves, all of them at rest
  if (!(animator.playing || now - told < STILL) || document.hidden) { frames = 0; resolve(1); return; }
  resolve(share);
  if (frames === 0) since = now;
  if (frames++ < JUDGED) return;
  const taken = (now - since) / JUDGED;
  if (taken > 1.1 * SMOOTH || taken < 0.6 * SMOOTH)
    share = Math.min(1, Math.max(COARSEST, share * Math.min(1.2, Math.sqrt(SMOOTH / taken))));
  frames = 0;
}
function draw(now) {
  keep_pace(now);
  if (viewer.camera !== camera) fit();
  if (animator.duration !== known) adopt();
  if (document.activeElement !== part("time") || animator.playing) part("time").value = animator.time;
  mark();
  part("clock").textContent = `${shown(start + animator.time)} / ${shown(start + known)} s`;
  part("play").textContent = animator.playing ? "❚❚" : "▶";
  part("play").setAttribute("aria-label", animator.playing ? "Pause" : "Play");
  requestAnimationFrame(draw);
}
function toggle() { if (animator.playing) animator.pause(); else animator.play(); }
function seek(time) {
  const there = Math.min(Math.max(time, 0), known);
  animator.seek(there);
  animator.display_progress(there);
}
window.addEventListener("resize", fit);
part("play").addEventListener("click", toggle);
part("time").addEventListener("input", (e) => { animator.pause(); seek(Number(e.target.value)); });
part("speed").addEventListener("change", (e) => { animator.mixer.timeScale = Number(e.target.value); });
part("loop").addEventListener("change", repeat);
part("bar").addEventListener("submit", (e) => e.preventDefault());
for (const box of document.querySelectorAll("#layers input"))
  box.addEventListener("change", () => {
    for (const path of JSON.parse(box.dataset.paths)) viewer.set_property(path.split("/"), "visible", box.checked);
    viewer.set_dirty();
  });
document.addEventListener("keydown", (e) => {
  if (known === 0 || ["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(e.target.tagName)) return;
  const way = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
  if (e.key === " ") { toggle(); e.preventDefault(); }
  if (way) { animator.pause(); seek(animator.time + way * (e.shiftKey ? 1 : step)); e.preventDefault(); }
  if (e.key === "Home") seek(0);
});
function measure(meters) { // bars from the middle, to either end at the capacity
  for (const [name, share] of Object.entries(meters)) {
    const id = `meter-${name}`;
    if (!part(id)) part("meters").insertAdjacentHTML("beforeend", `<span id="${id}">${name} <b><i></i></b><small></small></span>`);
    const bar = part(id).querySelector("i"), width = 50 * Math.min(Math.abs(share), 1);
    bar.style.width = `${width}%`;
    bar.style.left = `${share < 0 ? 50 - width : 50}%`;
    bar.className = Math.abs(share) >= 1 ? "over" : Math.abs(share) >= 0.8 ? "near" : "";
    part(id).querySelector("small").textContent = `${(100 * share).toFixed(0)} %`;
  }
}
if (live) { // what is sent: meshcat's commands, words on how it goes, and demand over capacity
  const socket = new WebSocket(new URL("commands", location.href).href.replace(/^http/, "ws"));
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => {
    if (typeof data !== "string") {
      told = performance.now();
      viewer.handle_command_bytearray(new Uint8Array(data));
      return;
    }
    const { status, meters } = JSON.parse(data);
    part("status").textContent = status;
    part("live").hidden = false;
    measure(meters);
  };
  part("pause").addEventListener("click", () => {
    const pausing = part("pause").textContent === "Pause";
    socket.send(pausing ? "pause" : "play");
    part("pause").textContent = pausing ? "Play" : "Pause";
  });
  socket.onclose = () => { part("status").textContent += " (ended)"; };
}
requestAnimationFrame(draw);
