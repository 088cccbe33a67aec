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
  const config = { responsive: true, displayModeBar: false };
  const figures = [];
  document.querySelectorAll('script[type="application/json"]').forEach((source) => {
    const target = document.getElementById(source.dataset.for);
    const figure = JSON.parse(source.textContent);
    figures.push([target, figure]);
    Plotly.newPlot(target, lit(figure.data), dress(figure.layout), config);
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
  const WIDTH = 1000;
  function picture(figure, type) {
    // Paper is white: a saved figure is read outside of this page.
    const layout = dress(figure.layout, paper);
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
  dark.addEventListener("change", () => {
    figures.forEach(([target, figure]) =>
      Plotly.react(target, lit(figure.data), dress(figure.layout), config));
  });
  window.addEventListener("beforeprint", () => {
    figures.forEach(([target, figure]) => {
      const layout = Object.assign(dress(figure.layout, paper), { width: 680 });
      Plotly.react(target, figure.data, layout, config);
    });
  });
  window.addEventListener("afterprint", () => {
    figures.forEach(([target, figure]) => {
      const layout = Object.assign(dress(figure.layout), { width: null, autosize: true });
      Plotly.react(target, lit(figure.data), layout, config);
    });
  });
  document.documentElement.dataset.drawn = String(figures.length);
})();
