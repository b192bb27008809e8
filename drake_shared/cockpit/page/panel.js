// The panel: button, who drives and why, values of the running trial.

import { CommandPlot, StickPlot } from "./plots.js";
import { levelOf, who, why } from "./phrases.js";

const at = (id) => document.getElementById(id);
const percent = (share) => (share === null ? "–" : `${Math.round(100 * share)} %`);
const unit = (value, digits, name) => (value === null ? "–" : `${value.toFixed(digits)} ${name}`);
const rounded = (value) => value.toFixed(2).replace(/^-(0\.00)$/, "$1");
const MOST_NOISE = 1.8; // rad/s on each wheel: the largest that fusion considers.
const HELD = 600; // ms for which a reason stays, unless a more urgent one comes.
const URGENT = ["contact", "paused", "hands_off", "conflict"];
const RUNNING = ["armed", "driving", "stopping"];

export class Panel {
  onDrive = () => {};
  lockState = "free";
  paused = false;
  #phase = "connecting";
  #connected = false;
  #everConnected = false;
  #reason = "";
  #scene = null;
  #result = null;
  #now = null;
  #level = "human";
  #needsRoute = false;
  #teaching = null;
  #route = null;
  #said = { reason: null, until: 0 };
  #sayLater = null;
  #stick = new StickPlot(at("stick-plot"));
  #commands = new CommandPlot(at("command-plot"));
  #rows = Object.fromEntries(
    [["human", "human"], ["autonomous", "agent"], ["shared", "shared"]].map(([name, row]) => [
      name,
      document.querySelectorAll(`#legend .${row} td`),
    ]),
  );

  constructor() {
    at("drive").addEventListener("click", (event) => {
      // While driving, Space and Enter must not press the button.
      at("drive").blur();
      this.onDrive(event);
    });
  }

  get phase() {
    return this.#connected ? this.#phase : "connecting";
  }

  get mine() {
    return this.lockState === "yours";
  }

  setConnected(connected, reason = "") {
    this.#connected = connected;
    this.#everConnected ||= connected;
    this.#reason = reason;
    if (!connected) this.lockState = "free";
    document.body.classList.toggle("offline", !connected && this.#everConnected);
    this.#update();
  }

  // The server runs again, with a key that this page does not have.
  setRefused() {
    this.#reason = "refused";
    this.#update();
  }

  setScene(scene) {
    this.#scene = scene;
    for (const element of document.querySelectorAll(".driven-only")) element.hidden = !scene.driven;
    document.body.dataset.driven = String(scene.driven);
    this.#setTime(scene.duration);
    this.#update();
  }

  disableButton() {
    at("drive").disabled = true;
  }

  setLock({ state, paused }) {
    this.lockState = state;
    this.paused = paused;
    at("pause").setAttribute("aria-pressed", String(paused));
    at("pause").textContent = paused ? "Go on (P)" : "Pause (P)";
    if (this.#now) this.#sayWhy(this.#now);
    this.#update();
  }

  // The drives become demonstrations: how many there are, and must be.
  setTeaching(teaching) {
    this.#teaching = teaching;
    at("lesson").hidden = false;
    at("assist-box").hidden = true;
    this.#update();
  }

  setRoute(route) {
    this.#route = route;
    this.#update();
  }

  // Whether the driver must name a route first.
  setNeedsRoute(needed) {
    this.#needsRoute = needed;
    this.#update();
  }

  setTrial({ phase, result, mode }) {
    this.#phase = phase;
    // Without an agent there is no confidence to show.
    at("deck").dataset.alone = String(mode === "human");
    this.#result = result;
    if (["ready", "armed"].includes(phase)) this.#said = { reason: null, until: 0 };
    this.#update();
  }

  setNow(now) {
    this.#now = now;
    if (!this.#scene) return;
    this.#setTime(Math.max(this.#scene.duration - now.t, 0));
    const weight = now.human_weight;
    if (weight !== null) this.#level = levelOf(weight, this.#level);
    at("human-share").textContent = percent(weight);
    at("agent-share").textContent = percent(weight === null ? null : 1 - weight);
    meter("share-bar", weight, "--human");
    this.#showDoubt(now);
    at("speed").textContent = unit(this.#speed(now), 2, "m/s");
    at("clearance").textContent = now.contact ? "contact" : unit(now.clearance, 2, "m");
    at("clearance-cell").classList.toggle("contact", now.contact);
    this.#showCommands(now);
    this.#sayWhy(now);
    this.#update();
  }

  // What decides the shares: the confidence, or with fusion the noise found in the commands.
  #showDoubt({ confidence, driver_noise: noise = null }) {
    const isNoise = noise !== null;
    at("confidence-label").textContent = isNoise ? "The commands waver by" : "The agent is sure of the route";
    at("confidence").textContent = isNoise ? unit(noise, 1, "rad/s") : percent(confidence);
    at("confidence-bar").setAttribute("aria-label", isNoise ? "Noise found in the commands" : "Confidence of the agent");
    meter("confidence-bar", isNoise ? Math.min(noise / MOST_NOISE, 1) : confidence, "--confidence");
  }

  #setTime(left) {
    at("time-left").textContent = left.toFixed(1);
    at("time-bar").firstElementChild.style.transform = `scaleX(${left / this.#scene.duration})`;
  }

  // The robot's own speed; a real robot may report none, then that of the command.
  #speed(now) {
    if (now.motion) return Math.abs(now.motion[0] ?? 0);
    return this.#twist(now.shared)?.speed ?? null;
  }

  #sayWhy(now) {
    const clock = performance.now();
    const told = this.#teaching && now.reason === "no_learner" ? "teaching" : now.reason;
    const reason = this.paused ? "paused" : told;
    if (reason !== this.#said.reason && (clock > this.#said.until || URGENT.includes(reason))) {
      this.#said = { reason, until: clock + HELD };
    } else if (reason !== this.#said.reason) {
      clearTimeout(this.#sayLater);
      this.#sayLater = setTimeout(() => this.#sayWhy(this.#now), this.#said.until - clock + 1);
    }
    const text = this.#said.reason ? why(this.#said.reason, now.open_routes, this.mine) : "";
    if (at("why").textContent !== text) at("why").textContent = text;
    at("why").dataset.reason = this.#said.reason ?? "";
  }

  #showCommands(now) {
    const points = {};
    for (const name of ["human", "autonomous", "shared"]) {
      const twist = this.#twist(now[name]);
      const [speed, yawRate] = this.#rows[name];
      speed.textContent = twist ? rounded(twist.speed) : "–";
      yawRate.textContent = twist ? rounded(twist.yawRate) : "–";
      points[name] = twist && [-twist.yawRate / this.#scene[this.#scene.arm ? "max_speed" : "max_yaw_rate"], -twist.speed / this.#scene.max_speed];
    }
    this.#commands.show(points);
    this.#stick.show(now.stick);
  }

  #twist([left, right]) {
    if (left === null || right === null) return null;
    if (this.#scene.arm) return { speed: left, yawRate: right }; // Along x and y, in m/s.
    const { wheel_radius: radius, track } = this.#scene;
    return { speed: (radius / 2) * (left + right), yawRate: (radius / track) * (right - left) };
  }

  #update() {
    const { mine, phase } = this;
    at("deck").dataset.phase = phase;
    at("task").textContent = this.#title();
    at("deck").dataset.running = String(RUNNING.includes(phase));
    document.body.dataset.driverLock = this.#connected ? this.lockState : "none";
    const driven = this.#scene?.driven ?? true;
    for (const element of document.querySelectorAll(".human-name")) {
      element.textContent = mine || (driven && !RUNNING.includes(phase)) ? "You" : driven ? "Driver" : "Operator";
    }
    at("drive").textContent = mine ? "Stop (Esc)" : this.#result ? "Drive again" : "Drive";
    at("drive").classList.toggle("stop", mine);
    const enough = this.#teaching?.kept >= this.#teaching?.wanted;
    const free = !enough && this.lockState === "free" && ["ready", "finished"].includes(phase);
    at("drive").disabled = !this.#connected || !(mine || (free && !this.#needsRoute));
    at("drive").hidden = !driven;
    at("pause").disabled = at("recentre").disabled = !mine;
    at("hint").textContent = this.#hint(phase);
    const status = this.#status(phase);
    if (at("status").textContent !== status) at("status").textContent = status;
    at("phase-dot").dataset.phase = phase;
  }

  #title() {
    if (!this.#scene) return "Shared control";
    const { scenario, learner, learner_warning: warning } = this.#scene;
    if (!this.#teaching) return [scenario, learner ?? "no learner", warning].filter(Boolean).join(" · ");
    const { kept, wanted } = this.#teaching;
    const which = kept < wanted ? `demonstration ${kept + 1} of ${wanted}` : `${kept} demonstrations`;
    return [scenario, which, this.#route && `route ${this.#route}`].filter(Boolean).join(" · ");
  }

  #hint(phase) {
    if (!this.#scene?.driven) return "A simulated operator drives the routes one after another.";
    if (this.mine || RUNNING.includes(phase)) return "";
    if (this.#scene?.arm) return "Mouse: away and sideways. Wheel, or E and Q: up and down. A click switches planes.";
    return "Mouse: away is forward, sideways turns. Arrow keys, WASD, gamepad and touch work too.";
  }

  #status(phase) {
    if (!this.#connected) return this.#lost();
    const driven = this.#scene?.driven;
    const watching = driven && this.lockState === "taken";
    switch (phase) {
      case "training":
        return "Learning from your drives…";
      case "ready":
        if (this.#needsRoute) return "Choose a route to drive.";
        return driven ? "Ready. Click Drive, then move." : "About to start.";
      case "armed":
        if (watching) return "Someone else has the controls. You are watching.";
        return this.mine ? "You have the controls: move to start." : "About to start.";
      case "driving": {
        if (this.paused) return "Paused.";
        const text = who(this.#level, this.mine, driven);
        return watching ? `You are watching. ${text}` : text;
      }
      case "stopping":
        return "Braking.";
      case "finished":
        if (this.#needsRoute) return "Choose a route to drive.";
        if (this.#teaching?.kept >= this.#teaching?.wanted) return "All demonstrations are there.";
        return driven ? "Click Drive again for another trial." : "The next trial follows.";
      case "ended":
        return "The program has ended. This page comes back when it runs again.";
      default:
        return "Connecting…";
    }
  }

  #lost() {
    if (this.#reason === "refused") return "The program was restarted. Open the address that it printed.";
    if (!this.#everConnected) return "Connecting…";
    if (this.#phase === "ended" || this.#reason === "ended") {
      return "The program has ended. This page comes back when it runs again.";
    }
    return this.#reason
      ? `Connection closed: ${this.#reason}. Trying again…`
      : "The connection is lost. Trying again…";
  }
}

function meter(id, value, property) {
  at(id).setAttribute("aria-valuenow", Math.round(100 * (value ?? 0)));
  at(id).style.setProperty(property, value ?? 0);
}
