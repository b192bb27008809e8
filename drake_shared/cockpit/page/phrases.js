// What the page says: who drives, and why. Python chooses the reason (reasons.py); here are its sentences.

// For each reason what the driver reads, and what others read.
const REASONS = {
  contact: ["Contact: the robot touches an obstacle. Steer away from it.", "Contact: the robot touches an obstacle."],
  paused: ["Paused: the clock stands still. Press P to go on.", "Paused by the driver: the clock stands still."],
  kept_away: [
    "An obstacle is near: the robot goes no further towards it.",
    "An obstacle is near: the robot goes no further towards it.",
  ],
  hands_off: [
    "No input for a while: the robot stops. Move to go on.",
    "No input from the driver for a while: the robot stops.",
  ],
  no_learner: ["No learner for this scenario: you drive alone.", "No learner for this scenario: the driver is alone."],
  teaching: ["You teach: you drive alone.", "A demonstration: the driver is alone."],
  assistance_off: ["Assistance is off: you drive alone.", "Assistance is off: the driver is alone."],
  agent_alone: ["The agent drives alone, as set on the command line.", "The agent drives alone, as set on the command line."],
  no_prediction: ["The learner gives no prediction: you drive alone.", "The learner gives no prediction: the driver is alone."],
  conflict: [
    "You point elsewhere than the agent: you drive alone.",
    "The driver points elsewhere than the agent, and drives alone.",
  ],
  fixed_share: ["Each has one half: this arbiter does not ask how sure the agent is.", "Each has one half: this arbiter does not ask how sure the agent is."],
  steady: [
    "Your commands are steady: the robot follows them.",
    "The driver's commands are steady: the robot follows them.",
  ],
  smoothed: [
    "Your commands waver: the agent keeps to the route that you seem to mean.",
    "The driver's commands waver: the agent keeps to the route that they seem to mean.",
  ],
  off_demonstrations: [
    "Not sure: nobody has driven here in the demonstrations.",
    "Not sure: nobody has driven here in the demonstrations.",
  ],
  points_elsewhere: ["Not sure: you point away from the expected route.", "Not sure: the driver points away from the expected route."],
  routes_open: ["COUNT routes are still open: the agent waits for your choice.", "COUNT routes are still open: the agent waits for the driver's choice."],
  unsure: ["Not sure yet where you are heading.", "Not sure yet where the driver is heading."],
  follows_you: ["The agent recognises your route and helps.", "The agent recognises the driver's route and helps."],
  sure: ["The agent is sure of your route.", "The agent is sure of the driver's route."],
};
const COUNTS = ["No", "One", "Two", "Three", "Four", "Five", "Six"];

export const REASON_NAMES = Object.keys(REASONS);

// Why the control is divided as it is. `mine`: whether the reader drives.
export function why(reason, openRoutes, mine) {
  const [driver, others] = REASONS[reason] ?? ["", ""];
  return (mine ? driver : others).replace("COUNT", COUNTS[openRoutes] ?? "Several");
}

// Who drives, by the human's weight, in three steps.
export function who(level, mine, driven) {
  const name = mine ? "You" : driven ? "The driver" : "The simulated operator";
  const verb = mine ? "drive" : "drives";
  if (level === "human") return `${name} ${verb}.`;
  if (level === "both") return `${name} and the agent drive together.`;
  return mine ? "The agent drives, you can take over." : `The agent drives for ${name.toLowerCase()}.`;
}

// Step of the human's weight; near a limit it stays what it was, so that the words do not flicker.
export function levelOf(weight, before) {
  const slack = 0.05;
  if (weight > 0.75 + (before === "human" ? -slack : slack)) return "human";
  if (weight < 0.25 + (before === "agent" ? slack : -slack)) return "agent";
  return "both";
}
