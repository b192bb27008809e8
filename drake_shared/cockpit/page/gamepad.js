// Reads one driver's gamepad among all devices that the browser lists, some of which are not gamepads.

const DEAD_ZONE = 0.15; // Sticks at rest are noisy and not quite centred.
const FARTHEST_REST = 0.2; // A stick rests nearer to its centre than this; triggers and pedals do not.
const JITTER = 0.1; // Largest change of an axis at rest.
const REST_READS = 10; // Readings in a row that make a rest position.
const STUCK_READS = 50; // Readings in a row away from the centre after which an axis is not a stick.
const PAD = { up: 12, down: 13, left: 14, right: 15 }; // Buttons of the standard mapping.

// One axis. It reads 0 until its rest position is known: what it shows at first may be a pedal that nobody
// touches, or a stick that somebody holds.
class Axis {
  #rest = null;
  #low = Infinity;
  #high = -Infinity;
  #reads = 0;
  #isStick = true;
  #mayBeOther;

  constructor(mayBeOther) {
    this.#mayBeOther = mayBeOther;
  }

  read(value) {
    if (!this.#isStick || !Number.isFinite(value)) return 0;
    if (this.#rest === null) this.#learnRest(value);
    if (this.#rest === null) return 0;
    const moved = value - this.#rest;
    const range = 1 - Math.sign(moved) * this.#rest;
    return Math.sign(moved) * Math.max((Math.abs(moved) - DEAD_ZONE) / (range - DEAD_ZONE), 0);
  }

  #learnRest(value) {
    this.#low = Math.min(this.#low, value);
    this.#high = Math.max(this.#high, value);
    this.#reads += 1;
    if (this.#high - this.#low > JITTER) {
      this.#low = this.#high = value;
      this.#reads = 1;
    }
    const middle = (this.#low + this.#high) / 2;
    if (Math.abs(middle) <= FARTHEST_REST) {
      if (this.#reads >= REST_READS) this.#rest = middle;
    } else if (this.#mayBeOther && this.#reads >= STUCK_READS) this.#isStick = false;
  }
}

export class Gamepads {
  #axes = new Map(); // By index of the gamepad.

  constructor() {
    window.addEventListener("gamepaddisconnected", (event) => this.#axes.delete(event.gamepad.index));
  }

  // Deflections forward and to the left, in [-1, 1]; 0 within the dead zone. Gamepads of the standard mapping
  // go before others; among several the one that is deflected furthest counts.
  read() {
    const connected = [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.connected && pad.axes.length >= 2);
    const standard = connected.filter((pad) => pad.mapping === "standard");
    let chosen = { forward: 0, turn: 0 };
    for (const pad of standard.length ? standard : connected) {
      const read = this.#readPad(pad);
      if (Math.hypot(read.forward, read.turn) > Math.hypot(chosen.forward, chosen.turn)) chosen = read;
    }
    return chosen;
  }

  #readPad(pad) {
    const isStandard = pad.mapping === "standard";
    if (this.#axes.get(pad.index)?.id !== pad.id) {
      this.#axes.set(pad.index, { id: pad.id, x: new Axis(!isStandard), y: new Axis(!isStandard) });
    }
    const axes = this.#axes.get(pad.index);
    const pressed = (name) => Number(isStandard && Boolean(pad.buttons?.[PAD[name]]?.pressed));
    return {
      forward: pressed("up") - pressed("down") - axes.y.read(pad.axes[1]),
      turn: pressed("left") - pressed("right") - axes.x.read(pad.axes[0]),
    };
  }
}
