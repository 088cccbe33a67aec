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
  const config = { responsive: true, displayModeBar: false };
  const figures = [];
  document.querySelectorAll('script[type="application/json"]').forEach((source) => {
    const target = document.getElementById(source.dataset.for);
    const figure = JSON.parse(source.textContent);
    figures.push([target, figure]);
    Plotly.newPlot(target, figure.data, dress(figure.layout), config);
  });
  dark.addEventListener("change", () => {
    figures.forEach(([target, figure]) => Plotly.react(target, figure.data, dress(figure.layout), config));
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
      Plotly.react(target, figure.data, layout, config);
    });
  });
  document.documentElement.dataset.drawn = String(figures.length);
})();
