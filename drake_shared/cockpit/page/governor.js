// Keeps the picture from holding up the mouse: where drawing is slow, it is done less often, and coarser
// while someone drives from this page.

const DEAR = 40; // ms from one frame to the next, above which drawing is made cheaper
const CHEAP = 22; // ms below which it may be finer again,
const CHEAP_FRAMES = 90; // if it stays so for as many frames.
const COARSEST = 0.4; // pixels drawn for a pixel of the screen, along each side
const PAUSE = 2000; // ms; a gap as long says that the window was out of sight, not that drawing is slow.

export class Governor {
  #viewer;
  #finest = window.devicePixelRatio;
  #ratio = window.devicePixelRatio;
  #drawnAt = null;
  #restUntil = 0;
  #cheap = 0;
  #hurried = false;

  constructor(viewer) {
    this.#viewer = viewer;
    // Meshcat's page calls this at every frame of the screen.
    viewer.animate = () => this.#animate(performance.now());
  }

  // Whether the mouse is in use here, and must not wait.
  hurry(yes) {
    this.#hurried = yes;
    if (!yes) this.#draw(this.#finest);
  }

  #animate(now) {
    if (this.#drawnAt !== null) this.#judge(now, now - this.#drawnAt);
    this.#drawnAt = null;
    this.#viewer.animator.update();
    if (!this.#viewer.needs_render || now < this.#restUntil) return;
    this.#viewer.render();
    this.#drawnAt = now;
  }

  // What drawing costs shows in when the next frame comes; render() itself returns at once.
  #judge(now, cost) {
    if (cost > PAUSE) return;
    if (cost > DEAR) {
      this.#restUntil = now + cost;
      this.#cheap = 0;
      if (this.#hurried) this.#draw(this.#ratio * 0.8);
    } else if (cost < CHEAP && ++this.#cheap > CHEAP_FRAMES) {
      this.#cheap = 0;
      this.#draw(this.#ratio * 1.25);
    }
  }

  #draw(ratio) {
    const bounded = Math.min(Math.max(ratio, COARSEST), this.#finest);
    if (bounded === this.#ratio) return;
    this.#ratio = bounded;
    this.#viewer.renderer.setPixelRatio(bounded);
    this.#viewer.set_dirty();
  }
}
