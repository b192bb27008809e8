// Arrow keys and gamepad as two axes in [-1, 1]: forward, and turn with the left positive.

const PERIOD = 20; // ms
const PRESS = PERIOD / 250; // A held key reaches the end of its axis in 250 ms,
const LET_GO = PERIOD / 100; // and is back at the centre in 100 ms.
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
    window.addEventListener("keydown", (event) => this.#key(event, true), { capture: true });
    window.addEventListener("keyup", (event) => this.#key(event, false), { capture: true });
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

  #key(event, down) {
    if (this.#timer === null) return;
    if (event.key === "Escape" && down) this.onEscape();
    // A key that drives, or presses the button that has the focus, must not do what it does elsewhere.
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
      const way = target[axis] - this.#keys[axis];
      const step = target[axis] === 0 ? LET_GO : PRESS;
      this.#keys[axis] += Math.sign(way) * Math.min(Math.abs(way), step);
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

// Two digits: the last ones of a gamepad at rest never stand still.
function clamp(value) {
  return Math.round(100 * Math.min(Math.max(value, -1), 1)) / 100;
}
