// Keeps slow rendering from delaying the mouse: renders asynchronously where it is slow, and at a lower
// resolution while someone drives from this page, so that frames come more often.

import { ReadbackCanvas } from "./readback_canvas.js";

const SLOW_INTERVAL = 40; // ms between frames above which a frame counts as slow
const SLOW_FRAMES = 5; // Number of slow frames in a row after which rendering becomes asynchronous.
const HIDDEN_INTERVAL = 2000; // ms between frames above which the window was hidden, not slow
const LONG_RENDER = 50; // ms of rendering above which the resolution is lowered
const SHORT_RENDER = 25; // ms of rendering below which the resolution may be raised,
const SHORT_RENDERS = 20; // if more renders than this in a row are as short.
const LOWEST_RATIO = 0.5; // Lowest resolution, in rendered pixels for a pixel of the screen.
const IDLE_SHARE = 0.3; // Pause after a frame while nobody drives, as a share of its rendering time.
const DRIVING_INTERVAL = 100; // ms between frames while someone drives

export class RenderThrottle {
  #viewer;
  #readback;
  #isAsync = false;
  #highestRatio = window.devicePixelRatio;
  #ratio = window.devicePixelRatio;
  #renderedAt = null;
  #pausedUntil = 0;
  #inRow = 0;
  #driving = false;

  constructor(viewer) {
    this.#viewer = viewer;
    this.#readback = new ReadbackCanvas(viewer);
    if (rendersInSoftware(viewer.renderer.getContext())) this.#goAsync();
    // Meshcat's page calls this for every frame of the screen.
    viewer.animate = () => {
      viewer.animator.update();
      if (this.#isAsync) this.#animateAsync(performance.now());
      else this.#animateSync(performance.now());
    };
  }

  setDriving(driving) {
    this.#driving = driving;
    if (!driving) this.#setRatio(this.#highestRatio);
  }

  #animateSync(now) {
    // render() returns at once; the interval to the next frame shows how long rendering took.
    const cost = this.#renderedAt === null ? 0 : now - this.#renderedAt;
    this.#inRow = cost > SLOW_INTERVAL && cost < HIDDEN_INTERVAL ? this.#inRow + 1 : 0;
    this.#renderedAt = null;
    if (this.#inRow >= SLOW_FRAMES) this.#goAsync();
    else if (this.#viewer.needs_render) {
      this.#viewer.render();
      this.#renderedAt = now;
    }
  }

  #animateAsync(now) {
    if (this.#readback.busy) {
      if (!this.#readback.showIfComplete()) return;
      const cost = now - this.#renderedAt;
      this.#pausedUntil = this.#driving ? this.#renderedAt + DRIVING_INTERVAL : now + IDLE_SHARE * cost;
      this.#inRow = cost < SHORT_RENDER ? this.#inRow + 1 : 0;
      if (this.#driving && cost > LONG_RENDER) this.#setRatio(this.#ratio * 0.8);
      else if (this.#inRow > SHORT_RENDERS) this.#setRatio(this.#ratio * 1.25);
    } else if (this.#viewer.needs_render && now >= this.#pausedUntil) {
      this.#readback.draw();
      this.#renderedAt = now;
    }
  }

  #goAsync() {
    if (!this.#readback.supported) return;
    this.#isAsync = true;
    this.#readback.show();
    this.#viewer.set_dirty();
  }

  #setRatio(ratio) {
    this.#inRow = 0;
    const bounded = Math.min(Math.max(ratio, LOWEST_RATIO), this.#highestRatio);
    if (bounded === this.#ratio) return;
    this.#ratio = bounded;
    this.#viewer.renderer.setPixelRatio(bounded);
    this.#viewer.set_dirty();
  }
}

function rendersInSoftware(gl) {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  return info !== null && /swiftshader|llvmpipe|software/i.test(gl.getParameter(info.UNMASKED_RENDERER_WEBGL));
}
