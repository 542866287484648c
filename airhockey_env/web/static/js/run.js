/**
 * The curves of a training run, which grow while it learns.
 */
import { Chart } from "./chart.js";

const EVERY = 3000; // ms

/** Charts: a title, the table of records, its columns with their labels, and the range of the vertical axis. */
const CHARTS = [
  ["Won in evaluations", "evaluations", { decided_win_rate: "decided points", win_rate: "all points", success_rate: "episodes" }, [0, 1]],
  ["Reward of an episode", "updates", { episode_reward: "" }, null],
  ["Length of an episode, steps", "updates", { episode_length: "" }, null],
  ["Entropy of the policy", "updates", { entropy: "" }, null],
];

export class RunCurves {
  #name = null;
  #charts = CHARTS.map(([title, , , range]) => new Chart(title, range));

  /**
   * @param {HTMLElement} place - the charts go in there.
   * @param {HTMLElement} note - says how far the run is.
   */
  constructor(place, note) {
    this.note = note;
    place.replaceChildren(...this.#charts.map((chart) => chart.figure));
    setInterval(() => document.hidden || this.#look(), EVERY);
  }

  /** Follow a run, by its name, instead of the one before. */
  follow(name) {
    if (name !== this.#name) {
      this.#name = name;
      this.#look();
    }
  }

  async #look() {
    const name = this.#name;
    try {
      const response = await fetch(`/run/${encodeURIComponent(name)}`);
      const records = response.ok ? await response.json() : null;
      if (records !== null && name === this.#name) {
        this.#show(records);
      }
    } catch {
      // The session says it when the server is gone.
    }
  }

  #show(records) {
    const steps = Math.max(0, ...["evaluations", "updates"].map((name) => records[name].at(-1)?.steps ?? 0));
    const number = (value) => value.toLocaleString("en");
    this.note.textContent = steps
      ? `${number(steps)} steps${records.goal ? ` of ${number(records.goal)}` : ""}`
      : "Nothing has been recorded yet";
    CHARTS.forEach(([, table, columns], k) => {
      const lines = Object.entries(columns).map(([column, label]) => {
        const rows = records[table].filter((row) => typeof row[column] === "number");
        return {
          label,
          points: rows.map((row) => [row.steps, row[column]]),
          bands: rows.filter((row) => row[`${column}_95`]).map((row) => [row.steps, ...row[`${column}_95`]]),
        };
      });
      this.#charts[k].show(lines, records.goal ?? 0);
    });
  }
}
