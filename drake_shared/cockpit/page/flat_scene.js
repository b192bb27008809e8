// A flat drawing in place of the scene, for browsers without WebGL: what the task is, where the robot is and
// drove, and what the agent predicts. It has the methods of the scene.

import { FloorMap } from "./floor_map.js";
import { Theme } from "./scene_theme.js";
import { html } from "./svg.js";

const NOTE = "This browser has no WebGL, so the scene is a flat drawing. Everything else works.";

export class FlatScene {
  #place;
  #map = null;
  #rows = [];

  constructor(place) {
    new Theme(); // Sets the page to light or dark.
    this.#place = html("div", { id: "flat-scene" });
    place.append(this.#place);
  }

  setDriving() {}

  setTask(message) {
    this.#map = new FloorMap(message, "The scene from above");
    this.#rows = [];
    this.#place.replaceChildren(html("p", { class: "note" }, NOTE), this.#map.element);
    this.#map.showPose(message.start, 0);
  }

  setNow({ pose, t }) {
    if (pose?.every((value) => value !== null)) this.#map?.showPose(pose, t);
  }

  setRoutes({ routes }) {
    this.#map?.showRoutes(routes);
  }

  setGhost(points) {
    this.#map?.showInstructed(points);
  }

  setTrail({ rows }) {
    this.#rows = rows.map(([t, x, y, weight, , contact]) => [t, x, y, weight, null, contact]);
    this.#map?.showTrail(this.#rows);
  }

  addToTrail({ t, pose, human_weight, contact }) {
    if (!pose) return;
    this.#rows.push([t, pose[0], pose[1], human_weight, null, contact]);
    this.#map?.showTrail(this.#rows);
  }
}
