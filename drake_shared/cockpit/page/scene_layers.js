// The view from above on computers without a graphics card: Meshcat draws what stands still, and once the robot;
// a 2-D canvas above that picture draws what moves, which takes less time than a whole frame.

import { fillObstacle } from "./scene_floor.js";

const { THREE } = window.MeshCat;

const ROBOT = ["drake", "scene", "robot"];
const ROBOT_PATH = `/${ROBOT.join("/")}`;
const FINER = 2; // Pixels of the robot's picture for one of the screen, since it is turned.
const REACH = 1.8; // Half the side of that picture, in radii of the robot.

export class Layers {
  #viewer;
  #scene;
  #inks;
  #readback;
  #canvas = document.createElement("canvas");
  #picture = null; // of the robot, its front to the right: {canvas, scale in px/m}
  #pictureIsOld = true;
  #moved = false;
  #taken = null; // The size of the picture of the robot, while the frame under way is that.
  #plan = null; // From the floor to pixels of the frame under way,
  #shown = null; // and of the one that is shown.

  // scene: {group, inks, floor, pose(), task(), view(), onPaint()}
  constructor(viewer, readback, scene) {
    this.#viewer = viewer;
    this.#scene = scene;
    this.#inks = scene.inks.sort((a, b) => a.mesh.renderOrder - b.mesh.renderOrder);
    this.#readback = readback;
    this.#canvas.className = "moving";
    const handle = viewer.handle_command.bind(viewer);
    viewer.handle_command = (command) => {
      const before = viewer.needs_render;
      handle(command);
      if (!command.path?.startsWith(ROBOT_PATH)) return;
      if (command.type !== "set_transform") this.#pictureIsOld = true;
      else if (this.#isReady) viewer.needs_render = before;
    };
  }

  // Whether the scene can be drawn in layers now.
  get active() {
    const task = this.#scene.task();
    return this.#scene.view() === "above" && Boolean(task?.isStill && this.#scene.pose() && hasMesh(this.#robot));
  }

  // Asks for another drawing of what moves. Returns false if that takes a whole frame.
  touch() {
    this.#moved = true;
    return this.#isReady;
  }

  // The theme or the robot looks different.
  forgetRobot() {
    this.#pictureIsOld = true;
  }

  // Starts to draw what stands still, or the picture of the robot if that is due.
  draw() {
    this.#taken = null;
    if (this.#pictureIsOld && this.#shown) return this.#drawRobot();
    this.#readback.draw(() => this.#without([this.#robot, ...this.#meshes], () => this.#viewer.render()));
    this.#plan = this.#floorPlan();
  }

  // Shows the frame that is complete.
  take() {
    this.#moved = true;
    if (this.#taken) {
      this.#picture = { canvas: this.#readback.square(this.#taken.side), scale: this.#taken.scale };
      return;
    }
    this.#readback.show();
    if (String(this.#shown) !== String(this.#plan)) this.#pictureIsOld = true;
    this.#shown = this.#plan;
    if (this.#pictureIsOld) this.#viewer.set_dirty();
  }

  // Hides the layer of what moves, because a frame shows everything.
  hide() {
    this.#canvas.remove();
    this.#shown = null;
  }

  // Draws what moves, if it has moved.
  paint() {
    if (!this.#moved || !this.#shown) return;
    this.#moved = false;
    const still = this.#readback.canvas;
    if (this.#canvas.parentNode !== still.parentNode) still.after(this.#canvas);
    if (this.#canvas.width !== still.width) this.#canvas.width = still.width;
    if (this.#canvas.height !== still.height) this.#canvas.height = still.height;
    const context = this.#canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, still.width, still.height);
    context.setTransform(...this.#shown);
    for (const ink of this.#inks) if (!ink.isOnTop) ink.paint(context);
    this.#cutObstacles(context);
    this.#paintRobot(context);
    for (const ink of this.#inks) if (ink.isOnTop) ink.paint(context);
    this.#scene.onPaint();
  }

  get #isReady() {
    return this.#shown !== null && this.active;
  }

  get #robot() {
    return this.#viewer.scene_tree.find(ROBOT).object;
  }

  get #meshes() {
    return this.#inks.map((ink) => ink.mesh);
  }

  // The affine map of a 2-D canvas from the floor, in m, to pixels.
  #floorPlan() {
    const { width, height } = this.#viewer.renderer.domElement;
    const [o, x, y] = [[0, 0], [1, 0], [0, 1]].map(([a, b]) => {
      const at = this.#scene.group.localToWorld(new THREE.Vector3(a, b, 0)).project(this.#viewer.camera);
      return [((at.x + 1) / 2) * width, ((1 - at.y) / 2) * height];
    });
    return [x[0] - o[0], x[1] - o[1], y[0] - o[0], y[1] - o[1], o[0], o[1]];
  }

  // Obstacles are higher than the lines on the floor, and hide them.
  #cutObstacles(context) {
    context.globalCompositeOperation = "destination-out";
    for (const obstacle of this.#scene.task().obstacles) {
      context.save();
      fillObstacle(context, obstacle);
      context.restore();
    }
    context.globalCompositeOperation = "source-over";
  }

  #paintRobot(context) {
    const pose = this.#scene.pose();
    if (!this.#picture || !pose) return;
    const { canvas, scale } = this.#picture;
    context.save();
    context.translate(...this.#scene.task().move(pose));
    context.rotate(pose[2]);
    context.scale(1 / scale, 1 / scale); // The picture's first row is the bottom one, as y is up here.
    context.imageSmoothingQuality = "high";
    context.drawImage(canvas, -canvas.width / 2, -canvas.height / 2);
    context.restore();
  }

  // Draws the robot alone, its front to the right, in the middle of the frame.
  #drawRobot() {
    const { scene, renderer } = this.#viewer;
    const { width, height } = renderer.domElement;
    const { robotRadius, unit } = this.#scene.task();
    const side = 2 * REACH * robotRadius;
    const scale = Math.min(FINER * Math.hypot(this.#shown[0], this.#shown[1]), width / side, height / side);
    const [halfWidth, halfHeight] = [width / scale / 2, height / scale / 2];
    const camera = new THREE.OrthographicCamera(-halfWidth, halfWidth, halfHeight, -halfHeight, 0, 20 * unit);
    const [middle, left, above] = [[0, 0, 0], [0, 1, 0], [0, 0, 10 * unit]].map((at) =>
      this.#robot.localToWorld(new THREE.Vector3(...at)),
    );
    camera.up = left.sub(middle);
    camera.position.copy(above);
    camera.lookAt(middle);
    const others = this.#robot.parent.children.filter((child) => child !== this.#robot);
    const ground = scene.background;
    this.#readback.draw(() => {
      scene.background = null;
      this.#without([...others, this.#scene.floor, ...this.#meshes], () => renderer.render(scene, camera));
      scene.background = ground;
    });
    this.#taken = { side: Math.floor(side * scale), scale };
    this.#pictureIsOld = false;
  }

  #without(objects, render) {
    const shown = objects.filter((object) => object.visible);
    for (const object of shown) object.visible = false;
    render();
    for (const object of shown) object.visible = true;
  }
}

function hasMesh(object) {
  let found = false;
  object?.traverse((part) => (found ||= part.isMesh));
  return found;
}
