// Keeps the picture from holding up the mouse: where drawing is slow, nobody waits for it, and while
// someone drives from this page it is coarser, so that it comes more often.

import { FarCanvas } from "./far_canvas.js";

const DEAR = 40; // ms from one frame to the next, above which drawing is slow
const DEAR_FRAMES = 5; // in a row, and it is not a hiccup.
const PAUSE = 2000; // ms; a gap as long says that the window was out of sight.
const TOO_LONG = 50; // ms to draw a picture, above which the next is coarser,
const SHORT = 25; // and below which it may be finer again,
const SHORT_PICTURES = 20; // if as many in a row are.
const COARSEST = 0.5; // pixels drawn for a pixel of the screen, along each side
const REST = 0.3; // of the time that a picture took, left to others before the next;
const LEAST = 100; // ms from picture to picture while someone drives

export class Governor {
  #viewer;
  #far;
  #isFar = false;
  #finest = window.devicePixelRatio;
  #ratio = window.devicePixelRatio;
  #drawnAt = null;
  #restUntil = 0;
  #inRow = 0;
  #hurried = false;

  constructor(viewer) {
    this.#viewer = viewer;
    this.#far = new FarCanvas(viewer);
    if (drawnBySoftware(viewer.renderer.getContext())) this.#goFar();
    // Meshcat's page calls this at every frame of the screen.
    viewer.animate = () => {
      viewer.animator.update();
      if (this.#isFar) this.#animateFar(performance.now());
      else this.#animateNear(performance.now());
    };
  }

  // Whether the mouse is in use here.
  hurry(yes) {
    this.#hurried = yes;
    if (!yes) this.#draw(this.#finest);
  }

  #animateNear(now) {
    // What drawing costs shows in when the next frame comes; render() itself returns at once.
    const cost = this.#drawnAt === null ? 0 : now - this.#drawnAt;
    this.#inRow = cost > DEAR && cost < PAUSE ? this.#inRow + 1 : 0;
    this.#drawnAt = null;
    if (this.#inRow >= DEAR_FRAMES) this.#goFar();
    else if (this.#viewer.needs_render) {
      this.#viewer.render();
      this.#drawnAt = now;
    }
  }

  #animateFar(now) {
    if (this.#far.busy) {
      if (!this.#far.fetch()) return;
      const cost = now - this.#drawnAt;
      this.#restUntil = this.#hurried ? this.#drawnAt + LEAST : now + REST * cost;
      this.#inRow = cost < SHORT ? this.#inRow + 1 : 0;
      if (this.#hurried && cost > TOO_LONG) this.#draw(this.#ratio * 0.8);
      else if (this.#inRow > SHORT_PICTURES) this.#draw(this.#ratio * 1.25);
    } else if (this.#viewer.needs_render && now >= this.#restUntil) {
      this.#far.draw();
      this.#drawnAt = now;
    }
  }

  #goFar() {
    if (!this.#far.possible) return;
    this.#isFar = true;
    this.#far.show();
    this.#viewer.set_dirty();
  }

  #draw(ratio) {
    this.#inRow = 0;
    const bounded = Math.min(Math.max(ratio, COARSEST), this.#finest);
    if (bounded === this.#ratio) return;
    this.#ratio = bounded;
    this.#viewer.renderer.setPixelRatio(bounded);
    this.#viewer.set_dirty();
  }
}

function drawnBySoftware(gl) {
  const known = gl.getExtension("WEBGL_debug_renderer_info");
  return known !== null && /swiftshader|llvmpipe|software/i.test(gl.getParameter(known.UNMASKED_RENDERER_WEBGL));
}
