// Flat strips on the ground, whose points move, widen, fade and change colour. All strips of one ink are one
// mesh and one draw call; what is added later lies above.

const { THREE } = window.MeshCat;

export class Ink {
  #mesh;
  #position;
  #color;
  #index;
  #capacity;
  #points = 0;
  #quads = 0;

  // capacity: largest number of points of all strips together; order: inks with a higher one lie above;
  // depthTest: whether what stands on the floor hides it.
  constructor(parent, { capacity, order, depthTest = true }) {
    const geometry = new THREE.BufferGeometry();
    this.#capacity = capacity;
    this.#position = new THREE.BufferAttribute(new Float32Array(6 * capacity), 3);
    this.#color = new THREE.BufferAttribute(new Float32Array(8 * capacity), 4);
    this.#index = new THREE.BufferAttribute(new Uint16Array(6 * capacity), 1);
    geometry.setAttribute("position", this.#position);
    geometry.setAttribute("color", this.#color);
    geometry.setIndex(this.#index);
    const material = new THREE.MeshBasicMaterial({
      depthTest,
      depthWrite: false,
      side: THREE.DoubleSide,
      toneMapped: false,
      transparent: true,
      vertexColors: true,
    });
    this.#mesh = new THREE.Mesh(geometry, material);
    this.#mesh.frustumCulled = false; // Its bounds change with every update.
    this.#mesh.renderOrder = order;
    parent.add(this.#mesh);
  }

  get mesh() {
    return this.#mesh;
  }

  get isOnTop() {
    return !this.#mesh.material.depthTest;
  }

  clear() {
    this.#points = 0;
    this.#quads = 0;
  }

  // Adds a strip. points: [[x, y], ...]; halfWidth, alpha and color (a THREE.Color): a value, or a function of
  // the point's index; height: of the strip above the floor.
  strip(points, style) {
    const halfWidth = functionOf(style.halfWidth);
    const alpha = functionOf(style.alpha);
    const color = functionOf(style.color);
    const count = Math.min(points.length, this.#capacity - this.#points);
    let normal = [0, 1];
    for (let i = 0; i < count; i++) {
      const [ax, ay] = points[Math.max(i - 1, 0)];
      const [bx, by] = points[Math.min(i + 1, count - 1)];
      const length = Math.hypot(bx - ax, by - ay);
      if (length > 1e-9) normal = [(ay - by) / length, (bx - ax) / length];
      this.#put(points[i], normal, halfWidth(i), style.height ?? 0, color(i), alpha(i), i > 0);
    }
  }

  // Adds a disc, or a ring if `inner` is above 0, as a strip around its middle.
  ring([x, y], { inner, outer, sides = 28, ...style }) {
    const radius = (inner + outer) / 2;
    const points = Array.from({ length: sides + 1 }, (_, i) => {
      const angle = (2 * Math.PI * i) / sides;
      return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
    });
    this.strip(points, { ...style, halfWidth: (outer - inner) / 2 });
  }

  finish() {
    for (const attribute of [this.#position, this.#color, this.#index]) attribute.needsUpdate = true;
    this.#mesh.geometry.setDrawRange(0, 6 * this.#quads);
  }

  // Draws all strips on a 2-D canvas whose coordinates are those of the floor.
  paint(context) {
    const [position, color, index] = [this.#position.array, this.#color.array, this.#index.array];
    const look = (vertex) => color.subarray(4 * vertex, 4 * vertex + 4);
    let from = 0;
    while (from < this.#quads) {
      // Neighbours of one look are one shape: between two, the edges would show.
      const first = index[6 * from];
      let to = from + 1;
      while (to < this.#quads && index[6 * to] === first + 2 * (to - from) && alike(look(first), look(index[6 * to]))) to++;
      const opaque = color[4 * first + 3] > 0.7;
      const joined = from > 0 && index[6 * (from - 1)] === first - 2;
      const begin = opaque && joined ? first - 2 : first; // An overlap hides the edge.
      const last = index[6 * (to - 1)] + 2;
      context.beginPath();
      for (let v = begin; v <= last; v += 2) context.lineTo(position[3 * v], position[3 * v + 1]);
      for (let v = last + 1; v > begin; v -= 2) context.lineTo(position[3 * v], position[3 * v + 1]);
      const [r, g, b, alpha] = look(first);
      context.globalAlpha = alpha;
      context.fillStyle = MIXED.setRGB(r, g, b).getStyle();
      context.fill();
      from = to;
    }
    context.globalAlpha = 1;
  }

  #put([x, y], [nx, ny], width, z, { r, g, b }, alpha, joined) {
    const at = this.#points++;
    const side = [width * nx, width * ny];
    this.#position.array.set([x + side[0], y + side[1], z, x - side[0], y - side[1], z], 6 * at);
    this.#color.array.set([r, g, b, alpha, r, g, b, alpha], 8 * at);
    if (!joined) return;
    const first = 2 * (at - 1);
    this.#index.array.set([first, first + 1, first + 2, first + 1, first + 3, first + 2], 6 * this.#quads++);
  }
}

const MIXED = new THREE.Color();
const alike = (a, b) => a.every((value, i) => Math.abs(value - b[i]) < 0.03);
const functionOf = (value) => (typeof value === "function" ? value : () => value);

// The point of a polyline at an index with a fraction, and the direction there, of length 1.
export function along(points, index) {
  const before = Math.max(Math.min(Math.floor(index), points.length - 2), 0);
  const share = index - before;
  const [[ax, ay], [bx, by]] = [points[before], points[before + 1]];
  const length = Math.hypot(bx - ax, by - ay) || 1;
  return { at: [ax + share * (bx - ax), ay + share * (by - ay)], direction: [(bx - ax) / length, (by - ay) / length] };
}

// A polyline with `times` as many pieces, on Catmull-Rom curves through its points.
export function smooth(points, times) {
  const last = points.length - 1;
  const finer = [];
  for (let i = 0; i < last; i++) {
    const [a, b, c, d] = [Math.max(i - 1, 0), i, i + 1, Math.min(i + 2, last)].map((j) => points[j]);
    for (let k = 0; k < times; k++) {
      const t = k / times;
      finer.push([0, 1].map((axis) => {
        const slope = c[axis] - a[axis];
        const next = d[axis] - b[axis];
        const step = c[axis] - b[axis];
        return b[axis] + 0.5 * t * (slope + t * (6 * step - 2 * slope - next + t * (slope + next - 4 * step)));
      }));
    }
  }
  return [...finer, points[last]];
}
