"use strict";
// Draws each state that the server sends. All text goes in as text, never as HTML.
(() => {
  const $ = (id) => document.getElementById(id);
  const NS = "http://www.w3.org/2000/svg";
  let state = null, came = 0, connected = false, updates = 0;

  const fill = (list, items, make) => list.replaceChildren(...items.map(make));
  const element = (tag, text, cls) => {
    const e = document.createElement(tag);
    if (text !== undefined) e.textContent = text;
    if (cls) e.className = cls;
    return e;
  };
  const drawn = (tag, attributes, text) => {
    const e = document.createElementNS(NS, tag);
    for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v);
    if (text !== undefined) e.textContent = text;
    return e;
  };

  // Marks at 1, 2 and 5 times a power of ten.
  function ticks(low, high, wanted) {
    const raw = (high - low) / wanted, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find((m) => m * power >= raw);
    const out = [];
    for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12); k++) out.push(k * step);
    return [out, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
  }
  // Marks of angles on a logarithmic axis, in arcmin: round in arcmin, and from 1 deg on in degrees.
  function angles(low, high) {
    const one = [0.01, 0.1, 1, 10].flatMap((p) => [p, 2 * p, 5 * p]).filter((v) => v < 50);
    const all = [...one, ...[1, 2, 5, 10, 20, 50, 100].map((v) => 60 * v)];
    const out = all.filter((v) => v >= low && v <= high);
    return out.length > 7 ? out.filter((v) => [0.01, 0.1, 1, 10, 60, 600].includes(v)) : out;
  }
  const seconds = (t) => (t >= 600 ? `${+(t / 60).toFixed(1)} min` : `${+t.toFixed(1)} s`);

  // The frame of a chart: what maps a point into it, and its grid with labels.
  function frame(svg, t0, t1, y0, y1, marks, label, map) {
    const width = svg.clientWidth || 340, height = svg.clientHeight || 240;
    const left = 14 + 8 * Math.max(...marks.map((v) => label(v).length), 1), top = 10, bottom = 26;
    const span = Math.max(t1 - t0, 1e-9);
    const x = (t) => left + ((t - t0) / span) * (width - left - 12);
    const y = (v) => top + (1 - (map(v) - map(y0)) / (map(y1) - map(y0))) * (height - top - bottom);
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.replaceChildren();
    for (const v of marks) {
      svg.append(drawn("line", { class: "grid", x1: left, x2: width - 12, y1: y(v), y2: y(v) }));
      svg.append(drawn("text", { x: left - 6, y: y(v) + 5, "text-anchor": "end" }, label(v)));
    }
    for (const t of ticks(t0, t1, width < 500 ? 3 : 6)[0])
      svg.append(drawn("text", { x: Math.min(x(t), width - 24), y: height - 6, "text-anchor": "middle" }, seconds(t)));
    const clip = drawn("clipPath", { id: `${svg.id}-clip` });
    clip.append(drawn("rect", { x: left, y: top, width: width - left - 12, height: height - top - bottom }));
    svg.append(clip);
    const inside = drawn("g", { "clip-path": `url(#${svg.id}-clip)` });
    svg.append(inside);
    return [x, y, inside];
  }
  const path = (points) => "M" + points.map(([a, b]) => `${a.toFixed(1)},${b.toFixed(1)}`).join("L");

  function draw() {
    const points = state.points.filter((p) => p[1] !== null && p[2] !== null);
    if (points.length < 2) return;
    const last = points[points.length - 1], t0 = points[0][0], t1 = last[0];
    // Headings about the last one, so that north is no jump.
    const about = points.filter((p) => p[2] < 600 || p === last).map((p) => [p[0], ((p[1] - last[1] + 540) % 360) - 180, p[2] / 60]);
    const late = about.slice(Math.floor(about.length / 2));
    const reach = 1.3 * Math.min(180, Math.max(3 * last[2] / 60, ...late.map((p) => Math.abs(p[1]) + p[2])));
    const [marks, digits] = ticks(last[1] - reach, last[1] + reach, 5);
    let [x, y, inside] = frame($("convergence"), about[0][0], t1, last[1] - reach, last[1] + reach, marks,
      (v) => `${(((v % 360) + 360) % 360).toFixed(digits)}°`, (v) => v);
    const high = about.map((p) => [x(p[0]), y(last[1] + p[1] + p[2])]);
    const low = about.map((p) => [x(p[0]), y(last[1] + p[1] - p[2])]);
    inside.append(drawn("path", { class: "band", d: path([...high, ...low.reverse()]) + "Z" }));
    inside.append(drawn("path", { class: "line", d: path(about.map((p) => [x(p[0]), y(last[1] + p[1])])) }));
    $("convergence").append(drawn("circle", { class: "dot", cx: x(t1), cy: y(last[1]), r: 5 }));
    $("convergence").setAttribute("aria-label",
      `Heading against time used, now ${state.heading.value} ${state.heading.sigma}`);

    const bounds = points.filter((p) => p[3] !== null);
    const all = [...points.map((p) => p[2]), ...bounds.map((p) => p[3])].filter((v) => v > 0);
    const least = Math.min(...all) / 1.4, most = Math.max(...all) * 1.4;
    const angle = (v) => (v >= 60 ? `${+(v / 60).toPrecision(2)}°` : `${+v.toPrecision(2)}′`);
    [x, y, inside] = frame($("bound"), t0, t1, least, most, angles(least, most), angle, Math.log10);
    if (bounds.length > 1)
      inside.append(drawn("path", { class: "other", d: path(bounds.map((p) => [x(p[0]), y(p[3])])) }));
    inside.append(drawn("path", { class: "line", d: path(points.map((p) => [x(p[0]), y(p[2])])) }));
    $("bound").setAttribute("aria-label",
      `Sigma of the heading against time used, now ${angle(last[2])}` +
      (last[3] === null ? "; give a specification for its lower bound" : `, its lower bound ${angle(last[3])}`));
    $("legend2").children[1].hidden = bounds.length < 2;
  }

  // What is under way, and whether what is shown is old: the sender may be silent, or the server gone.
  function status() {
    const old = (performance.now() - came) / 1000;
    const over = state !== null && state.end !== "";
    const silent = state === null || state.silent === null ? 0 : state.silent + old;
    let text = "Aligning.", stale = false;
    if (over) text = state.end;
    else if (!connected) [text, stale] = ["The connection is lost: what is shown is old. Trying again.", true];
    else if (silent > Math.max(3, 3 * state.every)) [text, stale] = [`No sample for ${Math.round(silent)} s.`, true];
    else if (old > Math.max(5, 5 * state.every)) [text, stale] = [`No news for ${Math.round(old)} s.`, true];
    else if (state.phase === "waiting") text = state.why ? `No heading yet: ${state.why}` : "Waiting for enough samples.";
    if (state !== null && state.spans > 1) text += ` Span ${state.span} of ${state.spans}.`;
    const bad = stale || (over && state.phase === "failed");
    if ($("status").textContent !== text) $("status").textContent = text;
    $("status").className = bad ? "stale" : over ? "ended" : "";
  }

  function show() {
    $("source").textContent = `· ${state.source}`;
    const told = state.contradictions.join("\n");
    // A screen reader says an alert again when its content is replaced: only when it changed.
    if ($("contradictions").dataset.told !== told) {
      $("contradictions").dataset.told = told;
      fill($("contradictions").querySelector("ul"), state.contradictions, (text) => element("li", text));
    }
    $("contradictions").hidden = state.contradictions.length === 0;
    fill($("warnings"), state.warnings, (text) => element("li", text));
    $("warnings").hidden = state.warnings.length === 0;
    $("value").textContent = state.heading ? state.heading.value : "–";
    $("sigma").textContent = state.heading ? state.heading.sigma : "";
    fill($("facts"), state.facts, ([value, what]) => {
      const item = element("li");
      item.append(element("b", value), element("span", what));
      return item;
    });
    const counted = ([n, what]) => {
      const row = element("tr"), head = element("th", what);
      head.scope = "row";
      row.append(element("td", n.toLocaleString("en")), head);
      return row;
    };
    fill($("counts").tBodies[0], state.counts, counted);
    fill($("fixes").querySelector("tbody"), state.fixes, counted);
    $("fixes").hidden = state.fixes.length === 0;
    fill($("notes").querySelector("ul"), state.notes, (text) => element("li", text));
    $("notes").hidden = state.notes.length === 0;
    document.title = (state.contradictions.length ? "INCONSISTENT " : "") +
      (state.heading ? `${state.heading.value} ${state.heading.sigma} · ` : "") + "schuler live";
    draw();
    status();
  }

  // The key, where there is one, is in the page's own address.
  const events = new EventSource(`/events${location.search}`);
  events.addEventListener("open", () => { connected = true; came = performance.now(); });
  events.addEventListener("state", (event) => {
    state = JSON.parse(event.data);
    came = performance.now();
    connected = true;
    document.documentElement.dataset.updates = String(++updates);
    document.documentElement.dataset.phase = state.phase;
    if (state.end) events.close();
    show();
  });
  events.addEventListener("error", () => { connected = false; status(); });
  setInterval(status, 1000);
  addEventListener("resize", () => { if (state !== null) draw(); });
})();
