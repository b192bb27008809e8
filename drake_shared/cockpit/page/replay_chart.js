// Human weight and confidence over time, under the slider of the replay; contact is marked.

const NS = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [1000, 100];

export class ReplayChart {
  #cursor;
  #duration;

  // rows: columns of the log, as lists; duration in s.
  constructor(svg, rows, duration) {
    this.#duration = duration;
    svg.setAttribute("viewBox", `0 -4 ${WIDTH} ${HEIGHT + 8}`);
    const x = (time) => ((WIDTH * time) / duration).toFixed(1);
    const add = (className, d) => {
      const path = document.createElementNS(NS, "path");
      path.setAttribute("class", className);
      path.setAttribute("d", d);
      svg.append(path);
      return path;
    };
    add("frame", `M0 0H${WIDTH}M0 ${HEIGHT / 2}H${WIDTH}M0 ${HEIGHT}H${WIDTH}`);
    const contacts = (rows.contact ?? []).flatMap((contact, i) => (contact ? [rows.t[i]] : []));
    if (contacts.length) add("contact", contacts.map((time) => `M${x(time)} 0V${HEIGHT}`).join(""));
    for (const name of ["confidence", "human_weight"]) add(name, line(rows, name, x));
    this.#cursor = add("cursor", `M0 -4V${HEIGHT + 4}`);
  }

  show(time) {
    this.#cursor.setAttribute("transform", `translate(${(WIDTH * time) / this.#duration} 0)`);
  }
}

// A path with gaps where the column has no value.
function line(rows, name, x) {
  let pen = "M";
  let path = "";
  rows.t.forEach((time, i) => {
    const value = rows[name]?.[i] ?? null;
    if (value === null) pen = "M";
    else {
      path += `${pen}${x(time)} ${(HEIGHT * (1 - value)).toFixed(1)}`;
      pen = "L";
    }
  });
  return path;
}
