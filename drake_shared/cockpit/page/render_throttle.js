// Keeps slow rendering from delaying the mouse: where it is slow, renders asynchronously, in layers if that is
// possible, and pauses after each frame. The resolution stays that of the screen.

import { ReadbackCanvas } from "./readback_canvas.js";
import { Layers } from "./scene_layers.js";

const SLOW_INTERVAL = 40; // ms between frames above which a frame counts as slow
const SLOW_FRAMES = 5; // Number of slow frames in a row after which rendering becomes asynchronous.
const HIDDEN_INTERVAL = 2000; // ms between frames above which the window was hidden, not slow
const IDLE_SHARE = 0.3; // Pause after a frame while nobody drives, as a share of its rendering time.
const DRIVING_INTERVAL = 80; // ms between frames while someone drives

export class RenderThrottle {
  #viewer;
  #readback;
  #layers;
  #inLayers = false; // Whether the frame under way is one of layers.
  #isAsync = false;
  #renderedAt = null;
  #pausedUntil = 0;
  #slowInRow = 0;
  #driving = false;

  constructor(viewer, scene) {
    this.#viewer = viewer;
    this.#readback = new ReadbackCanvas(viewer);
    this.#layers = new Layers(viewer, this.#readback, scene);
    if (rendersInSoftware(viewer.renderer)) this.#goAsync();
    // Meshcat's page calls this for every frame of the screen.
    viewer.animate = () => {
      viewer.animator.update();
      if (this.#isAsync) this.#animateAsync(performance.now());
      else this.#animateSync(performance.now());
    };
  }

  setDriving(driving) {
    this.#driving = driving;
  }

  // Asks for a frame because something has moved.
  touch() {
    if (!this.#isAsync || !this.#layers.touch()) this.#viewer.set_dirty();
  }

  // Asks for a frame because everything looks different.
  refresh() {
    this.#layers.forgetRobot();
    this.#viewer.set_dirty();
  }

  #animateSync(now) {
    // render() returns at once; the interval to the next frame shows how long rendering took.
    const cost = this.#renderedAt === null ? 0 : now - this.#renderedAt;
    this.#slowInRow = cost > SLOW_INTERVAL && cost < HIDDEN_INTERVAL ? this.#slowInRow + 1 : 0;
    this.#renderedAt = null;
    if (this.#slowInRow >= SLOW_FRAMES) this.#goAsync();
    else if (this.#viewer.needs_render) {
      this.#viewer.render();
      this.#renderedAt = now;
    }
  }

  #animateAsync(now) {
    if (this.#readback.busy) {
      if (!this.#readback.fetch()) return;
      if (this.#inLayers) this.#layers.take();
      else this.#readback.show();
      const cost = now - this.#renderedAt;
      this.#pausedUntil = this.#driving ? this.#renderedAt + DRIVING_INTERVAL : now + IDLE_SHARE * cost;
    } else if (this.#viewer.needs_render && now >= this.#pausedUntil) {
      this.#viewer.needs_render = false;
      this.#inLayers = this.#layers.active;
      if (this.#inLayers) this.#layers.draw();
      else {
        this.#layers.hide();
        this.#readback.draw(() => this.#viewer.render());
      }
      this.#renderedAt = now;
    }
    if (this.#inLayers) this.#layers.paint();
  }

  #goAsync() {
    if (!this.#readback.supported) return;
    this.#isAsync = true;
    this.#readback.replace();
    this.#viewer.set_dirty();
  }
}

// Whether the computer has no graphics card that the browser uses.
export function rendersInSoftware(renderer) {
  const gl = renderer.getContext();
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  return info !== null && /swiftshader|llvmpipe|software/i.test(gl.getParameter(info.UNMASKED_RENDERER_WEBGL));
}
