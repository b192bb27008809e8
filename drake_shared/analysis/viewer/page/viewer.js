"use strict";

const PAGE = 200; // Rows of the table that are made at once.
const MOST_LAID_OVER = 8;
const $ = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
// Trials that lie over each other differ in colour and in dash pattern.
const DASHES = ["", "7 3", "2 3", "10 3 2 3", "4 2", "12 4", "1 3", "6 2 2 2"];
// The dashed lines come last and lie on top.
const DRIVERS = { shared: "Shared", autonomous: "Agent", human: "Human" };
const COLOURS = { human: "var(--human)", autonomous: "var(--agent)", shared: "var(--shared)" };
const CURVES = {
  human_weight: ["Human weight w", "1: the human drives, 0: the agent drives", "var(--human)"],
  confidence: ["Confidence c_f", "of the agent, from 0 to 1", "var(--agent)"],
};

const state = {
  rows: [], skipped: {}, files: 0, complete: false,
  shown: PAGE, sort: "name", down: false,
  chosen: [], details: new Map(), shownKey: "",
};

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") made.className = value;
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value !== null && value !== false) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}

function shape(name, attributes, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// ---- The table

function isGood(row) {
  return row.status === "reached";
}

function kept() {
  const search = $("search").value.trim().toLowerCase();
  const wanted = ["status", "driver", "route"].map((name) => [name, $(name).value]);
  return state.rows
    .map((row, id) => [row, id])
    .filter(([row]) => (!search || row.name.toLowerCase().includes(search))
      && wanted.every(([name, value]) => value === "*" || (row[name] || "") === value))
    .sort(([a, i], [b, j]) => order(a, b) * (state.down ? -1 : 1) || i - j);
}

function order(a, b) {
  const [x, y] = [a[state.sort] ?? "", b[state.sort] ?? ""];
  if (typeof x === "number" && typeof y === "number") return x - y;
  return String(x).localeCompare(String(y), "en", { numeric: true });
}

function fillFilters() {
  for (const name of ["status", "driver", "route"]) {
    const select = $(name);
    const before = select.value || "*";
    const counts = new Map();
    for (const row of state.rows) counts.set(row[name] || "", (counts.get(row[name] || "") || 0) + 1);
    const options = [...counts].sort((a, b) => a[0].localeCompare(b[0]));
    select.replaceChildren(
      element("option", { value: "*" }, `all (${state.rows.length})`),
      ...options.map(([value, count]) => element("option", { value }, `${value || "none"} (${count})`)),
    );
    select.value = counts.has(before) ? before : "*";
  }
}

function fillTable() {
  const found = kept();
  $("count").textContent = found.length === state.rows.length
    ? `${found.length} in all` : `${found.length} of ${state.rows.length}`;
  $("rows").replaceChildren(...found.slice(0, state.shown).map(([row, id]) => tableRow(row, id)));
  $("more").hidden = found.length <= state.shown;
  for (const head of document.querySelectorAll("th[data-sort]")) {
    if (head.dataset.sort === state.sort) head.setAttribute("aria-sort", state.down ? "descending" : "ascending");
    else head.removeAttribute("aria-sort");
  }
}

function shortName(row) {
  return row.name.replace(/\.parquet(?=$|[:#])/, "");
}

function tableRow(row, id) {
  const chosen = state.chosen.includes(id);
  const tick = element("input", {
    type: "checkbox", "aria-label": `Lay over: ${row.name}`, onchange: () => toggle(id),
  });
  tick.checked = chosen;
  const status = row.status
    ? element("span", { class: isGood(row) ? "good" : "bad" }, row.status)
    : element("span", {}, row.kind);
  return element("tr", {
    class: "choosable", "aria-selected": String(chosen),
    onclick: (event) => { if (event.target !== tick) choose(id); },
  },
  element("td", {}, tick),
  element("td", { class: "name" }, element("button", { type: "button", title: row.name }, shortName(row))),
  element("td", {}, status),
  element("td", {}, row.driver),
  element("td", {}, row.route || "–"),
  element("td", { class: "number" }, row.duration === null ? "" : `${row.duration.toFixed(1)} s`));
}

// ---- Choosing

function choose(id) {
  state.chosen = [id];
  update();
}

function toggle(id) {
  state.chosen = state.chosen.includes(id)
    ? state.chosen.filter((other) => other !== id) : [...state.chosen, id].slice(-MOST_LAID_OVER);
  update();
}

async function update() {
  fillTable();
  $("hint").hidden = state.chosen.length > 0;
  const chosen = [...state.chosen];
  const details = await Promise.all(chosen.map(detailsOf));
  if (chosen.join() !== state.chosen.join()) return; // Another choice was made in the meantime.
  show(chosen, details);
}

async function detailsOf(id) {
  if (!state.details.has(id)) state.details.set(id, await fetchDetails(id));
  return state.details.get(id);
}

async function fetchDetails(id) {
  if (EMBEDDED) {
    return EMBEDDED.details[id]
      ?? { error: "This file holds no curves of it. Run drake-shared show with its log." };
  }
  try {
    return await (await fetch(`details?id=${id}`)).json();
  } catch {
    return { error: "The program drake-shared show has ended." };
  }
}

// ---- One trial, or several

function show(ids, details) {
  $("view").hidden = ids.length === 0;
  if (!ids.length) return;
  const rows = ids.map((id) => state.rows[id]);
  const good = details.map((item, index) => ({ ...item, row: rows[index], index })).filter((item) => !item.error);
  const broken = details.map((item, index) => item.error && `${rows[index].name}: ${item.error}`).filter(Boolean);
  const single = ids.length === 1;
  $("title").textContent = single ? shortName(rows[0]) : `${ids.length} trials`;
  const told = single
    ? [rows[0].status || rows[0].kind, rows[0].driver, rows[0].route && `route ${rows[0].route}`, rows[0].scenario,
      rows[0].seed !== null && `seed ${rows[0].seed}`] : [];
  const thinned = good.some((item) => item.thinned) && "long logs are thinned out";
  $("subtitle").textContent = [...told, thinned, ...broken].filter(Boolean).join(" · ");
  drawLegend(good, single);
  drawMap(good, single);
  drawCharts(good, single);
  drawFigures(good);
}

function lineOf(item, single) {
  const index = item.index % DASHES.length;
  return single ? ["var(--accent)", ""] : [`var(--series-${index})`, DASHES[index]];
}

function sample(colour, dash) {
  return shape("svg", { viewBox: "0 0 26 10", class: "sample", "aria-hidden": "true" },
    shape("line", { x1: 0, y1: 5, x2: 26, y2: 5, stroke: colour, "stroke-width": 3, "stroke-dasharray": dash }));
}

function drawLegend(items, single) {
  const entries = [];
  if (!single) for (const item of items) entries.push([...lineOf(item, single), `${item.index + 1}: ${shortName(item.row)}`]);
  else if (items.some((item) => item.curves.human_weight)) {
    entries.push(["var(--human)", "", "the human drives"], ["var(--shared)", "", "shared"],
      ["var(--agent)", "", "the agent drives"]);
  }
  $("legend").replaceChildren(
    ...entries.map(([colour, dash, text]) => element("span", {}, sample(colour, dash), text)));
}

function bounds(items) {
  let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
  const add = (x, y) => {
    if (x === null || y === null) return;
    [left, right, low, high] = [Math.min(left, x), Math.max(right, x), Math.min(low, y), Math.max(high, y)];
  };
  for (const item of items) {
    if (item.scene.workspace) {
      const [x0, x1, y0, y1] = item.scene.workspace;
      add(x0, y0);
      add(x1, y1);
    }
    item.path[0].forEach((x, index) => add(x, item.path[1][index]));
  }
  if (left === Infinity) return [0, 1, 0, 1];
  const margin = 0.03 * Math.max(right - left, high - low, 1e-3);
  return [left - margin, right + margin, low - margin, high + margin];
}

function drawMap(items, single) {
  const map = $("map");
  map.replaceChildren();
  if (!items.length) { map.style.height = "0"; return; }
  const [left, right, low, high] = bounds(items);
  const width = Math.max(map.clientWidth || 700, 260);
  const scale = Math.min(width / (right - left), 460 / (high - low));
  const height = Math.max((high - low) * scale, 120);
  const pad = (width - (right - left) * scale) / 2;
  const X = (x) => pad + (x - left) * scale;
  const Y = (y) => height - (y - low) * scale;
  map.style.height = `${height}px`;
  map.setAttribute("viewBox", `0 0 ${width} ${height}`);
  drawScene(map, items[0].scene, X, Y, scale);
  for (const item of items) {
    for (const [d, colour] of pieces(item, single, X, Y)) {
      const dash = single ? "" : lineOf(item, single)[1];
      map.append(shape("path", {
        d, fill: "none", stroke: colour, "stroke-width": 2.5, "stroke-linejoin": "round", "stroke-dasharray": dash,
      }));
    }
    drawMarks(map, item, X, Y);
  }
  const metre = niceStep((right - left) / 5);
  map.append(
    shape("line", { x1: 12, x2: 12 + metre * scale, y1: height - 12, y2: height - 12, stroke: "var(--soft)", "stroke-width": 2 }),
    shape("text", { x: 16 + metre * scale, y: height - 8 }, `${metre} m`));
  map.append(shape("circle", { id: "dot", r: 5, fill: "var(--ink)", visibility: "hidden" }));
  map.place = (x, y) => [X(x), Y(y)];
}

function drawScene(map, scene, X, Y, scale) {
  if (!scene.workspace) return;
  const [x0, x1, y0, y1] = scene.workspace;
  map.append(shape("rect", {
    x: X(x0), y: Y(y1), width: (x1 - x0) * scale, height: (y1 - y0) * scale, fill: "none", stroke: "var(--line)",
  }));
  for (const route of scene.routes) {
    const d = route.path.map(([x, y], index) => `${index ? "L" : "M"}${X(x).toFixed(1)} ${Y(y).toFixed(1)}`).join("");
    map.append(shape("path", { d, fill: "none", stroke: "var(--routes)", "stroke-width": 1.5 },
      shape("title", {}, `route ${route.name}`)));
  }
  for (const item of scene.obstacles) {
    const style = { fill: "var(--obstacle)", "fill-opacity": item.moves ? 0.4 : 0.85 };
    const title = shape("title", {}, item.name + (item.moves ? " (moves; where it is at the start)" : ""));
    map.append(item.radius !== undefined
      ? shape("circle", { cx: X(item.x), cy: Y(item.y), r: item.radius * scale, ...style }, title)
      : shape("rect", {
        x: X(item.x) - item.length * scale / 2, y: Y(item.y) - item.width * scale / 2,
        width: item.length * scale, height: item.width * scale,
        transform: `rotate(${-item.yaw * 180 / Math.PI} ${X(item.x)} ${Y(item.y)})`, ...style,
      }, title));
  }
  for (const { x, y, radius, name } of scene.goals) {
    map.append(
      shape("circle", { cx: X(x), cy: Y(y), r: radius * scale, fill: "var(--goal)", "fill-opacity": 0.2, stroke: "var(--goal)" }),
      shape("text", { x: X(x), y: Y(y) - radius * scale - 5, "text-anchor": "middle" }, name));
  }
  const [sx, sy] = scene.start;
  map.append(
    shape("circle", { cx: X(sx), cy: Y(sy), r: scene.robot * scale, fill: "none", stroke: "var(--soft)", "stroke-dasharray": "3 3" }),
    shape("text", { x: X(sx), y: Y(sy) - scene.robot * scale - 5, "text-anchor": "middle" }, "start"));
}

// The path as SVG paths, one for each stretch of the same colour. A gap in the data is a gap.
function pieces(item, single, X, Y) {
  const weight = single ? item.curves.human_weight : undefined;
  const colourAt = (index) => {
    if (!weight) return lineOf(item, single)[0];
    const w = weight[index];
    return w === null || w > 0.7 ? "var(--human)" : w < 0.3 ? "var(--agent)" : "var(--shared)";
  };
  const made = [];
  const [xs, ys] = item.path;
  for (let index = 0; index < xs.length; index += 1) {
    const known = xs[index] !== null && ys[index] !== null;
    const before = index > 0 && xs[index - 1] !== null && ys[index - 1] !== null;
    if (!known) continue;
    const point = `${X(xs[index]).toFixed(1)} ${Y(ys[index]).toFixed(1)}`;
    const last = made.at(-1);
    const colour = colourAt(Math.max(index - 1, 0));
    if (before && last && last[1] === colour) last[0] += `L${point}`;
    else if (before) made.push([`M${X(xs[index - 1]).toFixed(1)} ${Y(ys[index - 1]).toFixed(1)}L${point}`, colour]);
    else made.push([`M${point}l0.01 0`, colour]);
  }
  return made;
}

function drawMarks(map, item, X, Y) {
  for (const [x, y] of item.marks.least_clearance) {
    map.append(shape("circle", { cx: X(x), cy: Y(y), r: 5, fill: "none", stroke: "var(--ink)", "stroke-width": 1.5 },
      shape("title", {}, "least clearance")));
  }
  for (const [x, y] of item.marks.contact) {
    const d = `M${X(x) - 6} ${Y(y) - 6}l12 12m0 -12l-12 12`;
    map.append(shape("path", { d, stroke: "var(--bad)", "stroke-width": 3 }, shape("title", {}, "first contact")));
  }
}

// ---- Curves over time

function drawCharts(items, single) {
  const charts = [];
  for (const [name, [title, meaning, colour]] of Object.entries(CURVES)) {
    const series = items.filter((item) => item.curves[name]).map((item) => ({
      item, values: item.curves[name], name: shortName(item.row),
      colour: single ? colour : lineOf(item, single)[0], dash: single ? "" : lineOf(item, single)[1],
    }));
    if (series.length) charts.push(chart(title, meaning, series, [0, 1]));
  }
  const clearance = items.filter((item) => item.curves.clearance?.some((value) => value !== null));
  if (clearance.length) {
    charts.push(chart("Clearance [m]", "from the robot's body to the nearest obstacle", clearance.map((item) => ({
      item, values: item.curves.clearance, name: shortName(item.row), colour: lineOf(item, single)[0], dash: lineOf(item, single)[1],
    }))));
  }
  items[0]?.command_names.forEach((name, element) => {
    const who = single ? Object.keys(DRIVERS) : ["shared"];
    const series = items.flatMap((item) => who.filter((key) => item.commands[key]?.[element]).map((key) => ({
      item, values: item.commands[key][element],
      name: single ? DRIVERS[key] : shortName(item.row),
      colour: single ? COLOURS[key] : lineOf(item, single)[0],
      dash: single ? { human: "6 3", autonomous: "2 3", shared: "" }[key] : lineOf(item, single)[1],
    })));
    if (series.length) charts.push(chart(`Command ${name}`, single ? "" : "shared command", series));
  });
  $("charts").replaceChildren(...charts);
}

function chart(title, meaning, series, range) {
  const [width, height, left, right, bottom] = [$("map").clientWidth || 700, 140, 40, 8, 20];
  const finite = series.flatMap((one) => one.values.filter((value) => value !== null));
  let [low, high] = range ?? [Math.min(0, ...finite), Math.max(0, ...finite)];
  if (!(high > low)) [low, high] = [low - 0.5, high + 0.5];
  const end = Math.max(...series.map((one) => one.item.t.at(-1) ?? 0), 1e-3);
  const X = (t) => left + t / end * (width - left - right);
  const Y = (value) => 6 + (high - value) / (high - low) * (height - bottom - 6);
  const drawing = shape("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${title} over time` });
  for (const value of ticks(low, high, 4)) {
    drawing.append(shape("line", { x1: left, x2: width - right, y1: Y(value), y2: Y(value), stroke: "var(--line)" }),
      shape("text", { x: left - 6, y: Y(value) + 4, "text-anchor": "end" }, String(value)));
  }
  for (const t of ticks(0, end, width / 90)) {
    drawing.append(shape("text", { x: X(t), y: height - 4, "text-anchor": "middle" }, `${t} s`));
  }
  for (const one of series) {
    let d = "";
    let open = false;
    one.values.forEach((value, index) => {
      if (value === null) { open = false; return; }
      d += `${open ? "L" : "M"}${X(one.item.t[index]).toFixed(1)} ${Y(value).toFixed(1)}`;
      open = true;
    });
    if (d) drawing.append(shape("path", { d, fill: "none", stroke: one.colour, "stroke-width": 1.8, "stroke-dasharray": one.dash }));
  }
  const cursor = shape("line", { y1: 6, y2: height - bottom, stroke: "var(--ink)", visibility: "hidden", class: "cursor" });
  drawing.append(cursor);
  const readout = element("p", {}, meaning);
  drawing.addEventListener("pointermove", (event) => {
    const box = drawing.getBoundingClientRect();
    const t = Math.min(Math.max(((event.clientX - box.left) / box.width * width - left) / (width - left - right), 0), 1) * end;
    point(t);
    readout.textContent = `${t.toFixed(2)} s: ` + series.map((one) => {
      const value = one.values[nearest(one.item.t, t)];
      return `${one.name} ${value === null || value === undefined ? "unknown" : value.toPrecision(3)}`;
    }).join(", ");
  });
  drawing.addEventListener("pointerleave", () => { point(null); readout.textContent = meaning; });
  drawing.show = (t) => {
    cursor.setAttribute("visibility", t === null || t > end ? "hidden" : "visible");
    if (t !== null) { cursor.setAttribute("x1", X(t)); cursor.setAttribute("x2", X(t)); }
  };
  const names = Object.values(DRIVERS).includes(series[0].name)
    ? series.map((one) => element("span", {}, sample(one.colour, one.dash), ` ${one.name} `)) : [];
  return element("div", { class: "chart" }, element("h3", {}, title, " ", ...names), drawing, readout);
}

// Shows a time in all curves, and where the robot of the first trial is then.
function point(t) {
  for (const drawing of document.querySelectorAll(".chart > svg")) drawing.show(t);
  const dot = $("dot");
  const item = state.details.get(state.chosen[0]);
  if (!dot || !item || item.error) return;
  const index = t === null ? -1 : nearest(item.t, t);
  const known = index >= 0 && item.path[0][index] !== null && item.path[1][index] !== null;
  dot.setAttribute("visibility", known ? "visible" : "hidden");
  if (known) {
    const [x, y] = $("map").place(item.path[0][index], item.path[1][index]);
    dot.setAttribute("cx", x);
    dot.setAttribute("cy", y);
  }
}

function nearest(times, t) {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < t) low = middle + 1;
    else high = middle;
  }
  return low > 0 && t - times[low - 1] < times[low] - t ? low - 1 : low;
}

function niceStep(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return Number([1, 2, 5, 10].map((factor) => factor * power).find((value) => value >= step * 0.999).toPrecision(3));
}

function ticks(low, high, count) {
  const step = niceStep((high - low) / count);
  const found = [];
  for (let index = Math.ceil(low / step - 1e-9); index * step <= high + 1e-9 * step; index += 1) {
    found.push(Number((index * step).toPrecision(6)));
  }
  return found;
}

// ---- Figures

function drawFigures(items) {
  const names = [...new Set(items.flatMap((item) => item.figures.map((figure) => figure.name)))];
  const head = element("tr", {}, element("th", { scope: "col" }, "Figure"),
    ...items.map((item) => element("th", { scope: "col", class: "number" }, items.length === 1 ? "Value" : `${item.index + 1}`)),
    element("th", { scope: "col" }, "Unit"), element("th", { scope: "col" }, "Better"));
  const body = names.map((name) => {
    const found = items.map((item) => item.figures.find((figure) => figure.name === name));
    const known = found.find(Boolean);
    const title = element("td", {}, name.replaceAll("_", " "), element("small", {}, known.meaning.replaceAll("`", "")));
    return element("tr", {}, title,
      ...found.map((figure) => element("td", { class: "number" }, text(figure?.value))),
      element("td", {}, known.unit), element("td", {}, known.better));
  });
  $("figures").replaceChildren(element("thead", {}, head), element("tbody", {}, ...body));
}

function text(value) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? "yes" : "no";
  return Number(value.toPrecision(4)).toString();
}

// ---- Reading

async function read() {
  if (EMBEDDED) {
    Object.assign(state, { rows: EMBEDDED.rows, skipped: EMBEDDED.skipped, complete: true });
    refresh();
    return;
  }
  while (!state.complete) {
    let answer;
    try {
      answer = await (await fetch(`rows?from=${state.rows.length}`)).json();
    } catch {
      $("summary").textContent = "The program drake-shared show has ended.";
      return;
    }
    state.rows.push(...answer.rows);
    Object.assign(state, { files: answer.files, complete: answer.complete, skipped: answer.skipped });
    refresh();
    if (!state.complete && !answer.rows.length) await new Promise((resolve) => { setTimeout(resolve, 150); });
  }
}

function refresh() {
  const logs = state.rows.filter((row) => row.kind === "log").length;
  const skipped = Object.keys(state.skipped).length;
  $("summary").textContent = [
    `${logs} trials, ${state.rows.length - logs} demonstrations`,
    state.complete ? "" : `reading ${state.files} files…`,
    EMBEDDED && Object.keys(EMBEDDED.details).length < state.rows.length
      ? `this file holds the curves of the first ${Object.keys(EMBEDDED.details).length}` : "",
    skipped ? `${skipped} ${skipped === 1 ? "file holds" : "files hold"} neither` : "",
  ].filter(Boolean).join(" · ");
  $("summary").title = Object.values(state.skipped).slice(0, 20).join("\n");
  fillFilters();
  fillTable();
  if (!state.chosen.length && state.rows.length && state.complete) choose(0);
}

function setTheme(name) {
  document.documentElement.dataset.theme = name;
}

for (const name of ["search", "status", "driver", "route"]) {
  $(name).addEventListener("input", () => { state.shown = PAGE; fillTable(); });
}
$("more").addEventListener("click", () => { state.shown += PAGE; fillTable(); });
for (const head of document.querySelectorAll("th[data-sort]")) {
  head.addEventListener("click", () => {
    state.down = state.sort === head.dataset.sort && !state.down;
    state.sort = head.dataset.sort;
    fillTable();
  });
}
$("theme").addEventListener("click", () => {
  setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
});
let resizing;
addEventListener("resize", () => { clearTimeout(resizing); resizing = setTimeout(update, 100); });
setTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
read();
