// Combines keys, gamepad and touch stick into axes in [-1, 1]: forward, turn (positive to the left), and up, by
// keys alone.

import { Gamepads } from "./gamepad.js";
import { Keys } from "./keys.js";

const PERIOD = 20; // ms
const PRESS_STEP = PERIOD / 250; // A held key takes 250 ms to full deflection,
const RELEASE_STEP = PERIOD / 100; // a released one 100 ms back to the centre.

export class Axes {
  forward = 0;
  turn = 0;
  up = 0;
  touch = { forward: 0, turn: 0 };
  onChange = () => {};
  onEscape = () => {};
  onKey = () => {};
  #keys = new Keys();
  #gamepads = new Gamepads();
  #pressed = { forward: 0, turn: 0, up: 0 };
  #timer = null;

  constructor() {
    this.#keys.onChange = () => this.update();
    this.#keys.onLetGo = () => {
      this.#pressed = { forward: 0, turn: 0, up: 0 };
      if (this.#timer !== null) this.update();
    };
    this.#keys.onEscape = () => this.onEscape();
    this.#keys.onKey = (code) => this.onKey(code);
  }

  start() {
    this.#timer ??= setInterval(() => this.update(), PERIOD);
    this.#keys.listen(true);
  }

  stop() {
    clearInterval(this.#timer);
    this.#timer = null;
    this.#keys.listen(false);
    this.touch = { forward: 0, turn: 0 };
    this.forward = this.turn = this.up = 0;
  }

  update() {
    const before = [this.forward, this.turn, this.up];
    const gamepad = this.#gamepads.read();
    for (const axis of ["forward", "turn", "up"]) {
      const target = this.#keys.direction(axis);
      const difference = target - this.#pressed[axis];
      const step = target === 0 ? RELEASE_STEP : PRESS_STEP;
      this.#pressed[axis] += Math.sign(difference) * Math.min(Math.abs(difference), step);
      this[axis] = rounded(this.#pressed[axis] + (gamepad[axis] ?? 0) + (this.touch[axis] ?? 0));
    }
    if ([this.forward, this.turn, this.up].some((value, i) => value !== before[i])) this.onChange();
  }
}

// To two digits and from -1 to 1. Adding 0 turns -0 into 0.
function rounded(value) {
  return Math.round(100 * Math.min(Math.max(value, -1), 1)) / 100 + 0;
}
