// The drives of this session: a list, and two of them replayed beside each other.

import { FloorMap } from "./floor_map.js";
import { assistanceOf, measureOf, MEASURES, outcomeOf } from "./outcome.js";
import { html } from "./svg.js";

const COLUMNS = ["Time", "Effort", "Least distance"];
const FRAME = 50; // ms

export class History {
  #panel;
  #send;
  #scene = null;
  #drives = [];
  #chosen = [];
  #timer = null;
  #rows = new Map();
  #list = html("div", { class: "drive-list" });
  #replay = html("div", { class: "replay" });

  constructor(panel, send) {
    this.#panel = panel;
    this.#send = send;
    panel.append(this.#list, this.#replay);
  }

  setScene(scene) {
    this.#scene = scene;
    this.#fillList();
  }

  show({ drives }) {
    this.#drives = drives;
    this.#chosen = this.#chosen.filter((number) => drives.some((drive) => drive.number === number));
    for (const number of this.#rows.keys()) if (!this.#chosen.includes(number)) this.#rows.delete(number);
    // Two drives, with and without assistance, say most: they are beside each other at first.
    if (!this.#chosen.length) this.#chosen = firstPair(this.#own()).map((drive) => drive.number);
    this.#fillList();
  }

  // Called when the panel is opened, so that nothing is fetched while nobody looks.
  async open() {
    await this.#showReplay();
  }

  stop() {
    clearInterval(this.#timer);
    this.#timer = null;
  }

  // Drives of other scenarios do not fit on this map.
  #own() {
    return this.#drives.filter((drive) => drive.scenario === this.#scene?.scenario);
  }

  #fillList() {
    const table = html("table", {}, html("caption", { class: "hidden-text" }, "Drives of this session"));
    const head = ["Compare", "Drive", "Outcome", "Assistance", ...COLUMNS, "Log"];
    table.append(html("thead", {}, html("tr", {}, ...head.map((name) => html("th", { scope: "col" }, name)))));
    const body = html("tbody");
    for (const drive of this.#own()) body.append(this.#row(drive));
    table.append(body);
    this.#list.replaceChildren(table);
  }

  #row(drive) {
    const box = html("input", { type: "checkbox", id: `compare-${drive.number}`, "aria-label": `Compare drive ${drive.number}` });
    box.checked = this.#chosen.includes(drive.number);
    box.addEventListener("change", () => this.#choose(drive.number, box.checked));
    const discard = html("button", { class: "quiet", type: "button", "aria-label": `Delete drive ${drive.number}` }, "Delete");
    discard.addEventListener("click", () => this.#send({ type: "discard", number: drive.number }));
    const unit = this.#scene.command_unit;
    const measures = MEASURES.filter(([name]) => COLUMNS.includes(name)).map((measure) => measureOf(drive, measure, unit));
    const cells = [box, String(drive.number), outcomeOf(drive), assistanceOf(drive), ...measures, discard];
    return html("tr", {}, ...cells.map((cell) => html("td", {}, cell)));
  }

  #choose(number, chosen) {
    this.#chosen = this.#chosen.filter((other) => other !== number);
    if (chosen) this.#chosen = [...this.#chosen, number].slice(-2);
    this.#fillList();
    document.getElementById(`compare-${number}`)?.focus();
    this.#showReplay();
  }

  async #showReplay() {
    this.stop();
    const drives = this.#chosen.map((number) => this.#drives.find((drive) => drive.number === number)).filter(Boolean);
    const maps = await Promise.all(drives.map((drive) => this.#map(drive)));
    if (!maps.length) return this.#replay.replaceChildren(html("p", { class: "note" }, "Choose one or two drives to replay."));
    const end = Math.max(...maps.map(({ rows }) => rows.at(-1)?.[0] ?? 0));
    const play = html("button", { class: "small", type: "button", id: "replay-play" }, "Play");
    const slider = html("input", { type: "range", min: "0", max: String(end), step: "0.05", id: "replay-time", "aria-label": "Time of the replay in s" });
    slider.value = String(end);
    const show = () => maps.forEach(({ map, rows }) => map.showRobot(rows, Number(slider.value)));
    slider.addEventListener("input", show);
    play.addEventListener("click", () => this.#play(play, slider, end, show));
    this.#replay.replaceChildren(...maps.map(({ figure }) => figure), html("div", { class: "player" }, play, slider));
    show();
  }

  #play(button, slider, end, show) {
    if (this.#timer !== null) {
      this.stop();
      button.textContent = "Play";
      return;
    }
    if (Number(slider.value) >= end) slider.value = "0";
    button.textContent = "Stop";
    this.#timer = setInterval(() => {
      slider.value = String(Number(slider.value) + FRAME / 1000);
      show();
      if (Number(slider.value) >= end || !slider.isConnected || !slider.checkVisibility()) {
        this.stop();
        button.textContent = "Play";
      }
    }, FRAME);
  }

  async #map(drive) {
    if (!this.#rows.has(drive.number)) {
      const answer = await fetch(`/drives/${drive.number}`);
      this.#rows.set(drive.number, answer.ok ? (await answer.json()).rows : []);
    }
    const rows = this.#rows.get(drive.number);
    const map = new FloorMap(this.#scene, `Drive ${drive.number}`);
    const route = this.#scene.routes?.find(({ name }) => name === drive.route);
    if (route) map.addRoute(route, true);
    map.addPath(rows, drive.mode === "human" ? "human" : "shared");
    const caption = html("figcaption", {}, `Drive ${drive.number}, ${assistanceOf(drive)}: ${outcomeOf(drive)}`);
    return { map, rows, figure: html("figure", {}, map.element, caption) };
  }
}

// The newest drive, and the newest one that differs in the assistance.
function firstPair(drives) {
  const [newest] = drives;
  if (!newest) return [];
  const other = drives.find((drive) => (drive.mode === "human") !== (newest.mode === "human"));
  return other ? [newest, other] : [newest];
}
