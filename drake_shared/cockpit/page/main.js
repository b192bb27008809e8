// Starts the cockpit on top of Drake's Meshcat page, and connects its parts.

import { Axes } from "./axes.js";
import { Connection } from "./connection.js";
import { Feedback } from "./feedback.js";
import { FlatScene } from "./flat_scene.js";
import { History } from "./history.js";
import { Intro } from "./intro.js";
import { Lift } from "./lift.js";
import { Mouse } from "./mouse.js";
import { Panel } from "./panel.js";
import { showResult, showTeaching } from "./review.js";
import { Scene } from "./scene.js";
import { Settings } from "./settings.js";
import { SetupPanel } from "./setup_panel.js";
import { Tabs } from "./tabs.js";
import { TouchStick } from "./touch.js";

const BACK = 1500; // ms; the outcome is seen before the page returns to the study.
const HEARTBEAT = 50; // ms; the robot brakes 150 ms after the last message.

const styled = Promise.all(["scene.css", "cockpit.css"].map(addStyle));
const overlay = await (await fetch("/cockpit/overlay.html")).text();
await styled;
document.body.insertAdjacentHTML("beforeend", overlay);
document.body.classList.add("cockpit");
const at = (id) => document.getElementById(id);
const pane = at("meshcat-pane");
at("stage").prepend(pane);

// Meshcat's page has no viewer where the browser has no WebGL.
const scene = window.viewer ? new Scene(window.viewer, pane) : new FlatScene(pane);
const panel = new Panel();
const intro = new Intro();
const tabs = new Tabs(at("tabs"), document.querySelectorAll("[role=tabpanel]"));
const mouse = new Mouse(at("mouse-area"));
const axes = new Axes();
const lift = new Lift(at("mouse-area"));
const feedback = new Feedback();
const touch = new TouchStick(at("touch-stick"));
const connection = new Connection("/drive");
const settings = new Settings((message) => connection.send(message));
const setup = new SetupPanel(at("panel-setup"), (message) => connection.send(message));
const history = new History(at("panel-history"), (message) => connection.send(message));
tabs.onShow = (id) => (id === "panel-history" ? history.open() : history.stop());
let engaged = false;
let closing = false;
let task = null;
let teaching = null; // What was collected, if the drives become demonstrations.
tabs.setAvailable("panel-result", false);
tabs.setAvailable("panel-setup", false);
tabs.setAvailable("panel-history", false);

function sendMove() {
  connection.send({ type: "move", x: mouse.x, y: mouse.y, forward: axes.forward, turn: axes.turn });
  if (!task?.arm) return;
  lift.send(axes.up, (message) => connection.send(message));
  at("plane").textContent = lift.describe();
}

async function engage(event) {
  if (engaged) return;
  panel.disableButton();
  feedback.start();
  intro.close();
  const byTouch = event.pointerType === "touch";
  touch.show(byTouch);
  if (!byTouch) await mouse.capture();
  axes.start();
  if (task?.arm) lift.start();
  scene.setDriving(true);
  engaged = true;
  connection.send({ type: "engage" });
}

function release() {
  if (!engaged) return;
  engaged = false;
  feedback.stop();
  axes.stop();
  lift.stop();
  touch.show(false);
  mouse.release();
  scene.setDriving(false);
  // A page that is closed sends nothing: its driver is lost, and did not stop.
  if (!closing) connection.send({ type: "release" });
}

// The stick is centred at the end of a pause, so that the robot does not start by itself.
function pause() {
  if (!engaged || panel.phase !== "driving") return;
  if (panel.paused) recentre();
  connection.send({ type: "brake", lifted: false, paused: !panel.paused });
}

function recentre() {
  lift.recentre();
  if (engaged) connection.send({ type: "recentre" });
}

panel.onDrive = (event) => (engaged ? release() : engage(event));
mouse.onMove = () => engaged && sendMove();
mouse.onRelease = release;
axes.onChange = () => engaged && sendMove();
lift.onChange = () => engaged && sendMove();
axes.onEscape = release;
axes.onKey = (code) => ({ KeyP: pause, KeyC: recentre })[code]?.();
touch.onChange = () => {
  axes.touch = { forward: touch.forward, turn: touch.turn };
  if (engaged) axes.update();
};
touch.onLift = (lifted) => engaged && connection.send({ type: "brake", lifted, paused: panel.paused });
at("pause").addEventListener("click", pause);
at("recentre").addEventListener("click", recentre);
setInterval(() => engaged && sendMove(), HEARTBEAT);

// Nobody drives from a window that is hidden or has lost the keyboard.
document.addEventListener("visibilitychange", () => document.hidden && release());
window.addEventListener("blur", release);

for (const departure of ["beforeunload", "pagehide"]) {
  window.addEventListener(departure, () => (closing = true));
}
window.addEventListener("pageshow", () => (closing = false));

connection.on("open", () => panel.setConnected(true));
connection.on("close", (reason) => {
  release();
  panel.setConnected(false, reason);
});
connection.on("refused", () => panel.setRefused());
connection.on("scene", (message) => {
  task = message;
  document.title = `drake_shared: ${message.scenario}`;
  scene.setTask(message);
  at("plane").hidden = !message.arm;
  at("plane").textContent = lift.describe();
  at("second-unit").textContent = message.arm ? "m/s" : "rad/s";
  panel.setScene(message);
  feedback.setScene(message);
  settings.setScene(message);
  setup.setScene(message);
  history.setScene(message);
  tabs.setAvailable("panel-stick", message.driven);
});
connection.on("seat", (message) => {
  // The driver lock was refused, or the trial is over: free the mouse.
  if (message.state !== "yours" && engaged && (message.refused || panel.mine)) release();
  panel.setLock(message);
});
connection.on("setup", (message) => {
  panel.setNeedsRoute(message.needs_route);
  panel.setRoute(message.route);
  setup.show(message);
  scene.setGhost(task?.routes.find(({ name }) => name === message.route)?.path ?? []);
  tabs.setAvailable("panel-setup", true);
});
connection.on("teaching", (message) => {
  teaching = message;
  panel.setTeaching(message);
  showTeaching(message);
});
connection.on("history", (message) => {
  history.show(message);
  tabs.setAvailable("panel-history", message.drives.length > 0);
});
connection.on("settings", (message) => settings.show(message));
let driven = false; // Whether a trial runs, whose path the scene draws.
connection.on("trial", (message) => {
  driven = ["driving", "stopping"].includes(message.phase);
  panel.setTrial(message);
  tabs.setAvailable("panel-result", message.result !== null);
  if (message.result && task) {
    showResult(message.result, task, {
      onDiscard: () => connection.send({ type: "discard", number: message.result.number }),
    });
    if (teaching) showTeaching(teaching);
    if (message.phase === "finished") tabs.show("panel-result");
  } else if (message.phase === "ready") tabs.show("panel-setup");
});
connection.on("now", (message) => {
  panel.setNow(message);
  scene.setNow(message);
  if (driven) scene.addToTrail(message);
  if (engaged) feedback.render(message.conflict);
});
let hidden = []; // What a study does not show.
connection.on("routes", (message) => hidden.includes("prediction") || scene.setRoutes(message));
connection.on("study", (message) => {
  hidden = message.hidden;
  Object.assign(document.body.dataset, { study: "", hidden: hidden.join(" ") });
  at("study-text").textContent = message.text;
  intro.close(); // The study has an introduction of its own.
  if (message.back) setTimeout(() => location.replace(message.back), BACK);
});
connection.on("trail", (message) => scene.setTrail(message));
connection.open();

function addStyle(name) {
  const style = document.createElement("link");
  style.rel = "stylesheet";
  style.href = `/cockpit/${name}`;
  document.head.append(style);
  return new Promise((resolve) => style.addEventListener("load", resolve, { once: true }));
}
