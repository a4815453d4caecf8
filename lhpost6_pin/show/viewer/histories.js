// Time histories under the scene: a line moves with the animation, a press on a plot moves the animation, and a press
// on an actuator or strut shows its force.
const decoded = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const plots = JSON.parse(part("histories").textContent).map(({ title, one, curves }) => {
  const figure = part("strip").appendChild(document.createElement("figure"));
  const caption = figure.appendChild(document.createElement("figcaption"));
  const field = figure.appendChild(document.createElement("div"));
  const plot = { one, curves, chosen: curves[0].name, canvas: field.appendChild(document.createElement("canvas")), field };
  plot.line = field.appendChild(document.createElement("i"));
  for (const curve of curves) [curve.x, curve.y] = [decoded(curve.x), decoded(curve.y)];
  caption.append(title + " ");
  if (one) {
    plot.choice = caption.appendChild(document.createElement("select"));
    plot.choice.setAttribute("aria-label", "Actuator or strut");
    for (const { name } of curves) plot.choice.add(new Option(name));
    plot.choice.addEventListener("change", () => choose(plot.choice.value));
  } else
    for (const { name, color } of curves) {
      const key = caption.appendChild(document.createElement("span"));
      key.textContent = name + " ";
      key.style.color = color;
    }
  const here = (e) => {
    const box = field.getBoundingClientRect();
    animator.pause();
    seek(((e.clientX - box.left) / box.width) * known);
  };
  field.addEventListener("pointerdown", (e) => { field.setPointerCapture(e.pointerId); here(e); });
  field.addEventListener("pointermove", (e) => { if (e.buttons) here(e); });
  return plot;
});
const forces = plots.find((plot) => plot.one);

function choose(name) { // the leg whose force is drawn
  if (!forces || !forces.curves.some((curve) => curve.name === name)) return;
  forces.chosen = forces.choice.value = name;
  sketch(forces);
}
const LEAST = 1e-9; // in the unit of a title: below it is rounding of a platen at rest
const label = (value) => (Math.abs(value) > LEAST ? value : 0).toPrecision(3);
function sketch({ canvas, field, curves, one, chosen }) {
  const sharp = window.devicePixelRatio, width = field.clientWidth, height = field.clientHeight;
  [canvas.width, canvas.height] = [width * sharp, height * sharp];
  const pen = canvas.getContext("2d"), drawn = curves.filter(({ name }) => !one || name === chosen);
  let low = Infinity, high = -Infinity;
  for (const { y } of drawn) for (const value of y) { low = Math.min(low, value); high = Math.max(high, value); }
  const span = high - low > LEAST ? high - low : 1;
  const across = (x) => (x / known) * width, up = (y) => height - 3 - ((y - low) / span) * (height - 6);
  pen.scale(sharp, sharp);
  pen.lineWidth = 1;
  for (const { x, y, color } of drawn) {
    pen.strokeStyle = color;
    pen.beginPath();
    x.forEach((time, k) => pen.lineTo(across(time), up(y[k])));
    pen.stroke();
  }
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = "#57606a";
  pen.fillText(label(high), 2, 11);
  pen.fillText(label(low), 2, height - 3);
}
function show_histories() { // once the animation is known, and when the window changes
  part("strip").hidden = known === 0 || plots.length === 0;
  if (!part("strip").hidden) plots.forEach(sketch);
}
function mark() {
  for (const { line } of plots) line.style.left = `${(100 * animator.time) / Math.max(known, 1e-9)}%`;
}
window.addEventListener("resize", show_histories);

let pressed = null; // where the pointer went down: turning the scene is no choice
part("meshcat-pane").addEventListener("pointerdown", (e) => { pressed = [e.clientX, e.clientY]; });
part("meshcat-pane").addEventListener("pointerup", (e) => {
  if (!pressed || Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) > 4) return;
  const at = { x: (2 * e.clientX) / window.innerWidth - 1, y: 1 - (2 * e.clientY) / window.innerHeight };
  const ray = new MeshCat.THREE.Raycaster();
  ray.setFromCamera(at, viewer.camera);
  for (const { object } of ray.intersectObjects(viewer.scene.children, true))
    for (let above = object; above; above = above.parent) {
      const leg = (above.name || "").replace(/_(rod|barrel)$/, "");
      if (forces && forces.curves.some((curve) => curve.name === leg)) { choose(leg); return; }
    }
});
