// Floor with grid and soft shadows, start, goal and scale. Drawn once for a task and a theme.

const { THREE } = window.MeshCat;

const FINE = 4096; // Pixels of the longer side of the floor's texture with a graphics card,
const COARSE = [900, 3000]; // and at least and at most without one, where it has those of the screen.
const MARGIN = 0.12; // of the texture around the floor, as a share of its longer side, for the floor's shadow

// The texture holds the colours of the screen, which need no conversion: this is the cheapest way to draw it.
const SHADER = {
  vertexShader: `varying vec2 at;
    void main() { at = uv; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
  fragmentShader: `uniform sampler2D map; varying vec2 at;
    void main() { gl_FragColor = texture2D(map, at); }`,
};

// Fills the ground plan of an obstacle; moves the context's origin to it.
export function fillObstacle(context, { x, y, yaw = 0, radius, length, width }) {
  context.translate(x, y);
  context.rotate(yaw);
  context.beginPath();
  if (radius !== undefined) context.arc(0, 0, radius, 0, 2 * Math.PI);
  else context.rect(-length / 2, -width / 2, length, width);
  context.fill();
}

export class Floor {
  group = new THREE.Group();
  #theme;
  #task = null;
  #mesh = null;
  #renderer;
  #software;

  // software: whether the renderer has no graphics card.
  constructor(parent, theme, renderer, software) {
    this.#theme = theme;
    this.#renderer = renderer;
    this.#software = software;
    parent.add(this.group);
    theme.onChange(() => this.#draw());
  }

  setTask(task) {
    this.#task = task;
    this.#draw();
  }

  #draw() {
    if (!this.#task) return;
    this.#mesh?.removeFromParent();
    this.#mesh?.geometry.dispose();
    this.#mesh?.material.uniforms.map.value.dispose();
    this.#mesh?.material.dispose();
    const { width, depth } = this.#task;
    const margin = MARGIN * Math.max(width, depth);
    const [fullWidth, fullDepth] = [width + 2 * margin, depth + 2 * margin];
    const scale = this.#pixels() / Math.max(fullWidth, fullDepth);
    const canvas = document.createElement("canvas");
    canvas.width = Math.round(fullWidth * scale);
    canvas.height = Math.round(fullDepth * scale);
    const context = canvas.getContext("2d");
    context.fillStyle = this.#theme.css("ground");
    context.fillRect(0, 0, canvas.width, canvas.height);
    // From here on lengths are in m about the workspace's middle, y up.
    context.setTransform(scale, 0, 0, -scale, canvas.width / 2, canvas.height / 2);
    this.#paint(context, scale);
    const texture = new THREE.CanvasTexture(canvas);
    if (this.#software) {
      texture.generateMipmaps = false;
      texture.minFilter = THREE.LinearFilter;
    } else texture.anisotropy = 8;
    const material = new THREE.ShaderMaterial({ ...SHADER, uniforms: { map: { value: texture } } });
    this.#mesh = new THREE.Mesh(new THREE.PlaneGeometry(fullWidth, fullDepth), material);
    this.group.add(this.#mesh);
  }

  #pixels() {
    if (!this.#software) return FINE;
    const { width, height } = this.#renderer.domElement;
    return Math.min(Math.max(1.1 * Math.max(width, height), COARSE[0]), COARSE[1]);
  }

  #paint(context, scale) {
    const { width, depth, unit } = this.#task;
    const css = (name) => this.#theme.css(name);
    const [left, bottom] = [-width / 2, -depth / 2];
    // The floor is a plate that lies on the ground: it casts a shadow around itself.
    context.save();
    context.shadowColor = css("shadow");
    context.shadowBlur = 0.16 * unit * scale;
    context.shadowOffsetX = 0.03 * unit * scale;
    context.shadowOffsetY = 0.05 * unit * scale;
    context.fillStyle = css("floor");
    context.fillRect(left, bottom, width, depth);
    context.restore();
    const light = context.createRadialGradient(-0.15 * width, 0.3 * depth, 0, 0, 0, 0.75 * Math.max(width, depth));
    light.addColorStop(0, css("floor-light"));
    light.addColorStop(1, css("floor"));
    context.fillStyle = light;
    context.fillRect(left, bottom, width, depth);
    this.#paintGrid(context, scale);
    context.save();
    context.beginPath();
    context.rect(left, bottom, width, depth);
    context.clip();
    for (const obstacle of this.#task.obstacles) this.#paintShadow(context, scale, obstacle);
    context.restore();
    context.strokeStyle = css("edge");
    context.lineWidth = 0.018 * unit;
    context.strokeRect(left, bottom, width, depth);
    this.#paintEnds(context);
    this.#paintScale(context);
  }

  #paintGrid(context, scale) {
    const { width, depth, unit, step, middle } = this.#task;
    context.strokeStyle = this.#theme.css("grid");
    context.lineWidth = Math.max(1.4 / scale, 0.006 * unit);
    context.beginPath();
    const lines = (from, to, draw) => {
      for (let i = Math.ceil(from / step); i * step < to; i++) draw(i * step);
    };
    lines(middle[0] - width / 2, middle[0] + width / 2, (x) => {
      context.moveTo(x - middle[0], -depth / 2);
      context.lineTo(x - middle[0], depth / 2);
    });
    lines(middle[1] - depth / 2, middle[1] + depth / 2, (y) => {
      context.moveTo(-width / 2, y - middle[1]);
      context.lineTo(width / 2, y - middle[1]);
    });
    context.stroke();
  }

  #paintShadow(context, scale, obstacle) {
    const { unit } = this.#task;
    context.save();
    context.shadowColor = this.#theme.css("shadow");
    context.shadowBlur = 0.14 * unit * scale;
    context.shadowOffsetX = 0.07 * unit * scale;
    context.shadowOffsetY = 0.09 * unit * scale;
    context.fillStyle = this.#theme.css("obstacle");
    fillObstacle(context, obstacle);
    context.restore();
  }

  #paintEnds(context) {
    const { start, goals, unit } = this.#task;
    const ring = (x, y, radius, width, color, alpha) => {
      context.globalAlpha = alpha;
      context.strokeStyle = color;
      context.lineWidth = width;
      context.beginPath();
      context.arc(x, y, radius - width / 2, 0, 2 * Math.PI);
      context.stroke();
      context.globalAlpha = 1;
    };
    const green = this.#theme.css("goal");
    for (const { x, y, radius } of goals) {
      context.globalAlpha = 0.28;
      context.fillStyle = green;
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fill();
      ring(x, y, radius, 0.16 * radius, green, 1);
      ring(x, y, 0.58 * radius, 0.14 * radius, green, 1);
      ring(x, y, 0.2 * radius, 0.2 * radius, green, 1);
    }
    const [sx, sy, yaw] = start;
    const purple = this.#theme.css("start");
    ring(sx, sy, 0.1 * unit, 0.025 * unit, purple, 1);
    context.fillStyle = purple;
    context.save();
    context.translate(sx, sy);
    context.rotate(yaw);
    context.beginPath();
    context.moveTo(0.06 * unit, 0);
    context.lineTo(-0.035 * unit, 0.045 * unit);
    context.lineTo(-0.035 * unit, -0.045 * unit);
    context.fill();
    context.restore();
  }

  #paintScale(context) {
    const { scaleBar, unit } = this.#task;
    const [x, y] = scaleBar.at;
    context.strokeStyle = this.#theme.css("ink");
    context.lineWidth = 0.02 * unit;
    context.beginPath();
    context.moveTo(x, y + 0.05 * unit);
    context.lineTo(x, y);
    context.lineTo(x + scaleBar.length, y);
    context.lineTo(x + scaleBar.length, y + 0.05 * unit);
    context.stroke();
  }
}
