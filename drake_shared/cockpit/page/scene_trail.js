// The path driven so far, coloured by who drove it, with marks at contact and at the least clearance.

import { Ink } from "./scene_ink.js";
import { describeLength, nearestPoint } from "./scene_task.js";

const CAPACITY = 1500; // points
const PAST = 0.05; // m, likewise, by which the clearance has grown once the least one is past
const NEAR = 1.0; // m, for the robot of reference: a least clearance above this is not marked.

export class Trail {
  #ink;
  #marks;
  #theme;
  #task = null;
  #ghost = [];
  #rows = []; // [t, x, y, human_weight, clearance, contact], in the world frame

  constructor(parent, theme) {
    this.#theme = theme;
    this.#ink = new Ink(parent, { capacity: 1.5 * CAPACITY, order: 2 });
    this.#marks = new Ink(parent, { capacity: 400, order: 19, depthTest: false });
    theme.onChange(() => this.#draw());
  }

  get inks() {
    return [this.#ink, this.#marks];
  }

  setTask(task) {
    this.#task = task;
    this.set([]);
  }

  // A path to compare with, drawn pale; points in the world frame.
  setGhost(points) {
    this.#ghost = points;
    this.#draw();
  }

  // Replaces the whole trail.
  set(rows) {
    this.#rows = rows.filter(([, x, y]) => x !== null && y !== null);
    this.#draw();
  }

  add(row) {
    const last = this.#rows.at(-1);
    if (row[1] === null || row[2] === null || (last && row[0] <= last[0])) return;
    this.#rows.push(row);
    this.#draw();
  }

  labels() {
    const { contacts, nearest } = this.#events();
    const event = contacts[0] ?? nearest;
    if (!event) return [];
    // Beside the robot, which may still be there.
    const [x, y] = this.#at(event);
    const at = [x, y + 0.42 * this.#task.unit];
    if (contacts.length) return [{ kind: "contact", at, text: "Contact" }];
    return [{ kind: "clearance", at, text: `Closest: ${describeLength(Number(event[4].toPrecision(2)))}` }];
  }

  #at(row) {
    return this.#task.move([row[1], row[2]]);
  }

  // The first row of each contact, and the row of the least clearance once it is past.
  #events() {
    let nearest = null;
    const contacts = [];
    this.#rows.forEach((row, i) => {
      if (row[5] && !this.#rows[i - 1]?.[5]) contacts.push(row);
      if (row[4] !== null && (nearest === null || row[4] < nearest[4])) nearest = row;
    });
    const isPast = nearest && this.#rows.at(-1)[4] > nearest[4] + PAST * this.#task.unit;
    return { contacts, nearest: isPast && nearest[4] < NEAR * this.#task.unit ? nearest : null };
  }

  #draw() {
    this.#ink.clear();
    this.#marks.clear();
    if (this.#ghost.length > 1) this.#drawGhost();
    if (this.#rows.length > 1) this.#drawRows();
    this.#ink.finish();
    this.#marks.finish();
  }

  #drawGhost() {
    const { unit, move } = this.#task;
    const points = thinned(this.#ghost, CAPACITY / 2).map(move);
    this.#ink.strip(points, { alpha: 0.9, color: this.#theme.colors.edge, halfWidth: 0.016 * unit, height: 0.01 * unit });
  }

  #drawRows() {
    const { unit } = this.#task;
    const { human, agent, contact: red, shared } = this.#theme.colors;
    const rows = thinned(this.#rows, CAPACITY);
    const mixed = rows.map((row) => agent.clone().lerp(human, row[3] ?? 1));
    const style = { height: 0.012 * unit, alpha: 0.95 };
    this.#ink.strip(rows.map((row) => this.#at(row)), { ...style, color: (i) => mixed[i], halfWidth: 0.028 * unit });
    const { contacts, nearest } = this.#events();
    const above = { alpha: 1, height: 0.016 * unit };
    for (const row of contacts.slice(0, 12)) {
      const [x, y] = this.#touched(row);
      const size = 0.08 * unit;
      for (const turn of [1, -1]) {
        const ends = [[x - size, y - turn * size], [x + size, y + turn * size]];
        this.#marks.strip(ends, { ...above, color: red, halfWidth: 0.03 * unit });
      }
    }
    if (!contacts.length && nearest) {
      const at = this.#at(nearest);
      this.#marks.ring(at, { ...above, color: shared, inner: 0.03 * unit, outer: 0.055 * unit });
      const gap = [at, this.#touched(nearest)];
      this.#marks.strip(gap, { ...above, color: shared, halfWidth: 0.009 * unit });
    }
  }

  // The point of the nearest obstacle; the robot's own position if that obstacle moves.
  #touched(row) {
    const at = this.#at(row);
    const nearest = nearestPoint(this.#task.obstacles, at);
    const reach = this.#task.robotRadius + row[4] + 0.02 * this.#task.unit;
    return nearest && nearest.distance < reach ? nearest.at : at;
  }
}

// Every second or third of many items; the last one always.
function thinned(items, most) {
  const every = Math.ceil(items.length / (most - 1));
  return items.filter((_, i) => i % every === 0 || i === items.length - 1);
}
