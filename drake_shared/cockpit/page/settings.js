// Shows and changes the settings: gain, dead zone, return time and assistance.

const GAIN_UNIT = 100; // The page shows the gain in percent of full deflection for a count of the mouse.

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

  constructor(send) {
    this.#send = send;
    for (const input of Object.values(this.#inputs)) {
      input.addEventListener("input", () => this.#onStickInput());
    }
    this.#assist.addEventListener("change", () => {
      this.#send({ type: "assist", on: this.#assist.checked });
      this.#assist.blur();
    });
  }

  setScene(scene) {
    this.#assist.disabled = scene.learner === null;
    document.getElementById("settings").hidden = !scene.driven;
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
    this.#send({
      type: "stick",
      gain: Number(this.#inputs.gain.value) / GAIN_UNIT,
      dead_zone: Number(this.#inputs.dead_zone.value),
      return_time: Number(this.#inputs.return_time.value),
    });
  }

  #label() {
    const { gain, dead_zone, return_time } = this.#inputs;
    this.#values.gain.textContent = `${Number(gain.value).toFixed(2)} % a count`;
    this.#values.dead_zone.textContent = `${Math.round(100 * dead_zone.value)} %`;
    const time = Number(return_time.value);
    this.#values.return_time.textContent = time ? `in ${time.toFixed(1)} s` : "never";
  }
}
