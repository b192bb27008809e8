// The keys that drive, by their position on the keyboard: arrows, WASD and the numeric keypad; E and Q lift and
// lower the tip of an arm.

const KEYS = {
  ArrowUp: ["forward", 1],
  KeyW: ["forward", 1],
  Numpad8: ["forward", 1],
  ArrowDown: ["forward", -1],
  KeyS: ["forward", -1],
  Numpad2: ["forward", -1],
  ArrowLeft: ["turn", 1],
  KeyA: ["turn", 1],
  Numpad4: ["turn", 1],
  ArrowRight: ["turn", -1],
  KeyD: ["turn", -1],
  Numpad6: ["turn", -1],
  KeyE: ["up", 1],
  PageUp: ["up", 1],
  KeyQ: ["up", -1],
  PageDown: ["up", -1],
};
const META = ["MetaLeft", "MetaRight", "OSLeft", "OSRight"];

// Holds the keys that are down. Some releases are never reported: macOS reports none while Cmd is held, and
// a window that loses the keyboard sees none at all. Then all keys are let go.
export class Keys {
  onChange = () => {};
  onLetGo = () => {};
  onEscape = () => {};
  onKey = () => {};
  #held = new Set();
  #listening = false;

  constructor() {
    window.addEventListener("keydown", (event) => this.#onDown(event), { capture: true });
    window.addEventListener("keyup", (event) => this.#onUp(event), { capture: true });
    window.addEventListener("blur", () => this.letGo());
    document.addEventListener("visibilitychange", () => this.letGo());
  }

  listen(listening) {
    this.#listening = listening;
    this.letGo();
  }

  letGo() {
    this.#held.clear();
    this.onLetGo();
  }

  // Direction of an axis: -1, 0 or 1.
  direction(axis) {
    let sum = 0;
    for (const code of this.#held) if (KEYS[code][0] === axis) sum += KEYS[code][1];
    return Math.sign(sum);
  }

  #onDown(event) {
    if (!this.#listening) return;
    const code = codeOf(event);
    if (event.key === "Escape") this.onEscape();
    if (META.includes(code) || event.metaKey) return this.letGo();
    // While driving, these keys must neither scroll nor press the button that has the focus.
    if (code in KEYS || ["Space", "Enter"].includes(code)) event.preventDefault();
    if (event.ctrlKey || event.altKey) return;
    if (!(code in KEYS)) {
      if (!event.repeat) this.onKey(code);
      return;
    }
    this.#held.add(code);
    if (!event.repeat) this.onChange();
  }

  #onUp(event) {
    if (!this.#listening) return;
    const code = codeOf(event);
    // The release of a key without a position cannot be told from that of a held one.
    if (META.includes(code) || !event.code) return this.letGo();
    if (this.#held.delete(code)) this.onChange();
  }
}

// Remote desktops and virtual keyboards may report no position.
function codeOf(event) {
  return event.code || (event.key === " " ? "Space" : event.key);
}
