// Two square plots: position of the stick, and the commands. Up is forward, right is to the right.

const NS = "http://www.w3.org/2000/svg";

function add(parent, tag, attributes) {
  const element = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  parent.append(element);
  return element;
}

function frame(svg) {
  add(svg, "rect", { x: -1.1, y: -1.1, width: 2.2, height: 2.2, rx: 0.14, class: "field" });
  add(svg, "path", { d: "M-1 0H1M0 -1V1", class: "cross" });
}

const bounded = (value) => Math.min(Math.max(value, -1), 1);

function place(element, [x, y]) {
  element.setAttribute("transform", `translate(${bounded(x).toFixed(3)} ${bounded(y).toFixed(3)})`);
}

export class StickPlot {
  #arm;
  #knob;

  constructor(svg) {
    frame(svg);
    add(svg, "circle", { r: 1, class: "range" });
    this.#arm = add(svg, "line", { x1: 0, y1: 0, class: "arm" });
    this.#knob = add(svg, "circle", { r: 0.2, class: "human knob" });
  }

  // Deflections forward and to the left, in [-1, 1]; null while nobody drives.
  show([forward, left]) {
    const at = forward === null ? [0, 0] : [-left, -forward];
    this.#arm.setAttribute("x2", at[0]);
    this.#arm.setAttribute("y2", at[1]);
    place(this.#knob, at);
  }
}

export class CommandPlot {
  #difference;
  #marks;

  constructor(svg) {
    frame(svg);
    this.#difference = add(svg, "line", { class: "difference" });
    this.#marks = {
      autonomous: add(svg, "circle", { r: 0.13, class: "agent" }),
      human: add(svg, "circle", { r: 0.13, class: "human" }),
      shared: add(svg, "circle", { r: 0.19, class: "shared ring" }),
    };
  }

  // Each of human, autonomous and shared is [to the right, backward] as a share of the maximum, or null.
  show(points) {
    for (const [name, mark] of Object.entries(this.#marks)) {
      mark.style.display = points[name] ? "" : "none";
      if (points[name]) place(mark, points[name]);
    }
    const both = points.human && points.autonomous;
    this.#difference.style.display = both ? "" : "none";
    if (!both) return;
    this.#difference.setAttribute("x1", bounded(points.human[0]));
    this.#difference.setAttribute("y1", bounded(points.human[1]));
    this.#difference.setAttribute("x2", bounded(points.autonomous[0]));
    this.#difference.setAttribute("y2", bounded(points.autonomous[1]));
  }
}
