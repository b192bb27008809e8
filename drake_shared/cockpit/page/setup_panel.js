// The choices before a drive: scenario, learner, arbiter, K, feedback and the instructed route.

import { FloorMap } from "./floor_map.js";
import { html } from "./svg.js";

const ARBITERS = {
  blend: "by confidence (blend)",
  halves: "one half each (halves)",
  traded: "one of both at a time (traded)",
  "leader-follower": "you lead, the agent follows (leader-follower)",
  fusion: "by your route and noise (fusion)",
  hindsight: "least expected cost over the routes (hindsight)",
  "rt-v2": "modes corrected by your command (rt-v2)",
  consistency: "your command denoised toward the demonstrations (consistency)",
};
const FREE = "";
const RESISTANCES = [[0, "no"], [0.25, "light"], [0.5, "medium"], [0.75, "strong"], [1, "full"]];

export class SetupPanel {
  #send;
  #panel;
  #message = null;
  #scene = null;
  #inputs = {};
  #key = "";

  constructor(panel, send) {
    this.#panel = panel;
    this.#send = send;
  }

  setScene(scene) {
    this.#scene = scene;
    this.#key = "";
    if (this.#message) this.show(this.#message);
  }

  show(message) {
    this.#message = message;
    if (!this.#scene) return;
    // The form is rebuilt only where its choices change, so that the focus stays where it is.
    const key = JSON.stringify([message, this.#scene.scenario]);
    if (key === this.#key) return;
    this.#key = key;
    const focused = document.activeElement?.id;
    this.#build(message);
    if (focused) document.getElementById(focused)?.focus();
  }

  #build(message) {
    const fields = html("div", { class: "fields" });
    const map = new FloorMap(this.#scene, "Map of the scenario");
    const route = this.#scene.routes?.find(({ name }) => name === message.route);
    for (const other of this.#scene.routes ?? []) map.addRoute(other, other === route);
    this.#inputs = {};
    if (!message.fixed) {
      fields.append(
        this.#select("scenario", "Scenario", message.scenarios.map((name) => [name, name]), message.scenario),
        this.#select(
          "learner",
          "Learner",
          [...message.learners.map((name) => [name, name]), [FREE, "none: you drive alone"]],
          message.learner ?? FREE,
        ),
        this.#select(
          "arbitration",
          "How control is shared",
          message.arbitrations.map((name) => [name, ARBITERS[name] ?? name]),
          message.arbitration,
        ),
        this.#gainField(message),
        this.#feedbackFields(message),
      );
    }
    if (message.routes.length) {
      const free = message.needs_route ? [[FREE, "choose one to drive"]] : [[FREE, "any: drive as you like"]];
      fields.append(
        this.#select("route", "Route to drive", [...free, ...message.routes.map((name) => [name, name])], message.route ?? FREE),
      );
    }
    const parts = [fields, html("figure", { class: "setup-map" }, map.element)];
    this.#panel.replaceChildren(...parts, this.#training(message));
    if (message.error) this.#panel.append(html("p", { class: "note trouble", role: "alert" }, message.error));
  }

  #select(name, label, options, value) {
    const id = `choice-${name}`;
    const select = html("select", { id });
    for (const [option, text] of options) {
      const element = html("option", { value: option }, text);
      element.selected = option === value;
      select.append(element);
    }
    select.addEventListener("change", () => this.#onChange());
    this.#inputs[name] = select;
    return html("div", { class: "field" }, html("label", { for: id }, label), select);
  }

  #gainField(message) {
    const id = "choice-confidence_gain";
    const input = html("input", { id, type: "number", min: "0.000001", step: "any", inputmode: "decimal" });
    input.value = message.confidence_gain ?? "";
    input.placeholder = message.own_gain ?? "";
    input.disabled = message.learner === null;
    input.setAttribute("aria-describedby", "gain-note");
    input.addEventListener("change", () => this.#onChange());
    this.#inputs.confidence_gain = input;
    const note = html("span", { class: "note", id: "gain-note" }, "For arbitration by confidence. Higher: the agent is sure less often. Empty: the learner's own.");
    return html("div", { class: "field" }, html("label", { for: id }, "K, in 1/m²"), input, note);
  }

  // What the driver feels where the agent, sure of itself, commands something else.
  #feedbackFields(message) {
    const checks = html("div", { class: "checks" });
    for (const [name, text] of [["rumble", "gamepad"], ["tone", "tone"]]) {
      const input = html("input", { id: `choice-${name}`, type: "checkbox" });
      input.checked = message[name];
      input.addEventListener("change", () => this.#onChange());
      this.#inputs[name] = input;
      checks.append(html("label", {}, input, text));
    }
    const known = RESISTANCES.some(([value]) => value === message.resistance);
    const all = known ? RESISTANCES : [...RESISTANCES, [message.resistance, `${Math.round(100 * message.resistance)} %`]];
    const options = all.map(([value, text]) => [value, `${text} resistance`]);
    const select = this.#select("resistance", "Resistance: weakens your command", options, message.resistance);
    select.firstChild.className = "hidden-text";
    const fields = html("fieldset", { class: "field" }, html("legend", {}, "Feel disagreement"), checks, select);
    fields.disabled = message.learner === null;
    return fields;
  }

  #training({ drives, drives_to_train: needed, learner, fixed }) {
    const offer = html("p", { class: "note offer" });
    if (fixed) return offer;
    if (drives >= needed) {
      const button = html("button", { id: "train", class: "small", type: "button" }, `Train a learner on your ${drives} drives`);
      button.addEventListener("click", () => this.#send({ type: "train" }));
      offer.append(button);
    } else if (learner === null) {
      offer.append(
        `Drive to the goal ${needed} times without contact, and a learner can be trained on your drives: ${drives} of ${needed} so far.`,
      );
    }
    return offer;
  }

  #onChange() {
    const value = (name, other) => this.#inputs[name]?.value || other;
    const gain = Number(value("confidence_gain", NaN));
    this.#send({
      type: "setup",
      scenario: value("scenario", this.#message.scenario),
      learner: this.#inputs.learner ? value("learner", null) : this.#message.learner,
      arbitration: value("arbitration", this.#message.arbitration),
      confidence_gain: Number.isFinite(gain) && gain > 0 ? Math.min(Math.max(gain, 1e-6), 1e9) : null,
      route: value("route", null),
      rumble: this.#inputs.rumble?.checked ?? false,
      tone: this.#inputs.tone?.checked ?? false,
      resistance: Number(value("resistance", 0)),
    });
  }
}
