// Meshcat's part of the page: fits the view from above to the workspace, and hides Meshcat's controls.

import { RenderThrottle } from "./render_throttle.js";

const MARGIN = 0.08; // m around the workspace

export class Scene {
  #viewer;
  #pane;
  #workspace = null;
  #throttle;

  constructor(viewer, pane) {
    this.#viewer = viewer;
    this.#pane = pane;
    const resize = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = (width, height) => {
      resize(width, height);
      this.#fit();
    };
    this.#throttle = new RenderThrottle(viewer);
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

  setDriving(driving) {
    this.#throttle.setDriving(driving);
  }

  // Fits the view to [x_min, x_max, y_min, y_max], in m.
  setWorkspace(workspace) {
    this.#workspace = workspace;
    this.#viewer.set_3d_pane_size();
  }

  // Meshcat keeps only the left edge and the height of an orthographic view when the window changes.
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
    this.#viewer.controls.enableRotate = false; // The view from above stays upright.
    this.#viewer.set_dirty();
  }
}
