// Words in the scene, which Meshcat cannot draw: elements above the canvas, at projected points.

const { THREE } = window.MeshCat;

const GAP = 7; // px between a point and its label, and between labels
// Where a label may lie, as offsets of its middle from its point in units of its size and the gap.
const PLACES = [[0, -1], [0, 1], [1, 0], [-1, 0], [1, -1], [-1, -1], [1, 1], [-1, 1], [0, -2], [0, 2]];

export class Labels {
  #element = document.createElement("div");
  #group;
  #viewer;
  #pool = [];
  #sizes = new Map();
  #point = new THREE.Vector3();

  constructor(overlay, group, viewer) {
    this.#element.className = "scene-labels";
    this.#element.setAttribute("aria-hidden", "true"); // The panel says the same in words.
    this.#group = group;
    this.#viewer = viewer;
    overlay.append(this.#element);
  }

  // labels: [{kind, at: [x, y], text}], the most important first. One that finds no room is left out.
  // bottom: px at the lower edge that are taken by something else.
  show(labels, bottom) {
    const width = this.#element.offsetWidth;
    const height = this.#element.offsetHeight - bottom;
    const taken = [];
    labels.forEach((label, i) => {
      const element = (this.#pool[i] ??= this.#element.appendChild(document.createElement("span")));
      if (element.textContent !== label.text) element.textContent = label.text;
      if (element.dataset.kind !== label.kind) element.dataset.kind = label.kind;
      const box = this.#place(label, this.#size(element, label), width, height, taken);
      element.hidden = box === null;
      if (box === null) return;
      taken.push(box);
      element.style.transform = `translate(${Math.round(box.left)}px, ${Math.round(box.top)}px)`;
    });
    for (const element of this.#pool.slice(labels.length)) element.hidden = true;
  }

  #size(element, { kind, text }) {
    const key = `${kind} ${text}`;
    if (!this.#sizes.has(key)) {
      element.hidden = false;
      if (this.#sizes.size > 500) this.#sizes.clear();
      this.#sizes.set(key, [element.offsetWidth, element.offsetHeight]);
    }
    return this.#sizes.get(key);
  }

  #place({ at, centered }, [w, h], width, height, taken) {
    this.#point.set(at[0], at[1], 0);
    this.#group.localToWorld(this.#point).project(this.#viewer.camera);
    const { x, y, z } = this.#point;
    if (Math.abs(x) > 1 || Math.abs(y) > 1 || z > 1) return null;
    const px = ((x + 1) / 2) * width;
    const py = ((1 - y) / 2) * this.#element.offsetHeight;
    for (const [dx, dy] of centered ? [[0, 0], ...PLACES] : PLACES) {
      const left = Math.min(Math.max(px + dx * (w / 2 + GAP) - w / 2, 4), width - w - 4);
      const top = Math.min(Math.max(py + dy * (h / 2 + GAP) - h / 2, 4), height - h - 4);
      const box = { left, top, right: left + w, bottom: top + h };
      if (!taken.some((other) => overlap(box, other))) return box;
    }
    return null;
  }
}

const overlap = (a, b) => a.left < b.right + 3 && b.left < a.right + 3 && a.top < b.bottom + 2 && b.top < a.bottom + 2;
