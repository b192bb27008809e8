// Draws a task and the paths driven in it from above: workspace, obstacles, start, goals, routes and paths.
// Lengths in m from the middle of the workspace, y up.

import { svg } from "./svg.js";

export class FloorMap {
  element;
  #scene;
  #middle;
  #unit;
  #instructed = svg("g");
  #predicted = svg("g");
  #paths = svg("g");
  #marks = svg("g");
  #obstacles = [];
  #robot = null;

  // `label` is read out in place of the drawing.
  constructor(scene, label) {
    const [left, right, bottom, top] = scene.workspace;
    this.#scene = scene;
    this.#middle = [(left + right) / 2, (bottom + top) / 2];
    this.#unit = Math.max(right - left, top - bottom) / 100;
    const [width, height] = [right - left, top - bottom];
    const margin = this.#unit;
    const box = [-width / 2 - margin, -height / 2 - margin, width + 2 * margin, height + 2 * margin];
    this.element = svg("svg", { class: "floor-map", viewBox: box.join(" "), role: "img", "aria-label": label });
    this.element.style.setProperty("--unit", this.#unit);
    this.element.append(
      svg("rect", { class: "floor", x: -width / 2, y: -height / 2, width, height, rx: this.#unit / 2 }),
      ...scene.obstacles.map((obstacle) => this.#drawObstacle(obstacle)),
      ...scene.goals.map((goal) => this.#drawGoal(goal)),
      this.#circle("start", scene.start, 0.3 * scene.robot_radius),
      this.#instructed,
      this.#predicted,
      this.#paths,
      this.#marks,
    );
  }

  // Shows one driven path; `rows` are [t, x, y, w, confidence, contact].
  addPath(rows, className) {
    const points = rows.filter(([, x, y]) => x !== null && y !== null);
    const line = points.map(([, x, y]) => this.at([x, y]).join(" ")).join("L");
    if (!line) return;
    this.#paths.append(svg("path", { class: `driven ${className}`, d: `M${line}`, "stroke-width": 0.7 * this.#unit }));
    const contact = points.find((row) => row[5]);
    if (contact) this.#marks.append(this.#cross(contact.slice(1, 3)));
  }

  addRoute(route, chosen = true) {
    const line = route.path.map((point) => this.at(point).join(" ")).join("L");
    const className = chosen ? "instructed chosen" : "instructed";
    this.#instructed.append(svg("path", { class: className, d: `M${line}`, "stroke-width": (chosen ? 1.1 : 0.5) * this.#unit }));
  }

  // Shows one instructed route alone; none for no points.
  showInstructed(points) {
    this.#instructed.replaceChildren();
    if (points.length) this.addRoute({ path: points });
  }

  // Shows the routes that the agent holds possible, each with its probability.
  showRoutes(routes) {
    this.#predicted.replaceChildren(
      ...routes.map(({ probability, center }) =>
        svg("path", {
          class: "predicted",
          d: `M${center.map((point) => this.at(point).join(" ")).join("L")}`,
          "stroke-opacity": 0.2 + 0.7 * probability,
          "stroke-width": 1.6 * this.#unit,
        }),
      ),
    );
  }

  showTrail(rows) {
    this.#paths.replaceChildren();
    this.#marks.replaceChildren();
    this.addPath(rows, "shared");
  }

  // Shows the robot at a pose [x, y, yaw], and the obstacles at the same time, in s.
  showPose([x, y, yaw = null], time) {
    const radius = this.#scene.robot_radius;
    this.#robot ??= this.element.appendChild(
      svg("g", { class: "robot" }, svg("circle", { r: radius }), svg("path", { d: `M0 0H${radius}` })),
    );
    const place = `translate(${this.at([x, y]).join(" ")})`;
    this.#robot.setAttribute("transform", yaw === null ? place : `${place} rotate(${(-180 / Math.PI) * yaw})`);
    this.#robot.lastChild.style.display = yaw === null ? "none" : "";
    this.showObstacles(time);
  }

  // Shows where the robot was at a time, in s.
  showRobot(rows, time) {
    const row = rows.findLast(([t, x]) => t <= time + 1e-6 && x !== null);
    if (row) this.showPose(row.slice(1, 3), time);
  }

  at([x, y]) {
    return [round(x - this.#middle[0]), round(this.#middle[1] - y)];
  }

  // Moves the obstacles that have a path to where they are at a time.
  showObstacles(time) {
    for (const { obstacle, element } of this.#obstacles) {
      if (!obstacle.path?.length) continue;
      const [x, y] = this.at(along(obstacle.path, time));
      element.setAttribute("transform", `translate(${x} ${y}) rotate(${(-180 / Math.PI) * (obstacle.yaw ?? 0)})`);
    }
  }

  #drawObstacle(obstacle) {
    const [x, y] = this.at([obstacle.x, obstacle.y]);
    const { radius, length, width, yaw = 0 } = obstacle;
    const element = radius
      ? svg("circle", { r: radius })
      : svg("rect", { x: -length / 2, y: -width / 2, width: length, height: width });
    element.setAttribute("class", "obstacle");
    element.setAttribute("transform", `translate(${x} ${y}) rotate(${(-180 / Math.PI) * yaw})`);
    this.#obstacles.push({ obstacle, element });
    return element;
  }

  #drawGoal({ x, y, radius, name }) {
    const circle = this.#circle("goal", [x, y], radius);
    circle.append(svg("title", {}, name));
    return circle;
  }

  #circle(name, place, r) {
    const [cx, cy] = this.at(place);
    return svg("circle", { class: name, cx, cy, r });
  }

  #cross(place) {
    const [x, y] = this.at(place);
    const d = 1.6 * this.#unit;
    return svg("path", {
      class: "contact-mark",
      d: `M${x - d} ${y - d}L${x + d} ${y + d}M${x - d} ${y + d}L${x + d} ${y - d}`,
      "stroke-width": 0.8 * this.#unit,
    });
  }
}

function along(path, time) {
  const after = path.findIndex(([t]) => t >= time);
  if (after === 0) return path[0].slice(1);
  if (after < 0) return path.at(-1).slice(1);
  const [t0, x0, y0] = path[after - 1];
  const [t1, x1, y1] = path[after];
  const share = (time - t0) / (t1 - t0);
  return [x0 + share * (x1 - x0), y0 + share * (y1 - y0)];
}

const round = (value) => Math.round(1e4 * value) / 1e4;
