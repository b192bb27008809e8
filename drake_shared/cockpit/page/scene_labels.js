// Words in the scene, which Meshcat cannot draw: elements above the canvas, at projected points.

const { THREE } = window.MeshCat;

const GAP = 7; // px between a point and its label, and between labels
// Where a label may lie, as offsets of its middle from its point in units of its size and the gap.
const PLACES = [[0, -1], [0, 1], [1, 0], [-1, 0], [1, -1], [-1, -1], [1, 1], [-1, 1], [0, -2], [0, 2]];
const BESIDE = [[-1, 0], [1, 0]]; // a line that is upright on the screen

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

  // labels: [{kind, at: [x, y], text}], the most important first; `along` is the direction of the line that one
  // belongs to. One that finds no room is left out.
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

  // In px from the upper left corner; null where the camera does not see it.
  #project([x, y]) {
    const point = this.#group.localToWorld(this.#point.set(x, y, 0)).project(this.#viewer.camera);
    if (Math.abs(point.x) > 1 || Math.abs(point.y) > 1 || point.z > 1) return null;
    return [((point.x + 1) / 2) * this.#element.offsetWidth, ((1 - point.y) / 2) * this.#element.offsetHeight];
  }

  #places(at, [px, py], centered, along) {
    const end = along && this.#project([at[0] + along[0] / 2, at[1] + along[1] / 2]);
    if (end && Math.abs(end[1] - py) > Math.abs(end[0] - px)) return BESIDE;
    return centered ? [[0, 0], ...PLACES] : PLACES;
  }

  #place({ at, centered, along }, [w, h], width, height, taken) {
    const point = this.#project(at);
    if (point === null) return null;
    const [px, py] = point;
    for (const [dx, dy] of this.#places(at, point, centered, along)) {
      const left = Math.min(Math.max(px + dx * (w / 2 + GAP) - w / 2, 4), width - w - 4);
      const top = Math.min(Math.max(py + dy * (h / 2 + GAP) - h / 2, 4), height - h - 4);
      const box = { left, top, right: left + w, bottom: top + h };
      if (!taken.some((other) => overlap(box, other))) return box;
    }
    return null;
  }
}

const overlap = (a, b) => a.left < b.right + 3 && b.left < a.right + 3 && a.top < b.bottom + 2 && b.top < a.bottom + 2;
