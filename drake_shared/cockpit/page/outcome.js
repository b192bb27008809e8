// Describes how a drive ended, and what its measures mean.

import { OUTCOMES } from "./outcomes.js";

// Name, field of the result, digits, unit with wheels, meaning, and which way is better (where one is).
export const MEASURES = [
  ["Time", "time", 1, "s", "first move to the end", "less is better"],
  ["Human's share", "mean_human_weight", 0, "%", "set by the arbiter", "neither way is better"],
  ["Effort", "human_effort", 0, "rad", "the human's command, summed", "less is better"],
  ["Disagreement", "disagreement_rate", 1, "rad/s", "between human and agent", "less is better"],
  ["Least distance", "clearance", 2, "m", "to an obstacle", "more is safer"],
  ["Path", "path_length", 2, "m", "length of the path driven", "shorter is better"],
  ["Smoothness", "smoothness", 2, "", "of the speed", "nearer 0 is smoother"],
];

export function outcomeOf(result) {
  const outcome = OUTCOMES[result.status] ?? result.status;
  if (result.collision) return `${outcome}, with a collision`;
  if (result.intent_success === false && result.status === "reached") return `${outcome}, but not along the instructed route`;
  return outcome;
}

export function assistanceOf(result) {
  return result.mode === "human" ? "without assistance" : "with assistance";
}

// A measure as text, such as "0.42 m"; a dash where it is unknown.
export function measureOf(result, [, field, digits, unit], commandUnit) {
  const value = result[field] ?? null;
  if (value === null) return "–";
  if (unit.startsWith("rad") && commandUnit === "m/s") return `${value.toFixed(2)} ${unit.replace("rad", "m")}`;
  return `${(value * (unit === "%" ? 100 : 1)).toFixed(digits)} ${unit}`.trim();
}
