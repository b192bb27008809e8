// The scene: what the task is, where the robot drives and drove, and what the agent predicts, drawn in Meshcat's
// scene in lengths about the middle of the workspace. The page and the stand-alone replay share it.

import { Floor } from "./scene_floor.js";
import { Labels } from "./scene_labels.js";
import { RobotMarks } from "./scene_robot.js";
import { Routes } from "./scene_routes.js";
import { describeLength, localTask } from "./scene_task.js";
import { Theme } from "./scene_theme.js";
import { Trail } from "./scene_trail.js";
import { Views } from "./scene_views.js";
import { RenderThrottle, rendersInSoftware } from "./render_throttle.js";

const { THREE } = window.MeshCat;

const BAR = 44; // px at the lower edge, for the buttons and the legend

const CONTROLS = `
  <div class="scene-views" role="group" aria-label="View">
    <button type="button" data-view="above">Above</button>
    <button type="button" data-view="follow">Follow</button>
    <button type="button" data-view="free">Free</button>
  </div>
  <button type="button" class="scene-theme" aria-label="Dark colours"></button>
  <button type="button" class="scene-legend-button" aria-expanded="false">Legend</button>
  <ul class="scene-legend">
    <li data-key="human">Human</li>
    <li data-key="agent">Agent</li>
    <li data-key="shared">Shared command</li>
    <li data-key="route">Predicted route</li>
    <li data-key="trail">Driven, by whom</li>
  </ul>`;

export class Scene {
  #viewer;
  #theme = new Theme();
  #group = new THREE.Group();
  #floor;
  #routes;
  #trail;
  #robot;
  #views;
  #labels;
  #task = null;
  #pose = null; // of the robot, if it is known: [x, y, yaw]
  #throttle;
  #markView = () => {};

  constructor(viewer, pane) {
    this.#viewer = viewer;
    const overlay = document.createElement("div");
    overlay.className = "scene-overlay";
    pane.append(overlay);
    viewer.scene.add(this.#group);
    this.#setUpLight();
    this.#floor = new Floor(this.#group, this.#theme, viewer.renderer, rendersInSoftware(viewer.renderer));
    this.#robot = new RobotMarks(this.#group, this.#theme);
    this.#routes = new Routes(this.#group, this.#theme);
    this.#trail = new Trail(this.#group, this.#theme);
    this.#labels = new Labels(overlay, this.#group, viewer);
    this.#views = new Views(viewer, pane, BAR);
    this.#addControls(overlay);
    const render = viewer.render.bind(viewer);
    viewer.render = () => {
      this.#views.update(performance.now());
      render();
      this.#showLabels();
    };
    this.#throttle = new RenderThrottle(viewer, {
      group: this.#group,
      floor: this.#floor.group,
      inks: [this.#robot, this.#routes, this.#trail].flatMap((part) => part.inks),
      onPaint: () => this.#showLabels(),
      task: () => this.#task,
      pose: () => this.#pose,
      view: () => this.#views.name,
    });
    this.#theme.onChange(() => {
      viewer.scene.background = this.#theme.colors.ground;
      this.#throttle.refresh();
    });
  }

  setDriving(driving) {
    this.#throttle.setDriving(driving);
  }

  // message: see the messages `scene`, `routes`, `trail` and `now` in docs/websocket_protocol.md.
  setTask(message) {
    this.#task = localTask(message);
    for (const part of [this.#floor, this.#robot, this.#routes, this.#trail, this.#views]) part.setTask(this.#task);
    // The table under an arm ends at the height of the floor, where neither would hide the other.
    this.#group.position.z = this.#task.arm ? 0.01 * this.#task.unit : 0;
    this.#pose = null;
    this.#throttle.refresh();
    this.#markView();
  }

  setRoutes({ routes }) {
    if (!this.#task) return;
    this.#routes.show(routes);
    this.#throttle.touch();
  }

  setTrail({ rows }) {
    if (!this.#task) return;
    this.#trail.set(rows);
    this.#throttle.touch();
  }

  setNow(now) {
    if (!this.#task) return;
    this.#robot.show(now);
    this.#pose = now.pose?.every((value) => value !== null) ? now.pose : null;
    this.#views.setPose(this.#pose);
    this.#throttle.touch();
  }

  addToTrail(now) {
    if (!this.#task || !now.pose) return;
    const [x, y] = now.pose;
    this.#trail.add([now.t, x, y, now.human_weight, now.clearance, now.contact]);
  }

  // A path to compare with: [[x, y], ...].
  setGhost(points) {
    this.#trail.setGhost(points);
    this.#throttle.touch();
  }

  #setUpLight() {
    const viewer = this.#viewer;
    for (const name of ["Grid", "Axes", "Lights"]) viewer.set_property([name], "visible", false);
    // Meshcat's background is a gradient with a colour of its own for each kind of camera.
    viewer.update_background = () => {};
    viewer.scene.environment = null;
    const sun = new THREE.DirectionalLight(0xffffff, 1.7);
    sun.position.set(-2, 2.4, 5); // The shadows of scene_floor.js fall away from it.
    this.#group.add(sun, new THREE.HemisphereLight(0xffffff, 0xd4d8de, 2.4));
  }

  #addControls(overlay) {
    const bar = document.createElement("div");
    bar.className = "scene-bar";
    bar.innerHTML = CONTROLS;
    overlay.append(bar);
    // The scene must not be turned by a drag that begins on a button.
    for (const type of ["pointerdown", "wheel"]) bar.addEventListener(type, (event) => event.stopPropagation());
    const buttons = [...bar.querySelectorAll("[data-view]")];
    const mark = () => {
      for (const button of buttons) button.setAttribute("aria-pressed", String(button.dataset.view === this.#views.name));
    };
    for (const button of buttons) {
      button.addEventListener("click", () => {
        if (this.#task) this.#views.choose(button.dataset.view);
        mark();
      });
    }
    mark();
    this.#markView = mark;
    const theme = bar.querySelector(".scene-theme");
    theme.addEventListener("click", () => this.#theme.toggle());
    this.#theme.onChange(() => theme.setAttribute("aria-pressed", String(this.#theme.name === "dark")));
    const legend = bar.querySelector(".scene-legend-button");
    legend.addEventListener("click", () => {
      legend.setAttribute("aria-expanded", String(bar.classList.toggle("scene-legend-open")));
    });
  }

  #showLabels() {
    if (!this.#task) return;
    const { start, goals, scaleBar, unit } = this.#task;
    const middle = [scaleBar.at[0] + scaleBar.length / 2, scaleBar.at[1]];
    const labels = [
      ...goals.map(({ x, y, radius, name }) => ({ kind: "goal", at: [x, y + radius], text: name })),
      { kind: "start", at: [start[0], start[1] - 0.4 * unit], text: "Start" },
      { kind: "scale", at: middle, along: [scaleBar.length, 0], text: describeLength(scaleBar.length) },
      ...this.#trail.labels(),
      ...this.#routes.labels(),
    ];
    this.#labels.show(labels, BAR);
  }
}


