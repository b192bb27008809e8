// Describes the result of a trial.

const OUTCOMES = {
  reached: "Goal reached",
  timed_out: "Time is up",
  stopped: "Stopped",
  page_closed: "Driver lost",
  interrupted: "Interrupted",
  failed: "Failed",
};

// Name on the page, field of the result, digits, unit, and meaning.
const METRICS = [
  ["Time", "time", 1, "s", "From the first move to the end of the trial"],
  ["Your share", "mean_human_weight", 0, "%", "Mean weight of the human's command"],
  ["Effort", "human_effort", 0, "rad", "The human command, integrated over time"],
  ["Disagreement", "disagreement_rate", 1, "rad/s", "Mean difference between human and autonomous command"],
  ["Least clearance", "clearance", 2, "m", "Distance of the robot's body from the nearest obstacle"],
  ["Path", "path_length", 2, "m", "Length of the driven path"],
  ["Smoothness", "smoothness", 2, "", "SPARC of the speed; nearer 0 is smoother"],
];

export function describe(result) {
  const outcome = OUTCOMES[result.status] ?? result.status;
  return result.collision ? `${outcome}, with contact` : outcome;
}

export function listMetrics(list, result, driven) {
  list.replaceChildren();
  for (const [name, key, digits, unit, meaning] of METRICS) {
    const cell = document.createElement("div");
    const term = document.createElement("dt");
    const value = document.createElement("dd");
    cell.title = meaning;
    term.textContent = name === "Your share" && !driven ? "Human's share" : name;
    const number = key in result && result[key] !== null ? result[key] * (unit === "%" ? 100 : 1) : null;
    value.textContent = number === null ? "–" : number.toFixed(digits);
    if (number !== null && unit) {
      const small = document.createElement("small");
      small.textContent = ` ${unit}`;
      value.append(small);
    }
    cell.append(term, value);
    list.append(cell);
  }
}
