// The panel: button, status line, values of the running trial, and result.

import { CommandPlot, StickPlot } from "./plots.js";
import { describe, listMetrics } from "./result.js";

const at = (id) => document.getElementById(id);
const percent = (share) => (share === null ? "–" : `${Math.round(100 * share)} %`);
const unit = (value, digits, name) => (value === null ? "–" : `${value.toFixed(digits)} ${name}`);

export class Panel {
  onDrive = () => {};
  lockState = "free";
  #phase = "connecting";
  #connected = false;
  #reason = "";
  #scene = null;
  #withoutAgent = false;
  #result = null;
  #now = null;
  #stick = new StickPlot(at("stick-plot"));
  #commands = new CommandPlot(at("command-plot"));
  #rows = Object.fromEntries(
    [["human", "human"], ["autonomous", "agent"], ["shared", "shared"]].map(([name, row]) => [
      name,
      document.querySelectorAll(`#legend .${row} td`),
    ]),
  );

  constructor() {
    at("drive").addEventListener("click", () => {
      at("drive").blur();
      this.onDrive();
    });
  }

  setConnected(connected, reason = "") {
    this.#connected = connected;
    this.#reason = reason;
    if (!connected) this.lockState = "free";
    this.#update();
  }

  setScene(scene) {
    this.#scene = scene;
    const parts = [scene.scenario, scene.learner ?? "no learner", scene.learner_warning];
    at("task").textContent = parts.filter(Boolean).join(" · ");
    for (const element of document.querySelectorAll(".driven-only")) element.hidden = !scene.driven;
    for (const element of document.querySelectorAll(".human-name")) {
      element.textContent = scene.driven ? "You" : "Human";
    }
    document.body.dataset.driven = String(scene.driven);
    at("time-left").textContent = scene.duration.toFixed(1);
    this.#update();
  }

  disableButton() {
    at("drive").disabled = true;
  }

  setLockState(state) {
    this.lockState = state;
    this.#update();
  }

  setTrial({ phase, mode, result }) {
    this.#phase = phase;
    this.#result = result;
    this.#withoutAgent = mode === "human" && this.#scene?.learner !== null;
    if (result) {
      at("outcome").textContent = describe(result);
      at("assistance-used").textContent = result.mode === "human" ? "without assistance" : "with assistance";
      at("outcome").dataset.outcome = result.collision ? "collided" : result.status;
      listMetrics(at("metrics"), result, this.#scene.driven);
      const saved = result.trouble ?? (result.saved ? `Saved as ${result.saved}` : "");
      at("saved").textContent = [result.failure, saved].filter(Boolean).join(". ");
      at("saved").classList.toggle("trouble", Boolean(result.trouble || result.failure));
    }
    this.#update();
  }

  setNow(now) {
    this.#now = now;
    const scene = this.#scene;
    if (!scene) return;
    const left = Math.max(scene.duration - now.t, 0);
    at("time-left").textContent = left.toFixed(1);
    at("time-bar").firstElementChild.style.transform = `scaleX(${left / scene.duration})`;
    const weight = now.human_weight;
    at("human-share").textContent = percent(weight);
    at("agent-share").textContent = percent(weight === null ? null : 1 - weight);
    at("share-bar").setAttribute("aria-valuenow", Math.round(100 * (weight ?? 1)));
    at("share-bar").style.setProperty("--human", weight ?? 1);
    at("confidence").textContent = percent(now.confidence);
    at("confidence-bar").setAttribute("aria-valuenow", Math.round(100 * (now.confidence ?? 0)));
    at("confidence-bar").style.setProperty("--confidence", now.confidence ?? 0);
    at("clearance").textContent = now.contact ? "contact" : unit(now.clearance, 2, "m");
    at("clearance-cell").classList.toggle("contact", now.contact);
    this.#showCommands(now);
    this.#update();
  }

  #showCommands(now) {
    const points = {};
    for (const name of ["human", "autonomous", "shared"]) {
      const twist = this.#twist(now[name]);
      const [speed, yawRate] = this.#rows[name];
      speed.textContent = twist ? twist.speed.toFixed(2) : "–";
      yawRate.textContent = twist ? twist.yawRate.toFixed(2) : "–";
      points[name] = twist && [-twist.yawRate / this.#scene.max_yaw_rate, -twist.speed / this.#scene.max_speed];
      if (name === "shared") at("speed").textContent = unit(twist && twist.speed, 2, "m/s");
    }
    this.#commands.show(points);
    this.#stick.show(now.stick);
  }

  #twist([left, right]) {
    if (left === null || right === null) return null;
    const { wheel_radius: radius, track } = this.#scene;
    return { speed: (radius / 2) * (left + right), yawRate: (radius / track) * (right - left) };
  }

  #update() {
    const mine = this.lockState === "yours";
    const phase = this.#connected ? this.#phase : "connecting";
    at("deck").dataset.phase = phase;
    at("deck").dataset.result = this.#result ? "shown" : "none";
    document.body.dataset.driverLock = this.#connected ? this.lockState : "none";
    at("drive").textContent = mine ? "Stop (Esc)" : this.#result ? "Again" : "Drive";
    at("drive").classList.toggle("stop", mine);
    const free = this.lockState === "free" && ["ready", "finished"].includes(phase);
    at("drive").disabled = !this.#connected || !(mine || free);
    at("drive").hidden = this.#scene !== null && !this.#scene.driven;
    at("hint").textContent = mine ? "Arrow keys and gamepad add to the mouse." : this.#instructions();
    at("status").textContent = this.#status(phase, mine);
    at("phase-dot").dataset.phase = phase;
  }

  #instructions() {
    if (!this.#scene?.driven) return "A simulated operator drives the routes one after another.";
    return "Move the mouse away to go forward, sideways to turn. Arrow keys and gamepad work too.";
  }

  #status(phase, mine) {
    if (this.#phase === "ended") return "The program has ended.";
    if (!this.#connected) {
      return this.#reason ? `Connection closed: ${this.#reason}.` : "No connection. Is the program still running?";
    }
    const watching = this.#scene?.driven && this.lockState === "taken";
    const isInvalid = this.#now?.confidence === null && !this.#withoutAgent && this.#scene?.learner !== null;
    if (phase === "driving" && isInvalid) return "The learner outputs NaN: the human drives alone.";
    if (watching) return "Someone else is driving. You are watching.";
    const alone = this.#withoutAgent ? " without assistance" : "";
    switch (phase) {
      case "ready":
        return this.lockState === "none" ? "About to start." : "Ready. Click Drive, then move the mouse.";
      case "armed":
        return mine ? "You have the controls. The clock starts with your first move." : "About to start.";
      case "driving":
        if (this.#now?.let_go === "hands_off") {
          return mine ? "Hands off: stopping. Move to go on." : "Hands off: stopping.";
        }
        if (this.#now?.let_go === "conflict") {
          return mine ? "You and the agent disagree: you drive alone." : "In conflict: the human drives alone.";
        }
        return mine ? `You are driving${alone}. Reach the green goal.` : `Driving${alone}.`;
      case "stopping":
        return "Braking.";
      case "finished":
        return this.lockState === "none" ? "The next trial follows." : "Click Again for another trial.";
      default:
        return "Connecting…";
    }
  }
}
