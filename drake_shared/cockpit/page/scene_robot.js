// Around the robot: who has how much of the control, as a ring, and where each command leads within a second.

import { arrowhead } from "./scene_routes.js";
import { along, Ink } from "./scene_ink.js";

const TIME = 1; // s that an arc covers
const POINTS = 13;
const LEAST_ARC = 0.06; // m, for the robot of reference: a shorter arc is not drawn.

export class RobotMarks {
  #ground;
  #arcs;
  #theme;
  #task = null;
  #now = null;

  constructor(parent, theme) {
    this.#theme = theme;
    this.#ground = new Ink(parent, { capacity: 400, order: 0 });
    // The arcs lie above the robot, which would hide their first part.
    this.#arcs = new Ink(parent, { capacity: 200, order: 20, depthTest: false });
    theme.onChange(() => this.#draw());
  }

  get inks() {
    return [this.#ground, this.#arcs];
  }

  setTask(task) {
    this.#task = task;
    this.#now = null;
    this.#draw();
  }

  show(now) {
    this.#now = now;
    this.#draw();
  }

  #draw() {
    this.#ground.clear();
    this.#arcs.clear();
    if (this.#now?.pose && this.#now.pose.every((value) => value !== null)) {
      this.#drawRing();
      this.#drawArcs();
    }
    this.#ground.finish();
    this.#arcs.finish();
  }

  // A ring round the robot: the human's share begins at the front and grows to both sides.
  #drawRing() {
    const { unit, move } = this.#task;
    const { human, agent, edge } = this.#theme.colors;
    const [x, y, yaw] = this.#now.pose;
    const [cx, cy] = move([x, y]);
    const weight = this.#now.human_weight ?? 1;
    const radius = 0.345 * unit;
    const arc = (from, to, color, halfWidth, alpha) => {
      if (to - from < 1e-3) return;
      const count = Math.max(2, Math.ceil((to - from) * 8));
      const points = Array.from({ length: count + 1 }, (_, i) => {
        const angle = yaw + from + ((to - from) * i) / count;
        return [cx + radius * Math.cos(angle), cy + radius * Math.sin(angle)];
      });
      this.#ground.strip(points, { color, alpha, halfWidth, height: 0.009 * unit });
    };
    arc(-Math.PI, Math.PI, edge, 0.05 * unit, 0.35);
    arc(-weight * Math.PI, weight * Math.PI, human, 0.034 * unit, 1);
    arc(weight * Math.PI, (2 - weight) * Math.PI, agent, 0.034 * unit, 1);
  }

  #drawArcs() {
    const { unit } = this.#task;
    const { human, agent, shared, floor } = this.#theme.colors;
    const arcs = [
      [this.#now.shared, shared, 0.036],
      [this.#now.autonomous, agent, 0.024],
      [this.#now.human, human, 0.024],
    ];
    for (const [command, color, width] of arcs) {
      const points = this.#rollout(command);
      if (points === null) continue;
      const style = { alpha: 1, height: 0.3 * unit };
      const head = arrowhead(along(points, points.length - 2), 0.15 * unit);
      // A rim in the colour of the floor keeps arcs apart from each other and from what lies below.
      for (const [tint, rim] of [[floor, 0.014], [color, 0]]) {
        this.#arcs.strip(points, { ...style, color: tint, halfWidth: (width / 2 + rim) * unit });
        const base = (2.6 * width + 1.6 * rim) * unit;
        this.#arcs.strip(head, { ...style, color: tint, halfWidth: (end) => (end ? 0.2 * rim * unit : base) });
      }
    }
  }

  // The arc of a command in wheel speeds [rad/s]; null if it hardly moves the robot.
  #rollout([left, right]) {
    if (left === null || right === null) return null;
    const { wheelRadius, track, unit, move } = this.#task;
    if (this.#task.arm) return null; // Meshcat draws them at the tip.
    const speed = (wheelRadius / 2) * (left + right);
    const yawRate = (wheelRadius / track) * (right - left);
    if (Math.abs(speed) * TIME < LEAST_ARC * unit) return null;
    const [x, y, yaw] = this.#now.pose;
    const [cx, cy] = move([x, y]);
    return Array.from({ length: POINTS }, (_, i) => {
      const time = (TIME * i) / (POINTS - 1);
      const turn = yawRate * time;
      const chord = speed * time * (Math.abs(turn) < 1e-6 ? 1 : Math.sin(turn / 2) / (turn / 2));
      return [cx + chord * Math.cos(yaw + turn / 2), cy + chord * Math.sin(yaw + turn / 2)];
    });
  }
}
