// The third axis of an arm's tip: the wheel and keys lift it, and a click switches between the planes x-y and y-z,
// in the second of which the stick moves the tip up and sideways.

const NOTCH = 0.1; // Deflection of one step of the wheel; an axis goes from -1 to 1.

export class Lift {
  wheel = 0;
  vertical = false;
  switches = 0;
  onChange = () => {};
  #active = false;
  #sent = { up: 0, vertical: false }; // What the server assumes of a driver who has just engaged.

  constructor(element) {
    window.addEventListener("wheel", (event) => this.#onWheel(event), { capture: true, passive: false });
    element.addEventListener("pointerdown", () => this.#active && this.switch());
  }

  start() {
    this.#active = true;
    this.wheel = 0;
    this.vertical = false;
    this.switches = 0;
    this.#sent = { up: 0, vertical: false };
  }

  stop() {
    this.#active = false;
    this.wheel = 0;
  }

  recentre() {
    this.wheel = 0;
  }

  switch() {
    this.vertical = !this.vertical;
    this.switches += 1;
    this.onChange();
  }

  // Calls send with a message if the axis or the plane has changed. keys: the deflection that keys give.
  send(keys, send) {
    const up = Math.round(100 * Math.min(Math.max(this.wheel + keys, -1), 1)) / 100 + 0;
    if (up === this.#sent.up && this.vertical === this.#sent.vertical) return;
    this.#sent = { up, vertical: this.vertical };
    send({ type: "lift", ...this.#sent });
  }

  describe() {
    const plane = this.vertical ? "up and sideways (y-z)" : "forward and sideways (x-y), wheel or E and Q: up";
    return `Stick: ${plane}. Click switches; ${this.switches} so far.`;
  }

  #onWheel(event) {
    if (!this.#active) return;
    event.preventDefault();
    event.stopPropagation();
    this.wheel = Math.min(Math.max(this.wheel - Math.sign(event.deltaY) * NOTCH, -1), 1);
    this.onChange();
  }
}
