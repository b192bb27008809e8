// The cameras: from above, following the robot, and free. The view from above is upright, with x to the right,
// or x upwards where the window is high and the workspace wide.

const { THREE } = window.MeshCat;

const MARGIN = 14; // px around the workspace
const HEIGHT = 50; // of the camera from above, in units of the robot's size; orthographic, so any will do
const SMOOTHING = 0.3; // s in which the following camera closes most of the distance
const FOLLOW = { behind: 1.5, above: 1.35, ahead: 1.3 }; // m, for the robot of reference



export class Views {
  name = "above";
  #viewer;
  #pane;
  #bottom; // px at the lower edge of the pane that the scene leaves free
  #task = null;
  #pose = null;
  #followed = null; // the pose that the camera follows: the robot's, smoothed
  #updatedAt = 0;
  #size = []; // px of the pane, to which the camera is fitted

  constructor(viewer, pane, bottom) {
    this.#viewer = viewer;
    this.#pane = pane;
    this.#bottom = bottom;
    const resize = viewer.set_3d_pane_size.bind(viewer);
    viewer.set_3d_pane_size = (...size) => {
      resize(...size);
      this.#fit();
    };
    new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
    // A camera that Meshcat receives from elsewhere gives way to the chosen one.
    const set = viewer.set_camera.bind(viewer);
    viewer.set_camera = (camera) => {
      viewer.controls?.dispose();
      set(camera);
    };
  }

  setTask(task) {
    // What is above what shows from an angle only.
    const turned = task.arm && !this.#task?.arm && this.name === "above";
    this.#task = task;
    this.#followed = null;
    this.choose(turned ? "free" : this.name);
  }

  choose(name) {
    this.name = name;
    const { unit } = this.#task;
    const far = 40 * Math.max(this.#task.width, this.#task.depth, 10 * unit);
    const camera =
      name === "above"
        ? new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1 * unit, 2 * HEIGHT * unit)
        : new THREE.PerspectiveCamera(name === "free" ? 40 : 55, 1, 0.05 * unit, far);
    this.#viewer.set_camera(camera);
    this.#viewer.controls.enableRotate = name === "free";
    this.#viewer.controls.enabled = name !== "follow";
    this.#viewer.controls.maxPolarAngle = 0.49 * Math.PI;
    this.#followed = null;
    this.#viewer.set_3d_pane_size();
    setTimeout(() => this.#viewer.set_dirty(), 300);
  }

  // pose: [x, y, yaw], in the world frame, or null.
  setPose(pose) {
    this.#pose = pose;
  }

  // Fits the size and moves the following camera; called before each frame.
  update(now) {
    // The observer misses a pane that has another size only until the page is laid out.
    if (this.#pane.offsetWidth !== this.#size[0] || this.#pane.offsetHeight !== this.#size[1]) {
      this.#viewer.set_3d_pane_size();
    }
    if (this.name !== "follow" || !this.#task) return;
    const [x, y, yaw] = this.#pose ?? [
      this.#task.start[0] + this.#task.middle[0], this.#task.start[1] + this.#task.middle[1], this.#task.start[2],
    ];
    const [cx, cy] = this.#task.move([x, y]);
    const elapsed = Math.min((now - this.#updatedAt) / 1000, 0.2);
    this.#updatedAt = now;
    if (this.#followed === null) this.#followed = [cx, cy, yaw];
    const share = 1 - Math.exp(-elapsed / SMOOTHING);
    const [fx, fy, fyaw] = this.#followed;
    const turn = Math.atan2(Math.sin(yaw - fyaw), Math.cos(yaw - fyaw));
    const moved = [share * (cx - fx), share * (cy - fy), share * turn];
    this.#followed = [fx + moved[0], fy + moved[1], fyaw + moved[2]];
    if (Math.hypot(...moved) > 1e-4 * this.#task.unit) this.#viewer.set_dirty();
    this.#placeFollower();
  }

  #placeFollower() {
    const { unit } = this.#task;
    const [x, y, yaw] = this.#followed;
    const [dx, dy] = [Math.cos(yaw) * unit, Math.sin(yaw) * unit];
    this.#place([x - FOLLOW.behind * dx, y - FOLLOW.behind * dy, FOLLOW.above * unit]);
    this.#viewer.controls.target.copy(toThree([x + FOLLOW.ahead * dx, y + FOLLOW.ahead * dy, 0]));
  }

  #place(position) {
    this.#viewer.camera.position.copy(toThree(position));
  }

  #fit() {
    if (!this.#task) return;
    const [width, height] = [this.#pane.offsetWidth, this.#pane.offsetHeight];
    if (!width || !height) return;
    this.#size = [width, height];
    if (this.name === "above") this.#fitAbove(width, height);
    else {
      this.#viewer.camera.aspect = width / height;
      this.#viewer.camera.updateProjectionMatrix();
      if (this.name === "free") this.#fitFree(width, height);
      else if (this.#followed) this.#placeFollower();
    }
    this.#viewer.set_dirty();
  }

  #fitAbove(width, height) {
    const { camera, controls } = this.#viewer;
    const upwards = height > 1.2 * width && this.#task.width > this.#task.depth;
    const [across, up] = upwards ? [this.#task.depth, this.#task.width] : [this.#task.width, this.#task.depth];
    const free = height - this.#bottom;
    const scale = Math.max(across / (width - 2 * MARGIN), up / (free - 2 * MARGIN));
    camera.left = (-scale * width) / 2;
    camera.right = (scale * width) / 2;
    camera.top = (scale * free) / 2;
    camera.bottom = camera.top - scale * height;
    camera.zoom = 1;
    // A camera straight above has no direction: a little aside, its side decides what points up.
    const aside = 1e-4 * HEIGHT * this.#task.unit;
    this.#place(upwards ? [-aside, 0, HEIGHT * this.#task.unit] : [0, -aside, HEIGHT * this.#task.unit]);
    controls.target.set(0, 0, 0);
    camera.updateProjectionMatrix();
  }

  // Looks from the side of the start, so far away that the whole workspace is seen, and an arm.
  #fitFree(width, height) {
    const { camera, controls } = this.#viewer;
    const { width: w, depth: d, unit, arm, base, height: top } = this.#task;
    const upwards = height > 1.2 * width;
    const direction = upwards ? [-0.72, 0, 0.75] : [0, -0.72, 0.75];
    const limit = [1 - (2 * MARGIN) / width, 1 - (2 * (MARGIN + this.#bottom)) / height];
    const corners = [-1, 1].flatMap((a) => [-1, 1].map((b) => [(a * w) / 2, (b * d) / 2, 0]));
    const middle = arm ? [base[0] / 2, base[1] / 2, top / 2] : [0, 0, 0];
    if (arm) corners.push([...base, 0], ...[base, ...corners].map(([x, y]) => [x, y, top]));
    controls.target.copy(toThree(middle));
    for (let distance = 0.5 * unit; distance < 20 * Math.max(w, d, unit); distance *= 1.04) {
      this.#place(direction.map((part, i) => middle[i] + part * distance));
      camera.lookAt(controls.target);
      camera.updateMatrixWorld();
      const inside = corners.every((corner) => {
        const { x, y, z } = toThree(corner).project(camera);
        return Math.abs(x) < limit[0] && Math.abs(y) < limit[1] && z < 1;
      });
      if (inside) break;
    }
  }
}

// Meshcat's scene, with z up, is turned by a quarter about x in the world of three.js, with y up.
const toThree = ([x, y, z]) => new THREE.Vector3(x, z, -y);
