// The mouse, counted while it is captured: x to the right, y down the screen, from 0 at each capture.

const SEND_AT_MOST_EVERY = 4; // ms; gaming mice report up to 8000 times a second.
const RELOCK_AFTER = 1400; // ms; Chromium refuses a lock for a while after Escape.

export class Pad {
  x = 0;
  y = 0;
  onMove = () => {};
  onRelease = () => {};
  #element;
  #captured = false;
  #locked = false;
  #last = 0;
  #timer = null;

  constructor(element) {
    this.#element = element;
    // Raw updates come as they happen, the others once a frame; they need a secure context.
    const raw = window.isSecureContext && "onpointerrawupdate" in window;
    window.addEventListener(raw ? "pointerrawupdate" : "pointermove", (event) => this.#moved(event));
    document.addEventListener("pointerlockchange", () => this.#lockChanged());
  }

  // Takes the mouse: locked if the browser can, else while it moves over the page.
  async capture() {
    this.x = this.y = 0;
    this.#element.hidden = false;
    this.#locked = (await this.#lock({ unadjustedMovement: true })) || (await this.#lock());
    if (!this.#locked) {
      await new Promise((resolve) => setTimeout(resolve, RELOCK_AFTER));
      this.#locked = await this.#lock();
    }
    this.x = this.y = 0;
    this.#captured = true;
  }

  release() {
    this.#captured = false;
    this.#locked = false;
    this.#element.hidden = true;
    if (document.pointerLockElement === this.#element) document.exitPointerLock();
  }

  // Asks for the pointer lock and says whether it was given.
  async #lock(options) {
    try {
      const answer = this.#element.requestPointerLock(options);
      // Where the browser promises nothing, events tell; where it does, they come late and confuse.
      await (answer ?? oneOf(document, ["pointerlockchange", "pointerlockerror"]));
    } catch {
      return false;
    }
    return document.pointerLockElement === this.#element;
  }

  #lockChanged() {
    if (this.#captured && this.#locked && document.pointerLockElement !== this.#element) this.onRelease();
  }

  #moved(event) {
    if (!this.#captured || !(event.movementX || event.movementY)) return;
    this.x += event.movementX;
    this.y += event.movementY;
    const wait = this.#last + SEND_AT_MOST_EVERY - performance.now();
    if (wait <= 0) this.#tell();
    else this.#timer ??= setTimeout(() => this.#tell(), wait);
  }

  #tell() {
    clearTimeout(this.#timer);
    this.#timer = null;
    this.#last = performance.now();
    this.onMove();
  }
}

function oneOf(target, events) {
  return new Promise((resolve) => {
    for (const event of events) target.addEventListener(event, resolve, { once: true });
  });
}
