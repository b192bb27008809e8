// The panel of the last drive: outcome, measures with their meaning, weights over time, a map, and what became of
// a demonstration.

import { weightChart } from "./chart.js";
import { FloorMap } from "./floor_map.js";
import { assistanceOf, measureOf, MEASURES, outcomeOf } from "./outcome.js";
import { html } from "./svg.js";

const at = (id) => document.getElementById(id);
const VOID = {
  contact: "Not kept: contact voids a demonstration",
  not_reached: "Not kept: it did not reach the goal",
  discarded: "Not kept, as you asked",
};

export function showResult(result, scene, { onDiscard }) {
  at("outcome").textContent = outcomeOf(result);
  at("outcome").dataset.outcome = result.collision ? "collided" : result.status;
  at("assistance-used").textContent = assistanceOf(result);
  at("metrics").replaceChildren(
    ...MEASURES.map((measure) => {
      const [name, , , , meaning, better] = measure;
      const value = html("dd", { class: "value" }, measureOf(result, measure, scene.command_unit));
      const note = html("dd", { class: "meaning" }, `${meaning}; ${better}`);
      return html("div", {}, html("dt", {}, name), value, note);
    }),
  );
  const rows = result.rows ?? [];
  at("result-chart").replaceChildren(...weightChart(rows));
  const map = new FloorMap(scene, "Map of the drive");
  const route = scene.routes?.find((candidate) => candidate.name === result.route);
  if (route) map.addRoute(route);
  map.addPath(rows, result.mode === "human" ? "human" : "shared");
  at("result-map").replaceChildren(map.element, html("figcaption", {}, "The path driven; a cross marks contact"));
  at("discard").hidden = !result.number;
  at("discard").disabled = false;
  at("discard").onclick = () => {
    onDiscard();
    at("discard").disabled = true;
    at("saved").textContent = "Deleted";
  };
  const saved = result.trouble ?? (result.saved ? `Saved as ${result.saved}` : "");
  at("saved").textContent = [result.failure, saved].filter(Boolean).join(". ");
  at("saved").classList.toggle("trouble", Boolean(result.trouble || result.failure));
}

// Whether the last drive is one of the demonstrations.
export function showTeaching({ wanted, kept, last, void: fault }) {
  if (!last) return;
  const all = kept >= wanted ? ": all there, so the program ends in a few seconds" : "";
  at("assistance-used").textContent = VOID[fault] ?? `Kept: ${kept} of ${wanted} demonstrations`;
  at("discard").textContent = "Do not keep it, drive it again";
  at("discard").hidden = fault !== null;
  at("saved").textContent = fault === null ? `Saved${all}.` : "Drive it again.";
}
