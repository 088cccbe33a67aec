"use strict";
(function () {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  // Paper is white whatever the screen is.
  const paper = { ink: "#000", line: "#bbb" };
  function look() {
    const css = getComputedStyle(document.documentElement);
    const v = (name) => css.getPropertyValue(name).trim();
    return { ink: v("--ink"), line: v("--line") };
  }
  function dress(layout, seen) {
    const { ink, line } = seen || look();
    const out = Object.assign({}, layout, {
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: Object.assign({}, layout.font, { color: ink }),
    });
    for (const key of Object.keys(out)) {
      if (/^[xy]axis/.test(key)) {
        out[key] = Object.assign({}, out[key], { gridcolor: line, zerolinecolor: line, linecolor: line });
      }
    }
    return out;
  }
  // A band that is faint on white is none on black.
  function lit(data) {
    if (!dark.matches) return data;
    return data.map((trace) => {
      const found = /^rgba\((\d+, ?\d+, ?\d+), ?([\d.]+)\)$/.exec(trace.fillcolor || "");
      if (!found) return trace;
      const alpha = Math.min(1, 2.2 * Number(found[2]));
      return Object.assign({}, trace, { fillcolor: "rgba(" + found[1] + "," + alpha + ")" });
    });
  }
  // Text as wide as it will be drawn: Plotly's fonts, a title a fifth larger than the marks.
  const FAMILY = '"Open Sans", verdana, arial, sans-serif';
  const pen = document.createElement("canvas").getContext("2d");
  function wide(text, size) {
    pen.font = size + "px " + FAMILY;
    return Math.max(...text.split("<br>").map((line) => pen.measureText(line).width));
  }
  function brokenInLines(text, size, most) {
    let lines = [""];
    for (const word of text.split(" ")) {
      const longer = (lines[lines.length - 1] + " " + word).trim();
      if (lines[lines.length - 1] && wide(longer, size) > most) lines.push(word);
      else lines[lines.length - 1] = longer;
    }
    return lines.join("<br>");
  }
  const rows = (text) => text.split("<br>").length;
  function words(data, letter) {
    const found = new Set();
    data.forEach((trace) => {
      if (Array.isArray(trace[letter])) {
        trace[letter].forEach((v) => typeof v === "string" && found.add(v));
      }
    });
    return Array.from(found);
  }
  const SIDE = 0.42; // of the figure's width, for the names at its left
  // Break names and titles into lines where the figure is too narrow for them; widen its margins for them.
  function fit(layout, data, width) {
    const size = (layout.font && layout.font.size) || 12, large = Math.round(1.2 * size);
    const x = Object.assign({}, layout.xaxis), y = Object.assign({}, layout.yaxis);
    const margin = Object.assign({}, layout.margin);
    let height = layout.height, left = margin.l;
    const names = words(data, "y"), small = (y.tickfont && y.tickfont.size) || size;
    if (names.length) {
      const widest = SIDE * width;
      const broken = names.map((name) => brokenInLines(name, small, widest));
      const most = Math.max(...broken.map(rows));
      if (most > 1) {
        Object.assign(y, { tickmode: "array", tickvals: names, ticktext: broken });
        height = Math.max(height, margin.t + margin.b + names.length * (1.3 * small * most + 6));
      }
      left = Math.max(left, Math.max(...broken.map((name) => wide(name, small))) + 12);
    }
    const inner = Math.max(60, width - left - margin.r), across = words(data, "x");
    if (across.length) {
      const font = (x.tickfont && x.tickfont.size) || size;
      const upright = x.tickangle === -90;
      const need = upright ? 1.4 * font : Math.max(...across.map((name) => wide(name, font))) + 8;
      const step = Math.ceil((need * across.length) / inner);
      if (upright && step > 1) x.dtick = step;
    }
    // A title is centred on its axis: it may be twice as long as from there to the nearer edge.
    function title(axis, longest) {
      const text = axis.title && axis.title.text;
      if (!text || wide(text, large) <= longest) return 0;
      axis.title = Object.assign({}, axis.title, { text: brokenInLines(text, large, longest) });
      return rows(axis.title.text) - 1;
    }
    const more = title(x, 2 * Math.min(left + inner / 2, width - left - inner / 2) - 8);
    margin.b += 1.3 * large * more;
    height += 1.3 * large * more;
    // The names of many lines stand in rows above the figure, which is to stay as tall as it is.
    const shown = data.filter((trace) => trace.name && trace.showlegend !== false);
    const item = shown.length ? Math.max(...shown.map((t) => wide(t.name, size))) + 45 : 0;
    if (layout.showlegend !== false && shown.length > 1 && item * shown.length > inner) {
      const columns = Math.max(1, Math.floor(inner / item));
      height += 1.5 * size * (Math.ceil(shown.length / columns) - 1);
    }
    title(y, layout.height - layout.margin.t - layout.margin.b);
    return Object.assign({}, layout, { xaxis: x, yaxis: y, margin, height });
  }
  // Plotly follows the width of the page by itself; the lines of names and titles do not.
  const config = { responsive: true, displayModeBar: false };
  const figures = [];
  function laid(target, figure, seen) {
    return fit(dress(figure.layout, seen), figure.data, target.clientWidth);
  }
  // Marks that are said are too few within a part of a decade.
  function zoomed(target, event) {
    for (const name of ["xaxis", "yaxis"]) {
      const axis = target.layout[name];
      if (!axis || axis.type !== "log" || !axis.tickvals) continue;
      if (event[name + ".range[0]"] !== undefined && axis.tickmode === "array") {
        Plotly.relayout(target, { [name + ".tickmode"]: "auto" });
      } else if (event[name + ".autorange"] && axis.tickmode === "auto") {
        Plotly.relayout(target, { [name + ".tickmode"]: "array" });
      }
    }
  }
  document.querySelectorAll('script[type="application/json"]').forEach((source) => {
    const target = document.getElementById(source.dataset.for);
    const figure = JSON.parse(source.textContent);
    figures.push([target, figure]);
    Plotly.newPlot(target, lit(figure.data), laid(target, figure), config);
    target.on("plotly_relayout", (event) => zoomed(target, event));
  });
  // Save a figure as a picture, or what it draws as a table.
  function offer(name, content, type) {
    const link = document.createElement("a");
    link.href = content instanceof Blob ? URL.createObjectURL(content) : content;
    link.download = name + "." + type;
    link.click();
    if (content instanceof Blob) setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
  const kinds = {
    f8: Float64Array, f4: Float32Array, i1: Int8Array, i2: Int16Array, i4: Int32Array,
    u1: Uint8Array, u2: Uint16Array, u4: Uint32Array,
  };
  // Long arrays travel as base64 of their bytes, matrices with their shape.
  function values(v) {
    if (!v || v.bdata === undefined) return Array.from(v);
    const bytes = Uint8Array.from(atob(v.bdata), (c) => c.charCodeAt(0));
    const flat = Array.from(new kinds[v.dtype](bytes.buffer));
    const shape = String(v.shape || flat.length).split(",").map(Number);
    if (shape.length < 2) return flat;
    return Array.from({ length: shape[0] }, (_, i) => flat.slice(i * shape[1], (i + 1) * shape[1]));
  }
  function cell(value) {
    if (typeof value === "number") return String(Number(value.toPrecision(10)));
    const text = value === null || value === undefined ? "" : String(value);
    return /[",\n\r]/.test(text) ? '"' + text.replace(/"/g, '""') + '"' : text;
  }
  function table(figure) {
    const title = (axis) => {
      const found = figure.layout[axis + "axis"];
      return (found && found.title && found.title.text) || axis;
    };
    const rows = [["trace", title("x"), title("y"), "value"]];
    figure.data.forEach((trace, k) => {
      const name = trace.name || "trace " + (k + 1);
      const x = values(trace.x), y = values(trace.y);
      if (trace.type === "heatmap") {
        const z = values(trace.z);
        y.forEach((b, i) => x.forEach((a, j) => rows.push([name, a, b, z[i][j]])));
      } else {
        x.forEach((a, i) => rows.push([name, a, y[i], ""]));
      }
    });
    return rows.map((row) => row.map(cell).join(",")).join("\n") + "\n";
  }
  const WIDTH = 1000, PAPER = 680;
  function picture(figure, type) {
    // Paper is white: a saved figure is read outside of this page.
    const layout = fit(dress(figure.layout, paper), figure.data, WIDTH);
    layout.paper_bgcolor = "#fff";
    const size = { format: type, width: WIDTH, height: layout.height, scale: 2 };
    return Plotly.toImage({ data: figure.data, layout: layout }, size);
  }
  figures.forEach(([target, figure]) => {
    const holder = target.closest("figure");
    const name = holder.dataset.name.toLowerCase().replace(/[^a-z0-9]+/g, "-")
      .replace(/^-|-$/g, "") || "figure";
    const row = document.createElement("p");
    row.className = "save";
    row.append("Save ");
    [["SVG", () => picture(figure, "svg").then((url) => offer(name, url, "svg"))],
      ["PNG", () => picture(figure, "png").then((url) => offer(name, url, "png"))],
      ["CSV", () => offer(name, new Blob([table(figure)], { type: "text/csv" }), "csv")],
    ].forEach(([label, act]) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = label;
      button.setAttribute("aria-label", "Save the figure " + name + " as " + label);
      button.addEventListener("click", act);
      row.append(button);
    });
    holder.append(row);
  });
  // For tests: what the buttons would save.
  window.schulerFigures = { table, picture, figures };
  function redraw() {
    figures.forEach(([target, figure]) => {
      const layout = Object.assign(laid(target, figure), { width: null, autosize: true });
      Plotly.react(target, lit(figure.data), layout, config);
    });
  }
  dark.addEventListener("change", redraw);
  let seen = window.innerWidth, waiting = 0;
  window.addEventListener("resize", () => {
    if (window.innerWidth === seen) return;
    seen = window.innerWidth;
    clearTimeout(waiting);
    waiting = setTimeout(redraw, 200);
  });
  window.addEventListener("beforeprint", () => {
    figures.forEach(([target, figure]) => {
      const layout = fit(dress(figure.layout, paper), figure.data, PAPER);
      Plotly.react(target, figure.data, Object.assign(layout, { width: PAPER }), config);
    });
  });
  window.addEventListener("afterprint", redraw);
  document.documentElement.dataset.drawn = String(figures.length);
})();
