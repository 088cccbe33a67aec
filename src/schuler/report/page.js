"use strict";
(function () {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  function look() {
    const css = getComputedStyle(document.documentElement);
    const v = (name) => css.getPropertyValue(name).trim();
    return { ink: v("--ink"), line: v("--line") };
  }
  function dress(layout) {
    const { ink, line } = look();
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
    figures.forEach(([target]) => Plotly.relayout(target, { width: 680 }));
  });
  window.addEventListener("afterprint", () => {
    figures.forEach(([target]) => Plotly.relayout(target, { width: null, autosize: true }));
  });
  document.documentElement.dataset.drawn = String(figures.length);
})();
