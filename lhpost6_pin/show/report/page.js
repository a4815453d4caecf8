"use strict";
// Draws each figure when it scrolls into view; keeps all time axes on the same window; keys move and zoom a focused figure.
(function () {
  const PRINT_WIDTH = 850; // CSS px of an A4 or Letter page between its margins, at the print zoom of page.css
  const NARROW = 720; // CSS px below which legends always stand under the row titles instead of beside them
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const plots = Array.from(document.querySelectorAll(".plot"));
  const visible = new Set();
  let timeWindow = null; // [start, end] in seconds, or null for all
  let ready = false;

  async function loadLibrary() {
    const packed = new Blob([bytes(document.getElementById("library").textContent)]);
    const code = await new Response(packed.stream().pipeThrough(new DecompressionStream("deflate"))).text();
    const script = document.createElement("script");
    script.textContent = code;
    document.head.appendChild(script);
  }

  // A time axis comes as start, step and the number of samples from one kept point to the next.
  function times(x) {
    const kinds = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };
    const steps = new kinds[x.dtype](bytes(x.bdata).buffer);
    let sample = 0;
    return Float64Array.from(steps, (s) => x.start + x.step * (sample += s));
  }

  const linked = (plot) => plot.layout.meta && plot.layout.meta.linked;

  function applyWindow(plot) {
    if (!plot.drawn || plot.shown === timeWindow || !linked(plot)) return;
    plot.shown = timeWindow;
    const change = timeWindow ? { "xaxis.range": timeWindow.slice() } : { "xaxis.autorange": true };
    return Plotly.relayout(plot, change);
  }

  function setWindow(range) {
    timeWindow = range;
    for (const plot of visible) applyWindow(plot);
  }

  const column = (names) => 52 + 6.5 * Math.max(...names); // CSS px: plotly's columns are as wide as the longest name

  // Lengths of the names in each row's legend.
  function legendNames(traces) {
    const entries = {};
    for (const t of traces) if (t.showlegend !== false) (entries[t.legend || "legend"] ||= []).push(t.name.length);
    return entries;
  }

  const titlesOf = (layout) => layout.annotations.filter((a) => a.name === "title");

  // Whether a row's title and its legend would overlap side by side.
  function crowded(width, layout, traces) {
    const entries = legendNames(traces);
    return titlesOf(layout).some((title, k) => {
      const names = entries[`legend${k ? k + 1 : ""}`] || [];
      return names.length && 7.2 * title.text.length + names.length * column(names) > width - 75;
    });
  }

  // Make room above each row for its title and, below that, its legend.
  function stackTitles(width, layout, traces) {
    const lines = Math.max(0, ...Object.values(legendNames(traces)).map((names) =>
      Math.ceil(names.length / Math.max(1, Math.floor((width - 75) / column(names))))));
    const titles = titlesOf(layout);
    const { row } = layout.meta, above = 22 + 19 * lines, bottom = layout.margin.b;
    const inner = titles.length * row + (titles.length - 1) * (above + 12);
    layout.height = inner + above + bottom;
    layout.margin.t = above;
    titles.forEach((title, k) => {
      const n = k ? k + 1 : "", top = 1 - k * (row + above + 12) / inner;
      layout[`yaxis${n}`].domain = [Math.max(top - row / inner, 0), top];
      Object.assign(title, { y: top, yshift: 19 * lines + 2 });
      Object.assign(layout[`legend${n}`], { x: 0, xanchor: "left", y: top, yanchor: "bottom" });
    });
  }

  function draw(plot, width) {
    if (plot.drawn || !ready) return;
    plot.drawn = true;
    const { traces, layout } = JSON.parse(document.querySelector(`script[data-for="${plot.id}"]`).textContent);
    const coarse = matchMedia("(pointer: coarse)").matches;
    for (const trace of traces) {
      if (trace.x && trace.x.step !== undefined) trace.x = times(trace.x);
    }
    const axis = { gridcolor: "#e6eaee", linecolor: "#8c959f", zerolinecolor: "#c9d0d7", ticks: "outside", tickcolor: "#8c959f",
      ticklen: 4, automargin: true, hoverformat: ".4~g" };
    for (const key of Object.keys(layout)) {
      if (/^[xy]axis\d*$/.test(key)) layout[key] = { ...axis, ...layout[key] };
    }
    const base = { font: { family: "system-ui, -apple-system, Segoe UI, Roboto, Liberation Sans, sans-serif", size: 12, color: "#1b1f24" },
      paper_bgcolor: "#fff", plot_bgcolor: "#fff", hovermode: "x unified", hoverlabel: { namelength: -1 }, autosize: true,
      dragmode: coarse ? false : "zoom" };
    if (width) base.width = width;
    const room = width || plot.clientWidth;
    const buttons = !plot.closest(".grid");
    if (buttons) { layout.margin.b += 22; layout.height += 22; } // they stand below the axis title
    if (room < NARROW || crowded(room, layout, traces)) stackTitles(room, layout, traces);
    plot.style.height = `${layout.height}px`;
    Plotly.newPlot(plot, traces, { ...base, ...layout }, {
      responsive: true, displaylogo: false, doubleClick: "reset+autosize",
      displayModeBar: buttons && (coarse || "hover"),
      modeBarButtons: [plot.clientWidth < NARROW ? ["zoom2d", "pan2d", "resetScale2d"]
        : ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
      toImageButtonOptions: { filename: plot.id, scale: 2 },
    });
    plot.shown = null;
    applyWindow(plot);
    plot.on("plotly_relayout", (change) => {
      if (!linked(plot)) return;
      const key = Object.keys(change).find((k) => /^xaxis\d*\.(range|autorange)/.test(k));
      if (!key) return;
      const range = plot.layout.xaxis.range;
      const window = key.endsWith("autorange") ? null : [range[0], range[1]];
      const same = window === timeWindow || (window && timeWindow && window[0] === timeWindow[0] && window[1] === timeWindow[1]);
      if (!same) { timeWindow = plot.shown = window; setWindow(window); }
    });
  }

  function erase(plot) {
    if (plot.drawn) Plotly.purge(plot);
    plot.drawn = false;
  }

  function onKey(event) {
    const plot = event.currentTarget;
    const moves = { ArrowLeft: [-0.2, 1], ArrowRight: [0.2, 1], "+": [0, 0.6], "=": [0, 0.6], "-": [0, 1 / 0.6] };
    if (!plot.drawn || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "0") { Plotly.relayout(plot, { "xaxis.autorange": true }); event.preventDefault(); return; }
    const move = moves[event.key];
    if (!move) return;
    const [start, end] = plot.layout.xaxis.range;
    const span = end - start, middle = (start + end) / 2 + move[0] * span;
    Plotly.relayout(plot, { "xaxis.range": [middle - span * move[1] / 2, middle + span * move[1] / 2] });
    event.preventDefault();
  }

  function watch() {
    const near = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        if (!isIntersecting) { visible.delete(target); continue; }
        visible.add(target);
        draw(target);
        applyWindow(target);
      }
    }, { rootMargin: "400px 0px" });
    for (const plot of plots) {
      near.observe(plot);
      plot.addEventListener("keydown", onKey);
    }
  }

  function markSection() {
    const links = new Map(Array.from(document.querySelectorAll("nav a"), (a) => [a.hash.slice(1), a]));
    const seen = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        if (!isIntersecting) continue;
        links.forEach((a) => a.removeAttribute("aria-current"));
        links.get(target.id).setAttribute("aria-current", "true");
      }
    }, { rootMargin: "-15% 0px -80% 0px" });
    document.querySelectorAll("section[id]").forEach((s) => seen.observe(s));
  }

  function printing() {
    let folded = [];
    addEventListener("beforeprint", () => {
      folded = Array.from(document.querySelectorAll("details:not([open])"));
      folded.forEach((d) => { d.open = true; });
      if (!ready) return;
      for (const plot of plots) {
        const width = plot.closest(".grid") ? PRINT_WIDTH / 2 - 10 : PRINT_WIDTH;
        erase(plot);
        draw(plot, width);
      }
    });
    addEventListener("afterprint", () => {
      plots.forEach(erase);
      folded.forEach((d) => { d.open = false; });
      visible.forEach((plot) => draw(plot));
    });
  }

  markSection();
  printing();
  loadLibrary().then(() => { ready = true; watch(); }, () => {
    const notice = document.getElementById("no-plots");
    notice.textContent = "The plots need a browser of 2023 or later; the numbers are also in tables.";
    notice.hidden = false;
  });
})();
