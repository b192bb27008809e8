// Lets the driver feel a conflict with the agent: rumble of the gamepad, and a tone.

const PERIOD = 50; // ms between two messages.
const LASTS = 120; // ms that a rumble or a tone outlasts its message: without messages it ends by itself.
const LEAST = 0.02; // Conflicts below this strength are not rendered.
const TONE = { low: 220, high: 660, volume: 0.25 }; // Hz, Hz, and the gain at full strength.

export class Feedback {
  #rumbles = false;
  #sounds = false;
  #tone = null;

  // Which feedback is on; the scene message says so.
  setScene({ feedback }) {
    this.#rumbles = feedback?.rumble ?? false;
    this.#sounds = feedback?.tone ?? false;
  }

  // Call it in a click: browsers let a page sound only after one.
  start() {
    if (this.#sounds) this.#tone ??= new Tone();
  }

  // Renders [strength, left, right]: strength in [0, 1], and the direction from the human's wheel speeds to
  // the agent's.
  render(conflict) {
    const [strength, left, right] = conflict ?? [0, 0, 0];
    if (!(strength >= LEAST)) return this.stop();
    const turn = (right - left) / 2; // 1: the agent turns further to the left.
    if (this.#rumbles) for (const gamepad of gamepads()) rumble(gamepad, strength, turn);
    if (this.#sounds) this.#tone?.play(strength, -turn);
  }

  stop() {
    if (this.#rumbles) for (const gamepad of gamepads()) gamepad.vibrationActuator.reset();
    this.#tone?.stop();
  }
}

function gamepads() {
  return [...(navigator.getGamepads?.() ?? [])].filter((gamepad) => gamepad?.vibrationActuator);
}

// The whole pad rumbles with the strength; the trigger on the agent's side does, where the pad has such.
function rumble({ vibrationActuator }, strength, turn) {
  const effect = { duration: PERIOD + LASTS, strongMagnitude: strength, weakMagnitude: strength };
  const triggers = vibrationActuator.effects?.includes("trigger-rumble");
  if (triggers) {
    effect.leftTrigger = strength * Math.max(turn, 0);
    effect.rightTrigger = strength * Math.max(-turn, 0);
  }
  // A pad that is unplugged meanwhile rejects the effect.
  vibrationActuator.playEffect(triggers ? "trigger-rumble" : "dual-rumble", effect)?.catch(() => {});
}

class Tone {
  #context = new AudioContext();
  #oscillator = this.#context.createOscillator();
  #gain = this.#context.createGain();
  #panner = this.#context.createStereoPanner();

  constructor() {
    this.#gain.gain.value = 0;
    this.#oscillator.connect(this.#gain).connect(this.#panner).connect(this.#context.destination);
    this.#oscillator.start();
  }

  // A tone on one side, from -1 (left) to 1, that ends by itself.
  play(strength, side) {
    const now = this.#context.currentTime;
    this.#oscillator.frequency.setTargetAtTime(TONE.low + strength * (TONE.high - TONE.low), now, 0.02);
    this.#panner.pan.setTargetAtTime(side, now, 0.02);
    this.#gain.gain.cancelScheduledValues(now);
    this.#gain.gain.setTargetAtTime(strength * TONE.volume, now, 0.02);
    this.#gain.gain.setTargetAtTime(0, now + (PERIOD + LASTS / 2) / 1000, 0.01);
  }

  stop() {
    const now = this.#context.currentTime;
    this.#gain.gain.cancelScheduledValues(now);
    this.#gain.gain.setTargetAtTime(0, now, 0.01);
  }
}
