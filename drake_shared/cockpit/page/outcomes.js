// How a trial ended, by the status in its log.

export const OUTCOMES = {
  reached: "Goal reached",
  timed_out: "Time is up",
  stopped: "Stopped",
  page_closed: "Driver lost",
  interrupted: "Interrupted",
  failed: "Failed",
};
