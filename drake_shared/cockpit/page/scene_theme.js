// Light or dark, and the colours of the scene, which scene.css holds.

const { THREE } = window.MeshCat;
const KEY = "drake-shared-theme";
const NAMES = ["floor", "grid", "edge", "ground", "obstacle", "human", "agent", "shared", "start", "goal", "contact"];

export class Theme {
  colors = {};
  #listeners = [];

  constructor() {
    const system = window.matchMedia("(prefers-color-scheme: dark)");
    this.#set(this.#stored() ?? (system.matches ? "dark" : "light"));
    system.addEventListener("change", () => {
      if (this.#stored() === null) this.#set(system.matches ? "dark" : "light");
    });
  }

  get name() {
    return document.documentElement.dataset.theme;
  }

  // Calls the listener at once, and again whenever the colours change.
  onChange(listener) {
    this.#listeners.push(listener);
    listener();
  }

  toggle() {
    const name = this.name === "dark" ? "light" : "dark";
    try {
      localStorage.setItem(KEY, name);
    } catch {
      // A page without storage forgets the choice.
    }
    this.#set(name);
  }

  css(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(`--scene-${name}`).trim();
  }

  #stored() {
    try {
      return localStorage.getItem(KEY);
    } catch {
      return null;
    }
  }

  #set(name) {
    document.documentElement.dataset.theme = name;
    for (const color of NAMES) this.colors[color] = new THREE.Color(this.css(color));
    for (const listener of this.#listeners) listener();
  }
}
