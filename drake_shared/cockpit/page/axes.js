// Combines arrow keys and gamepad into two axes in [-1, 1]: forward, and turn (positive to the left).

const PERIOD = 20; // ms
const PRESS_STEP = PERIOD / 250; // A held key takes 250 ms to full deflection,
const RELEASE_STEP = PERIOD / 100; // a released one 100 ms back to the centre.
const KEYS = {
  ArrowUp: ["forward", 1],
  ArrowDown: ["forward", -1],
  ArrowLeft: ["turn", 1],
  ArrowRight: ["turn", -1],
};

export class Axes {
  forward = 0;
  turn = 0;
  onChange = () => {};
  onEscape = () => {};
  #held = new Set();
  #keys = { forward: 0, turn: 0 };
  #timer = null;

  constructor() {
    window.addEventListener("keydown", (event) => this.#onKey(event, true), { capture: true });
    window.addEventListener("keyup", (event) => this.#onKey(event, false), { capture: true });
  }

  start() {
    this.#timer ??= setInterval(() => this.#update(), PERIOD);
  }

  stop() {
    clearInterval(this.#timer);
    this.#timer = null;
    this.#held.clear();
    this.#keys = { forward: 0, turn: 0 };
    this.forward = this.turn = 0;
  }

  #onKey(event, down) {
    if (this.#timer === null) return;
    if (event.key === "Escape" && down) this.onEscape();
    // While driving, these keys must neither scroll nor press the button that has the focus.
    if (event.key in KEYS || event.key === " " || event.key === "Enter") event.preventDefault();
    if (!(event.key in KEYS)) return;
    if (down) this.#held.add(event.key);
    else this.#held.delete(event.key);
    if (!event.repeat) this.#update();
  }

  #update() {
    const before = [this.forward, this.turn];
    const target = { forward: 0, turn: 0 };
    for (const key of this.#held) target[KEYS[key][0]] += KEYS[key][1];
    for (const axis of ["forward", "turn"]) {
      const difference = target[axis] - this.#keys[axis];
      const step = target[axis] === 0 ? RELEASE_STEP : PRESS_STEP;
      this.#keys[axis] += Math.sign(difference) * Math.min(Math.abs(difference), step);
    }
    const gamepad = firstGamepad();
    this.forward = clamp(this.#keys.forward - (gamepad?.axes[1] ?? 0));
    this.turn = clamp(this.#keys.turn - (gamepad?.axes[0] ?? 0));
    if (this.forward !== before[0] || this.turn !== before[1]) this.onChange();
  }
}

function firstGamepad() {
  const gamepads = navigator.getGamepads?.() ?? [];
  return [...gamepads].find((gamepad) => gamepad?.connected && gamepad.axes.length >= 2);
}

// Rounded to two digits, since a gamepad at rest is noisy.
function clamp(value) {
  return Math.round(100 * Math.min(Math.max(value, -1), 1)) / 100;
}
