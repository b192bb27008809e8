// Three steps of introduction, shown at the first visit and on request.

const KEY = "drake-shared-introduced";
const STEPS = [
  ["You steer", "Click Drive, then move the mouse: away from you is forward, sideways turns. Arrow keys, WASD, a gamepad and touch work too. Esc stops."],
  ["The agent helps", "It has learnt from demonstrations. It guesses which route you want, and draws it. The surer it is, the more it steers; where routes part, you choose."],
  ["You see who drives", "The bar shows how the control is divided, and the line above it says why. Steer elsewhere and you have it all back. Reach the goal without touching anything."],
];

export class Intro {
  #step = 0;
  #card = document.getElementById("intro");

  constructor() {
    document.getElementById("intro-next").addEventListener("click", () => this.#next());
    document.getElementById("intro-skip").addEventListener("click", () => this.close());
    document.getElementById("show-intro").addEventListener("click", () => {
      this.#step = 0;
      this.#show();
      document.getElementById("intro-next").focus();
    });
    if (!stored()) this.#show();
  }

  close() {
    if (this.#card.hidden) return;
    this.#card.hidden = true;
    try {
      localStorage.setItem(KEY, "yes");
    } catch {
      // A page without storage shows the introduction again.
    }
  }

  #next() {
    this.#step += 1;
    if (this.#step < STEPS.length) this.#show();
    else this.close();
  }

  #show() {
    const [title, text] = STEPS[this.#step];
    document.getElementById("intro-step").textContent = `${this.#step + 1} of ${STEPS.length}`;
    document.getElementById("intro-title").textContent = title;
    document.getElementById("intro-text").textContent = text;
    const last = this.#step === STEPS.length - 1;
    document.getElementById("intro-next").textContent = last ? "Start" : "Next";
    this.#card.hidden = false;
  }
}

function stored() {
  try {
    return localStorage.getItem(KEY) !== null;
  } catch {
    return false;
  }
}
