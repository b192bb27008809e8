// The player of a stand-alone replay: play, scrub and speed; the scene is that of the cockpit.

import { OUTCOMES } from "./outcomes.js";
import { ReplayChart } from "./replay_chart.js";
import { Scene } from "./scene.js";

const { THREE } = window.MeshCat;
const ROBOT = "/drake/scene/robot"; // Path in Meshcat's tree.
const STEP = 0.5; // s that an arrow key moves the time

const at = (id) => document.getElementById(id);
const replay = JSON.parse(at("replay").textContent);
const { rows, task } = replay;
const duration = Math.max(rows.t.at(-1) ?? 0, 1e-3);
const percent = (share) => (share === null || share === undefined ? "–" : `${Math.round(100 * share)} %`);
const metres = (length) => (length === null || length === undefined ? "–" : `${length.toFixed(2)} m`);

document.body.classList.add("replay");
const pane = at("meshcat-pane");
pane.setAttribute("role", "main");
at("replay-header").after(pane);
if (at("note")) at("replay-header").append(at("note"));
const scene = new Scene(window.viewer, pane);
const chart = new ReplayChart(at("replay-chart"), rows, duration);
const slider = at("replay-time");
slider.max = duration;
let time = 0;
let playing = false;
let shownRow = -1;
let last = null;

scene.setTask(task);
scene.setGhost(replay.recorded);
describe();
show();

function describe() {
  const { measures } = replay;
  at("replay-title").textContent = [replay.scenario, replay.learner].filter(Boolean).join(" · ");
  const outcome = OUTCOMES[replay.status] ?? replay.status;
  at("replay-outcome").textContent = measures.collision ? `${outcome}, with a collision` : outcome;
  at("replay-outcome").dataset.outcome = measures.collision ? "collided" : replay.status;
  const list = [
    ["Time", `${measures.time.toFixed(1)} s`],
    ["Human's share", percent(measures.mean_human_weight)],
    ["Least clearance", metres(measures.clearance)],
    ["Path", metres(measures.path_length)],
  ];
  for (const [name, value] of list) {
    const cell = document.createElement("div");
    const [term, text] = [document.createElement("dt"), document.createElement("dd")];
    term.textContent = name;
    text.textContent = value;
    cell.append(term, text);
    at("replay-measures").append(cell);
  }
}

function show() {
  slider.value = time;
  chart.show(time);
  at("replay-clock").textContent = `${time.toFixed(1)} / ${duration.toFixed(1)} s`;
  if (!rows.t.length) return;
  const after = rows.t.findIndex((t) => t > time + 1e-9);
  const row = (after < 0 ? rows.t.length : after) - 1;
  const share = after < 0 ? 0 : (time - rows.t[row]) / (rows.t[after] - rows.t[row]);
  const pose = between(rows.pose[row], rows.pose[Math.max(after, row)], share);
  const now = { pose };
  for (const name of ["human", "autonomous", "shared", "human_weight"]) now[name] = rows[name]?.[row] ?? null;
  scene.setNow(now);
  placeObject(ROBOT, pose);
  for (const [path, positions] of Object.entries(replay.moving)) {
    placeObject(path, between(positions[row], positions[Math.max(after, row)], share));
  }
  if (row !== shownRow) showRow(row);
  shownRow = row;
}

function showRow(row) {
  scene.setRoutes({ routes: replay.routes[Math.floor(row / replay.every)] ?? [] });
  const columns = ["human_weight", "clearance", "contact"];
  const trail = rows.t.slice(0, row + 1).map((t, i) => {
    return [t, rows.pose[i][0], rows.pose[i][1], ...columns.map((name) => rows[name]?.[i] ?? null)];
  });
  scene.setTrail({ rows: trail });
  const weight = rows.human_weight?.[row] ?? null;
  at("replay-weight").textContent = percent(weight);
  at("replay-agent").textContent = percent(weight === null ? null : 1 - weight);
  at("replay-confidence").textContent = percent(rows.confidence?.[row]);
  at("replay-clearance").textContent = rows.contact?.[row] ? "contact" : metres(rows.clearance?.[row]);
}

function placeObject(path, [x, y, yaw = 0]) {
  if ([x, y, yaw].some((value) => value === null || Number.isNaN(value))) return;
  const matrix = new THREE.Matrix4().makeRotationZ(yaw).setPosition(x, y, 0);
  window.viewer.handle_command({ type: "set_transform", path, matrix: matrix.toArray() });
}

// A pose or position between two; the yaw turns the short way.
function between(a, b, share) {
  return a.map((value, i) => {
    if (value === null || b[i] === null) return value;
    const step = i === 2 ? Math.atan2(Math.sin(b[2] - a[2]), Math.cos(b[2] - a[2])) : b[i] - value;
    return value + share * step;
  });
}

function setPlaying(value) {
  if (value && time >= duration) time = 0;
  playing = value;
  last = null;
  at("replay-play").classList.toggle("playing", playing);
  at("replay-play").setAttribute("aria-label", playing ? "Pause" : "Play");
  if (playing) requestAnimationFrame(advance);
  else show();
}

function advance(now) {
  if (!playing) return;
  if (last !== null) time += ((now - last) / 1000) * Number(at("replay-speed").value);
  last = now;
  time = Math.min(time, duration);
  show();
  if (time >= duration) setPlaying(false);
  else requestAnimationFrame(advance);
}

function seek(to) {
  time = Math.min(Math.max(to, 0), duration);
  if (playing) setPlaying(false);
  show();
}

slider.addEventListener("input", () => seek(Number(slider.value)));
at("replay-play").addEventListener("click", () => setPlaying(!playing));
at("replay-chart").addEventListener("pointerdown", (event) => {
  const box = at("replay-chart").getBoundingClientRect();
  seek((duration * (event.clientX - box.left)) / box.width);
});
window.addEventListener("keydown", (event) => {
  if (/INPUT|SELECT|BUTTON/.test(event.target.tagName)) return;
  const step = { ArrowLeft: -STEP, ArrowRight: STEP }[event.code];
  if (step) seek(time + step);
  if (event.code === "Space") {
    event.preventDefault();
    setPlaying(!playing);
  }
});
