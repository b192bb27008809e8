// The routes that the agent holds possible: a ribbon as wide as the spread and as opaque as the route is
// probable, a line along its middle with arrows, and a mark for each second.

import { along, Ink, smooth } from "./scene_ink.js";

const ROUTES = 5;
const FINER = 3; // Number of drawn points for each point that is sent.
const RIBBON_ALPHA = 0.55; // of a route that is certain
const LINE_ALPHA = [0.35, 0.65]; // of a line: at least, and in addition for a certain route
const SHORT = 0.6; // m, for the robot of reference: a shorter route has no label.
const ARROWS = [0.28, 0.68]; // along a route, as shares of its length

export class Routes {
  #ink;
  #theme;
  #task = null;
  #routes = [];

  constructor(parent, theme) {
    this.#theme = theme;
    this.#ink = new Ink(parent, { capacity: 1600, order: 1 });
    theme.onChange(() => this.#draw());
  }

  get inks() {
    return [this.#ink];
  }

  setTask(task) {
    this.#task = task;
    this.show([]);
  }

  show(routes) {
    const shown = routes.slice(0, ROUTES);
    this.#routes = shown.map((route) => ({ ...route, center: route.center.map(this.#task.move) }));
    this.#draw();
  }

  // Where the probability of each route is written: at a place that is clear of the other routes.
  labels() {
    return this.#routes.flatMap((route, number) => {
      const at = this.#labelPoint(route, number);
      return at === null ? [] : [{ kind: "route", at, centered: true, text: `${Math.round(100 * route.probability)} %` }];
    });
  }

  #labelPoint(route, number) {
    // At the goal there is nothing left to choose, and no room.
    if (lengthOf(route.center) < SHORT * this.#task.unit) return null;
    const others = this.#routes.filter((_, index) => index !== number);
    const enough = 0.6 * this.#task.unit;
    let best = null;
    for (let i = 4; i < route.center.length - 4; i += 2) {
      if (route.fade[i] < 0.05) continue;
      const [x, y] = route.center[i];
      const gaps = others.map((other) => Math.min(...other.center.map(([a, b]) => Math.hypot(a - x, b - y))));
      // Of places that are clear enough, the one nearest to the middle of the route is taken.
      const score = Math.min(...gaps, enough) - 0.5 * enough * Math.abs(i / route.center.length - 0.42);
      if (best === null || score > best.score) best = { score, at: [x, y] };
    }
    return best?.at ?? null;
  }

  #draw() {
    this.#ink.clear();
    // The most probable one comes first, and lies above the others.
    for (const route of [...this.#routes].reverse()) this.#drawRoute(route);
    this.#ink.finish();
  }

  #drawRoute({ center: points, half_width: widths, fade: fades, probability, marks }) {
    // Between the points that are sent lie more, so that the ribbon has no corners.
    const center = smooth(points, FINER);
    const width = (i) => between(widths, i / FINER);
    const fade = (i) => between(fades, i / FINER);
    const { unit } = this.#task;
    const color = this.#theme.colors.agent;
    const lineAlpha = LINE_ALPHA[0] + LINE_ALPHA[1] * probability;
    const faded = (i) => lineAlpha * fade(i);
    const height = 0.006 * unit;
    this.#ink.strip(center, {
      alpha: (i) => RIBBON_ALPHA * probability * fade(i),
      color,
      halfWidth: width,
      height,
    });
    this.#ink.strip(center, { alpha: faded, color, halfWidth: 0.01 * unit, height });
    for (const mark of marks) {
      const index = mark * FINER;
      const { at, direction } = along(center, index);
      const half = [-0.055 * unit * direction[1], 0.055 * unit * direction[0]];
      const ends = [[at[0] - half[0], at[1] - half[1]], [at[0] + half[0], at[1] + half[1]]];
      this.#ink.strip(ends, { alpha: faded(index), color, halfWidth: 0.01 * unit, height });
    }
    for (const share of ARROWS) {
      const index = share * (center.length - 1);
      const size = 0.085 * unit;
      this.#ink.strip(arrowhead(along(center, index), size), {
        alpha: faded(index),
        color,
        halfWidth: (end) => (end ? 0 : 0.75 * size),
        height,
      });
    }
  }
}

const lengthOf = (points) => Math.hypot(points[1][0] - points[0][0], points[1][1] - points[0][1]) * (points.length - 1);

function between(values, index) {
  const before = Math.min(Math.floor(index), values.length - 2);
  return values[before] + (index - before) * (values[before + 1] - values[before]);
}

// The axis of an arrowhead of a length, from its base to its tip.
export function arrowhead({ at: [x, y], direction: [dx, dy] }, length) {
  return [[x - (dx * length) / 2, y - (dy * length) / 2], [x + (dx * length) / 2, y + (dy * length) / 2]];
}
