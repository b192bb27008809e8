// Counts the displacement of the captured mouse: x to the right, y down the screen, from 0 at each capture.

const SEND_AT_MOST_EVERY = 4; // ms; gaming mice report up to 8000 times a second.
const RELOCK_AFTER = 1400; // ms; Chromium refuses a lock for a while after Escape.

export class Mouse {
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
    // Raw updates arrive at once, the others once a frame; raw ones need a secure context.
    const raw = window.isSecureContext && "onpointerrawupdate" in window;
    window.addEventListener(raw ? "pointerrawupdate" : "pointermove", (event) => this.#onPointerMove(event));
    document.addEventListener("pointerlockchange", () => this.#onLockChange());
  }

  // Captures the mouse: with the pointer lock if the browser grants it, else while it is over the page.
  async capture() {
    this.x = this.y = 0;
    this.#element.hidden = false;
    const canLock = "requestPointerLock" in this.#element;
    this.#locked = (await this.#lock({ unadjustedMovement: true })) || (await this.#lock());
    if (!this.#locked && canLock) {
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

  // Requests the pointer lock. Returns whether it was granted.
  async #lock(options) {
    try {
      const promise = this.#element.requestPointerLock(options);
      // Older browsers return no promise, and send events instead; with a promise, events come later.
      await (promise ?? nextEvent(document, ["pointerlockchange", "pointerlockerror"]));
    } catch {
      return false;
    }
    return document.pointerLockElement === this.#element;
  }

  #onLockChange() {
    if (this.#captured && this.#locked && document.pointerLockElement !== this.#element) this.onRelease();
  }

  #onPointerMove(event) {
    if (!this.#captured || !(event.movementX || event.movementY)) return;
    this.x += event.movementX;
    this.y += event.movementY;
    const wait = this.#last + SEND_AT_MOST_EVERY - performance.now();
    if (wait <= 0) this.#notify();
    else this.#timer ??= setTimeout(() => this.#notify(), wait);
  }

  #notify() {
    clearTimeout(this.#timer);
    this.#timer = null;
    this.#last = performance.now();
    this.onMove();
  }
}

function nextEvent(target, events) {
  return new Promise((resolve) => {
    for (const event of events) target.addEventListener(event, resolve, { once: true });
  });
}
