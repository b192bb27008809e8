// A stick for a finger: it springs back when the finger leaves it, and the robot stops.

const REACH = 0.38; // Of the pad's width: displacement of the finger at full deflection.

export class TouchStick {
  forward = 0;
  turn = 0;
  onChange = () => {};
  // Called with false when the finger touches the stick, and with true when it leaves.
  onLift = () => {};
  #pad;
  #pointer = null;
  #box = null; // Of the pad when the finger touched it: a longer line of text above it may move the pad later.

  constructor(pad) {
    this.#pad = pad;
    pad.addEventListener("pointerdown", (event) => this.#onDown(event));
    pad.addEventListener("pointermove", (event) => this.#onMove(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      pad.addEventListener(end, (event) => event.pointerId === this.#pointer && this.letGo());
    }
  }

  show(shown) {
    this.#pad.hidden = !shown;
    if (!shown) this.letGo();
  }

  letGo() {
    const held = this.#pointer !== null;
    this.#pointer = null;
    this.#set(0, 0);
    if (held) this.onLift(true);
  }

  #onDown(event) {
    if (this.#pointer !== null) return;
    event.preventDefault();
    this.#pad.setPointerCapture(event.pointerId);
    this.#pointer = event.pointerId;
    this.#box = this.#pad.getBoundingClientRect();
    this.onLift(false);
    this.#onMove(event);
  }

  #onMove(event) {
    if (event.pointerId !== this.#pointer) return;
    const box = this.#box;
    const right = (event.clientX - box.left - box.width / 2) / (REACH * box.width);
    const down = (event.clientY - box.top - box.height / 2) / (REACH * box.height);
    const length = Math.max(Math.hypot(right, down), 1);
    this.#set(-down / length, -right / length);
  }

  #set(forward, turn) {
    this.forward = forward;
    this.turn = turn;
    this.#pad.style.setProperty("--x", -turn);
    this.#pad.style.setProperty("--y", -forward);
    this.onChange();
  }
}
