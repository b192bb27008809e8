// Meshcat's part of the page: the view from above fits the workspace, and its own controls stay away.

import { Governor } from "./governor.js";

const MARGIN = 0.08; // m around the workspace

export class Scene {
  #viewer;
  #pane;
  #workspace = null;
  #governor;

  constructor(viewer, pane) {
    this.#viewer = viewer;
    this.#pane = pane;
    const resize = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = (width, height) => {
      resize(width, height);
      this.#fit();
    };
    this.#governor = new Governor(viewer);
    new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
    const controls = document.getElementById("scene-controls");
    controls.addEventListener("click", () => {
      const shown = document.body.classList.toggle("meshcat-controls");
      controls.setAttribute("aria-pressed", String(shown));
    });
    document.getElementById("reset-view").addEventListener("click", () => {
      viewer.controls.reset();
      viewer.set_3d_pane_size();
    });
  }

  // Whether someone drives from this page.
  driving(yes) {
    this.#governor.hurry(yes);
  }

  // Shows the rectangle [x least, x most, y least, y most], in m.
  show(workspace) {
    this.#workspace = workspace;
    this.#viewer.set_3d_pane_size();
  }

  // Meshcat keeps the left edge and the height of an orthographic view; this keeps the whole in view.
  #fit() {
    const camera = this.#viewer.camera;
    if (!this.#workspace || camera.type !== "OrthographicCamera") return;
    const [left, right, bottom, top] = this.#workspace;
    const width = this.#pane.offsetWidth;
    const height = this.#pane.offsetHeight;
    const scale = Math.max((right - left + 2 * MARGIN) / width, (top - bottom + 2 * MARGIN) / height);
    camera.left = (left + right) / 2 - (scale * width) / 2;
    camera.right = (left + right) / 2 + (scale * width) / 2;
    camera.bottom = (bottom + top) / 2 - (scale * height) / 2;
    camera.top = (bottom + top) / 2 + (scale * height) / 2;
    camera.updateProjectionMatrix();
    this.#viewer.controls.enableRotate = false; // From above, north stays up.
    this.#viewer.set_dirty();
  }
}
