"use strict";
// What a reader would see wrong on a page: returns a sentence for each defect.
function audit() {
  const found = [];
  const say = (where, what) => found.push(where + ": " + what);
  const apart = (a, b) => [
    Math.min(a.right, b.right) - Math.max(a.left, b.left),
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top),
  ];
  document.querySelectorAll(".plot").forEach((plot) => {
    const name = plot.closest("figure").dataset.name;
    const box = plot.getBoundingClientRect();
    const texts = Array.from(plot.querySelectorAll("svg text"))
      .filter((text) => text.textContent.trim() && !text.closest(".hoverlayer"))
      .map((text) => [text.textContent, text.getBoundingClientRect()])
      .filter(([, r]) => r.width > 0);
    texts.forEach(([text, r], k) => {
      if (Math.min(r.left - box.left, box.right - r.right, r.top - box.top, box.bottom - r.bottom) < -1) {
        say(name, "'" + text + "' is cut off");
      }
      texts.slice(k + 1).forEach(([other, s]) => {
        const [w, h] = apart(r, s);
        if (w > 2 && h > 3) say(name, "'" + text + "' lies over '" + other + "'");
      });
      plot.querySelectorAll(".shapelayer path").forEach((shape) => {
        const s = shape.getBoundingClientRect();
        const [w, h] = apart(r, s);
        if (Math.min(s.width, s.height) < 6 && w >= 0 && h >= 0) say(name, "a line crosses '" + text + "'");
      });
    });
    ["xaxis", "yaxis"].forEach((key) => {
      const axis = plot._fullLayout[key];
      if (!axis || axis.type === "category") return;
      if (!axis.title.text || /^Click/.test(axis.title.text)) say(name, key + " has no title");
      const marks = Array.from(plot.querySelectorAll("." + key[0] + "tick text"), (t) => t.textContent);
      if (new Set(marks).size < 2) say(name, key + " has fewer than two marks");
      if (new Set(marks).size < marks.length) say(name, key + " says a number twice: " + marks);
      marks.filter((mark) => /\d\s?[kMGTPµμmnpf]$/.test(mark))
        .forEach((mark) => say(name, key + " has the mark " + mark));
    });
  });
  // A word or a number of a table or a headline is not broken.
  const paper = window.matchMedia("print").matches || document.documentElement.dataset.paper;
  const range = document.createRange();
  document.querySelectorAll(paper ? "thead th, .facts b, .value" : "td, th, .facts b, .value")
    .forEach((cell) => {
      const walk = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
      for (let node = walk.nextNode(); node; node = walk.nextNode()) {
        for (const word of node.textContent.matchAll(/[^\s-]+(?:e-\d+)?/g)) {
          range.setStart(node, word.index);
          range.setEnd(node, word.index + word[0].length);
          const lines = new Set(Array.from(range.getClientRects(), (r) => Math.round(r.top)));
          if (lines.size > 1) say(cell.textContent.slice(0, 40), "'" + word[0] + "' is broken");
        }
      }
    });
  return found;
}
