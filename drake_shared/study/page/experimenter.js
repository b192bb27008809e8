// The experimenter's page: where every participant is, with notes, pause, exclusion and next.

const PERIOD = 2000; // ms
const rows = new Map();

async function send(given = {}) {
  const answer = await fetch(`${location.pathname}/state`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(given),
  }).catch(() => null);
  const state = answer?.ok ? await answer.json() : { participants: [], error: "The connection is lost." };
  document.getElementById("error").textContent = state.error ?? "";
  state.participants.forEach(show);
}

function show(found) {
  if (!rows.has(found.participant)) rows.set(found.participant, addRow(found));
  const [, progress, where, present, notes, actions] = rows.get(found.participant).cells;
  progress.textContent = `${found.completed} of ${found.steps}`;
  where.textContent = found.ended ?? found.where + (found.paused ? " (paused)" : "");
  const ping = found.ping === null ? "" : `, ${Math.round(1000 * found.ping)} ms`;
  present.textContent = (found.present ? "yes" : "no") + ping;
  notes.textContent = found.notes.join("; ");
  const over = found.ended !== null || found.where === "finished";
  actions.querySelectorAll("[data-do=pause], [data-do=next], [data-do=exclude]").forEach((button) => {
    button.disabled = over || (button.dataset.do === "pause" && found.paused);
    if (button.dataset.do === "next") button.disabled ||= !found.paused;
  });
}

function addRow({ participant, link }) {
  const row = document.getElementById("rows").insertRow();
  for (let number = 0; number < 6; number++) row.insertCell();
  const anchor = document.createElement("a");
  Object.assign(anchor, { href: link, textContent: participant });
  row.cells[0].append(anchor);
  for (const [action, question] of [["note", "Note"], ["pause"], ["next"], ["exclude", "Reason for the exclusion"]]) {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", className: "quiet", textContent: action });
    button.dataset.do = action;
    button.setAttribute("aria-label", `${action} ${participant}`);
    button.onclick = () => {
      const text = question ? prompt(`${question}, ${participant}:`) : "";
      if (text !== null) send({ participant, do: action, text });
    };
    row.cells[5].append(button, " ");
  }
  return row;
}

setInterval(send, PERIOD);
send();
