// Human weight and confidence over the time of a drive.

import { html, svg } from "./svg.js";

const [WIDTH, HEIGHT] = [300, 100];

// `rows` are [t, x, y, w, confidence, contact].
export function weightChart(rows) {
  const end = Math.max(rows.at(-1)?.[0] ?? 0, 1e-3);
  const line = (index) => {
    let pen = "M";
    return rows
      .map((row) => {
        if (row[index] === null) {
          pen = "M";
          return "";
        }
        const step = `${pen}${((WIDTH * row[0]) / end).toFixed(1)} ${(HEIGHT * (1 - row[index])).toFixed(1)}`;
        pen = "L";
        return step;
      })
      .join("");
  };
  const drawing = svg(
    "svg",
    {
      class: "chart",
      viewBox: `-2 -4 ${WIDTH + 4} ${HEIGHT + 8}`,
      preserveAspectRatio: "none",
      role: "img",
      "aria-label": `Share of the human and confidence of the agent over ${end.toFixed(1)} s`,
    },
    svg("path", { class: "grid", d: `M0 0H${WIDTH}M0 ${HEIGHT / 2}H${WIDTH}M0 ${HEIGHT}H${WIDTH}` }),
    svg("path", { class: "curve agent", d: line(4) }),
    svg("path", { class: "curve human", d: line(3) }),
  );
  const caption = html("figcaption");
  caption.append(
    html("span", { class: "key human" }, "human's share"),
    html("span", { class: "key agent" }, "agent's confidence"),
    html("span", { class: "axis" }, `0 to ${end.toFixed(1)} s, 0 to 100 %`),
  );
  return [drawing, caption];
}
