// Starts the cockpit on top of Drake's Meshcat page, and connects its parts.

import { Axes } from "./axes.js";
import { Connection } from "./connection.js";
import { Feedback } from "./feedback.js";
import { Mouse } from "./mouse.js";
import { Panel } from "./panel.js";
import { Scene } from "./scene.js";
import { Settings } from "./settings.js";

const HEARTBEAT = 50; // ms; the robot brakes 150 ms after the last message.

const styled = Promise.all(["scene.css", "cockpit.css"].map(addStyle));
const overlay = await (await fetch("/cockpit/overlay.html")).text();
await styled;
document.body.insertAdjacentHTML("beforeend", overlay);
document.body.classList.add("cockpit");

const scene = new Scene(window.viewer, document.getElementById("meshcat-pane"));
const panel = new Panel();
const mouse = new Mouse(document.getElementById("mouse-area"));
const axes = new Axes();
const feedback = new Feedback();
const connection = new Connection("/drive");
const settings = new Settings((message) => connection.send(message));
let engaged = false;
let closing = false;

function sendMove() {
  connection.send({ type: "move", x: mouse.x, y: mouse.y, forward: axes.forward, turn: axes.turn });
}

async function engage() {
  if (engaged) return;
  panel.disableButton();
  feedback.start();
  await mouse.capture();
  axes.start();
  scene.setDriving(true);
  engaged = true;
  connection.send({ type: "engage" });
}

function release() {
  if (!engaged) return;
  engaged = false;
  feedback.stop();
  axes.stop();
  mouse.release();
  scene.setDriving(false);
  // A page that is closed sends nothing: its driver is lost, and did not stop.
  if (!closing) connection.send({ type: "release" });
}

panel.onDrive = () => (engaged ? release() : engage());
mouse.onMove = () => engaged && sendMove();
mouse.onRelease = release;
axes.onChange = () => engaged && sendMove();
axes.onEscape = release;
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
connection.on("scene", (message) => {
  document.title = `drake_shared: ${message.scenario}`;
  scene.setTask(message);
  panel.setScene(message);
  feedback.setScene(message);
  settings.setScene(message);
});
connection.on("seat", (message) => {
  // The driver lock was refused, or the trial is over: free the mouse.
  if (message.state !== "yours" && engaged && (message.refused || panel.lockState === "yours")) release();
  panel.setLockState(message.state);
});
connection.on("settings", (message) => settings.show(message));
let driven = false; // Whether a trial runs, whose way the scene draws.
connection.on("trial", (message) => {
  driven = ["driving", "stopping"].includes(message.phase);
  panel.setTrial(message);
});
connection.on("now", (message) => {
  panel.setNow(message);
  scene.setNow(message);
  if (driven) scene.addToTrail(message);
  if (engaged) feedback.render(message.conflict);
});
connection.on("routes", (message) => scene.setRoutes(message));
connection.on("trail", (message) => scene.setTrail(message));
connection.open();

function addStyle(name) {
  const style = document.createElement("link");
  style.rel = "stylesheet";
  style.href = `/cockpit/${name}`;
  document.head.append(style);
  return new Promise((resolve) => style.addEventListener("load", resolve, { once: true }));
}
