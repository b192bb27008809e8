// Starts the cockpit on top of Drake's Meshcat page: who says what to whom.

import { Axes } from "./axes.js";
import { Connection } from "./connection.js";
import { Pad } from "./pad.js";
import { Panel } from "./panel.js";
import { Scene } from "./scene.js";
import { Settings } from "./settings.js";

const HEARTBEAT = 50; // ms; the robot brakes 150 ms after the last one.

const style = document.createElement("link");
style.rel = "stylesheet";
style.href = "/cockpit/cockpit.css";
const styled = new Promise((resolve) => style.addEventListener("load", resolve, { once: true }));
document.head.append(style);
const overlay = await (await fetch("/cockpit/overlay.html")).text();
await styled;
document.body.insertAdjacentHTML("beforeend", overlay);
document.body.classList.add("cockpit");

const scene = new Scene(window.viewer, document.getElementById("meshcat-pane"));
const panel = new Panel();
const pad = new Pad(document.getElementById("pad"));
const axes = new Axes();
const connection = new Connection("/drive");
const settings = new Settings((message) => connection.send(message));
let engaged = false;
let leaving = false;

function sendMove() {
  connection.send({ type: "move", x: pad.x, y: pad.y, forward: axes.forward, turn: axes.turn });
}

async function engage() {
  if (engaged) return;
  panel.waitForSeat();
  await pad.capture();
  axes.start();
  scene.driving(true);
  engaged = true;
  connection.send({ type: "engage" });
}

function letGo() {
  if (!engaged) return;
  engaged = false;
  axes.stop();
  pad.release();
  scene.driving(false);
  // A page that goes away says nothing: its driver did not stop, but is lost.
  if (!leaving) connection.send({ type: "release" });
}

panel.onDrive = () => (engaged ? letGo() : engage());
pad.onMove = () => engaged && sendMove();
pad.onRelease = letGo;
axes.onChange = () => engaged && sendMove();
axes.onEscape = letGo;
setInterval(() => engaged && sendMove(), HEARTBEAT);

// Nobody drives from a window that is out of sight, or whose keys go elsewhere.
document.addEventListener("visibilitychange", () => document.hidden && letGo());
window.addEventListener("blur", letGo);

for (const departure of ["beforeunload", "pagehide"]) {
  window.addEventListener(departure, () => (leaving = true));
}
window.addEventListener("pageshow", () => (leaving = false));

connection.on("open", () => panel.connected(true));
connection.on("close", (reason) => {
  letGo();
  panel.connected(false, reason);
});
connection.on("scene", (message) => {
  document.title = `drake_shared: ${message.scenario}`;
  scene.show(message.workspace);
  panel.scene(message);
  settings.scene(message);
});
connection.on("seat", (message) => {
  // The seat was refused, or the trial is over: the mouse is the driver's own again.
  if (message.state !== "yours" && engaged && (message.refused || panel.seat === "yours")) letGo();
  panel.seatIs(message.state);
});
connection.on("settings", (message) => settings.show(message));
connection.on("trial", (message) => panel.trial(message));
connection.on("now", (message) => panel.now(message));
connection.open();
