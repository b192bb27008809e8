// The virtual stick's settings in words, with a pad on which to try them, and the switch of the assistance.

import { StickPlot } from "./plots.js";

const GAIN_UNIT = 100; // The slider is in percent of full deflection for a count of the mouse.
// Least gain of each word, in those percent.
const WORDS = [
  [1.2, "Very lively"],
  [0.6, "Lively"],
  [0.25, "Medium"],
  [0, "Gentle"],
];

export class Settings {
  #send;
  #inputs = {
    gain: document.getElementById("gain"),
    dead_zone: document.getElementById("dead-zone"),
    return_time: document.getElementById("return-time"),
  };
  #values = {
    gain: document.getElementById("gain-value"),
    dead_zone: document.getElementById("dead-zone-value"),
    return_time: document.getElementById("return-time-value"),
  };
  #assist = document.getElementById("assist");
  #note = document.getElementById("assist-note");
  #test = new StickTest(document.getElementById("stick-test-plot"));

  constructor(send) {
    this.#send = send;
    for (const input of Object.values(this.#inputs)) {
      input.addEventListener("input", () => this.#onStickInput());
    }
    this.#assist.addEventListener("change", () => this.#send({ type: "assist", on: this.#assist.checked }));
  }

  setScene(scene) {
    this.#assist.disabled = scene.learner === null;
    this.#label();
  }

  show({ gain, dead_zone, return_time, assist }) {
    this.#assist.checked = assist;
    const values = { gain: gain * GAIN_UNIT, dead_zone, return_time };
    for (const [name, input] of Object.entries(this.#inputs)) {
      // The slider that is being dragged keeps its value.
      if (document.activeElement !== input) input.value = values[name];
    }
    this.#label();
  }

  #onStickInput() {
    this.#label();
    this.#send({ type: "stick", ...this.#stick() });
  }

  #stick() {
    return {
      gain: Number(this.#inputs.gain.value) / GAIN_UNIT,
      dead_zone: Number(this.#inputs.dead_zone.value),
      return_time: Number(this.#inputs.return_time.value),
    };
  }

  #label() {
    const stick = this.#stick();
    const word = WORDS.find(([least]) => stick.gain * GAIN_UNIT >= least)[1];
    const counts = Math.round(1 / stick.gain / 10) * 10;
    this.#values.gain.textContent = `${word}: full speed after about ${counts} pixels of mouse movement`;
    const zone = Math.round(100 * stick.dead_zone);
    this.#values.dead_zone.textContent = zone ? `the inner ${zone} % of the way count as zero` : "none";
    const time = stick.return_time;
    this.#values.return_time.textContent = time
      ? `from full speed in ${time.toFixed(1)} s`
      : "never: the stick stays where you leave it";
    this.#test.stick = stick;
    if (this.#assist.disabled) this.#note.textContent = "There is no learner for this scenario.";
    else {
      this.#note.textContent = this.#assist.checked
        ? "The agent helps from the next drive on."
        : "You drive alone from the next drive on.";
    }
  }
}

// Moves a stick of its own with the mouse above the plot, by the rule of the robot's stick.
class StickTest {
  stick = { gain: 0.003, dead_zone: 0.05, return_time: 0 };
  #plot;
  #at = [0, 0];
  #time = null;

  constructor(drawing) {
    this.#plot = new StickPlot(drawing);
    this.#plot.show([0, 0]);
    drawing.addEventListener("pointermove", (event) => this.#move(event.movementX, event.movementY));
    drawing.addEventListener("pointerenter", () => this.#start());
    drawing.addEventListener("pointerleave", () => this.#stop());
  }

  #move(right, down) {
    const { gain } = this.stick;
    this.#at = [clip(this.#at[0] - gain * down), clip(this.#at[1] - gain * right)];
    this.#show();
  }

  #start() {
    this.#time ??= setInterval(() => {
      const { return_time } = this.stick;
      if (return_time) this.#at = this.#at.map((value) => toward0(value, 0.02 / return_time));
      this.#show();
    }, 20);
  }

  #stop() {
    clearInterval(this.#time);
    this.#time = null;
    this.#at = [0, 0];
    this.#show();
  }

  #show() {
    const { dead_zone } = this.stick;
    this.#plot.show(this.#at.map((value) => (Math.sign(value) * Math.max(Math.abs(value) - dead_zone, 0)) / (1 - dead_zone)));
  }
}

const clip = (value) => Math.min(Math.max(value, -1), 1);
const toward0 = (value, step) => Math.sign(value) * Math.max(Math.abs(value) - step, 0);
