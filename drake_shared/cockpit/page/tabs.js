// The panels that show while nobody drives, one at a time.

export class Tabs {
  onShow = () => {};
  #buttons = new Map();
  #shown = null;

  constructor(list, panels) {
    for (const panel of panels) {
      const button = document.createElement("button");
      button.type = "button";
      button.id = panel.id.replace("panel-", "tab-");
      button.textContent = panel.dataset.title;
      button.setAttribute("role", "tab");
      button.setAttribute("aria-controls", panel.id);
      panel.setAttribute("aria-labelledby", button.id);
      button.addEventListener("click", () => this.show(panel.id));
      button.addEventListener("keydown", (event) => this.#onKey(event));
      list.append(button);
      this.#buttons.set(panel.id, { button, panel });
    }
  }

  get shown() {
    return this.#shown;
  }

  setAvailable(id, available) {
    this.#buttons.get(id).button.hidden = !available;
    if (!available && this.#shown === id) this.#shown = null;
    this.#update();
  }

  show(id) {
    this.#shown = id;
    this.#update();
    this.onShow(id);
  }

  #update() {
    const available = [...this.#buttons].filter(([, { button }]) => !button.hidden);
    if (!available.some(([id]) => id === this.#shown)) this.#shown = available[0]?.[0] ?? null;
    for (const [id, { button, panel }] of this.#buttons) {
      const selected = id === this.#shown;
      button.setAttribute("aria-selected", String(selected));
      button.tabIndex = selected ? 0 : -1;
      panel.hidden = !selected;
    }
  }

  #onKey(event) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const available = [...this.#buttons.values()].filter(({ button }) => !button.hidden);
    const index = available.findIndex(({ button }) => button === event.target);
    const next = available[(index + step + available.length) % available.length];
    this.show(next.panel.id);
    next.button.focus();
  }
}
