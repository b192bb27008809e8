// A participant's page: does what the server says, and sends the answers of each step.

const POLL = 1000; // ms, while the server prepares or the experimenter pauses
const HEARTBEAT = 2000; // ms; the link is kept while the page is open.
const PINGS = 9;

const at = (id) => document.getElementById(id);
const content = at("content");
sessionStorage.page ??= crypto.getRandomValues(new Uint32Array(4)).join("");
let shown = null; // The step that is on the page.

async function send(given = {}) {
  const answer = await fetch(`${location.pathname}/step`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ page: sessionStorage.page, ...given }),
  }).catch(() => null);
  if (!answer?.ok) {
    at("error").textContent = "The connection is lost; trying again…";
    setTimeout(() => send(given), POLL);
    return;
  }
  const next = await answer.json();
  at("error").textContent = next.error ?? "";
  show(next);
}

const ACTIONS = {
  ping: () => measure(),
  wait: (next) => say(next.text, () => setTimeout(send, POLL)),
  refused: (next) => say(next.text, () => setTimeout(send, 2 * POLL)),
  drive: (next) => location.assign(next.address),
  text: showText,
  questionnaire: showQuestionnaire,
};

function show(next) {
  if (next.progress !== undefined) at("progress").value = next.progress;
  const asks = ["text", "questionnaire"].includes(next.do);
  if (asks && next.step === shown) return; // A heartbeat: the participant reads or answers.
  shown = asks ? next.step : null;
  at("continue").hidden = at("withdraw").hidden = true;
  content.dataset.step = asks ? (next.step ?? "end") : next.do;
  ACTIONS[next.do](next);
}

function say(text, then) {
  content.textContent = text;
  then();
}

function showText(next) {
  content.innerHTML = next.html; // Rendered by the server from Markdown without HTML.
  at("withdraw").hidden = !next.consent;
  at("continue").textContent = next.consent ? "I agree" : "Continue";
  at("continue").hidden = next.step === null;
  at("continue").onclick = () => send({ step: next.step, answers: next.consent ? { agreed: true } : {} });
  at("withdraw").onclick = () => send({ withdraw: true });
  if (next.step === null) at("progress").value = 1;
}

Survey.settings.ratingMaximumRateValueCount = 100; // The default of 20 would cut scales from 0 to 20.

function showQuestionnaire(next) {
  // In an element of its own: a second questionnaire is not rendered over the first.
  const place = document.createElement("div");
  content.replaceChildren(place);
  const survey = new Survey.Model({ ...next.form, showCompletedPage: false, completeText: "Continue" });
  for (const question of survey.getAllQuestions()) {
    // A scale in one row under the names of its ends; a list to unfold would hide both.
    if (question.getType() === "rating") Object.assign(question, { displayMode: "buttons", rateDescriptionLocation: "top" });
  }
  survey.onComplete.add(() => send({ step: next.step, answers: survey.data }));
  survey.render(place);
}

// The median of some round trips, without the first, which opens the connection.
async function measure() {
  const times = [];
  for (let number = 0; number <= PINGS; number++) {
    const begun = performance.now();
    await fetch("/ping", { cache: "no-store" });
    if (number) times.push(performance.now() - begun);
  }
  times.sort((a, b) => a - b);
  send({ ping: times[(PINGS - 1) / 2] / 1000 });
}

setInterval(() => shown !== null && send(), HEARTBEAT);
send();
