// What the server says of a task, in lengths about the middle of the workspace: single precision falls apart
// far from the origin.

const REFERENCE_RADIUS = 0.267; // m, of the robot for which sizes are chosen

export function localTask(message) {
  const [left, right, bottom, top] = message.workspace;
  const middle = [(left + right) / 2, (bottom + top) / 2];
  const [width, depth] = [right - left, top - bottom];
  const unit = message.robot_radius / REFERENCE_RADIUS;
  const move = ([x, y]) => [x - middle[0], y - middle[1]];
  const length = roundLength(0.2 * width);
  const margin = 0.12 * unit;
  return {
    middle,
    width,
    depth,
    unit,
    move,
    step: roundLength(Math.max(0.5 * unit, Math.max(width, depth) / 40)),
    start: [...move(message.start), message.start[2]],
    goals: message.goals.map((goal) => {
      const [x, y] = move([goal.x, goal.y]);
      return { ...goal, x, y };
    }),
    // Those that stand still; Meshcat moves the others.
    isStill: !message.obstacles.some((item) => item.path?.length),
    obstacles: message.obstacles
      .filter((item) => !item.path?.length)
      .map((item) => {
        const [x, y] = move([item.x, item.y]);
        return { ...item, x, y };
      }),
    scaleBar: { length, at: [width / 2 - margin - length, -depth / 2 + margin] },
    robotRadius: message.robot_radius,
    wheelRadius: message.wheel_radius,
    track: message.track,
    arm: message.arm ?? false,
    // Where the arm's base is, at the origin of the world, and how high its workspace is.
    base: move([0, 0]),
    height: message.height ?? 0,
  };
}

// The largest of 1, 2 and 5 times a power of ten that is not above a length.
function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * ([5, 2].find((factor) => factor * power <= length) ?? 1);
}

export function describeLength(length) {
  if (length >= 1) return `${length} m`;
  return length >= 0.01 ? `${Math.round(100 * length)} cm` : `${Math.round(1000 * length)} mm`;
}

// The point of an obstacle that is nearest to a point outside; null if there is no obstacle.
export function nearestPoint(obstacles, [x, y]) {
  let nearest = null;
  for (const obstacle of obstacles) {
    const at = obstacle.radius === undefined ? onBox(obstacle, x, y) : onCircle(obstacle, x, y);
    const distance = Math.hypot(at[0] - x, at[1] - y);
    if (nearest === null || distance < nearest.distance) nearest = { at, distance };
  }
  return nearest;
}

function onCircle(circle, x, y) {
  const distance = Math.hypot(x - circle.x, y - circle.y) || 1;
  const share = circle.radius / distance;
  return [circle.x + share * (x - circle.x), circle.y + share * (y - circle.y)];
}

function onBox(box, x, y) {
  const [cos, sin] = [Math.cos(box.yaw), Math.sin(box.yaw)];
  const clamp = (value, half) => Math.min(Math.max(value, -half), half);
  const u = clamp(cos * (x - box.x) + sin * (y - box.y), box.length / 2);
  const v = clamp(-sin * (x - box.x) + cos * (y - box.y), box.width / 2);
  return [box.x + cos * u - sin * v, box.y + sin * u + cos * v];
}
