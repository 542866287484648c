/** Energy and momentum of the three tables over time. */
import { Chart } from "./chart.js";

const MOST = 300; // points of a line; beyond that every other one is forgotten
const PAUSE = 0.2; // s between two drawings

export class Plots {
  #rows = [];
  #drawn = 0;
  #every = 1;
  #skipped = 0;

  /** @param {HTMLElement} place - where the charts go. */
  constructor(place) {
    this.charts = { energy: new Chart("Kinetic energy, J", null, "seconds"), momentum: new Chart("Total momentum, N s", null, "seconds") };
    place.append(...Object.values(this.charts).map((chart) => chart.figure));
  }

  /** Forget everything: time begins again. */
  clear() {
    this.#rows = [];
    this.#every = 1;
  }

  /** Take in a state of the server. */
  push(state) {
    if (this.#rows.length && state.elapsed <= this.#rows.at(-1).elapsed) {
      return;
    }
    this.#skipped += 1;
    if (this.#skipped >= this.#every) {
      this.#skipped = 0;
      this.#rows.push({ elapsed: state.elapsed, energy: state.energy, momentum: state.momentum });
    }
    if (this.#rows.length > MOST) {
      this.#rows = this.#rows.filter((_, k) => k % 2 === 0);
      this.#every *= 2;
    }
  }

  /** Draw, but not with every picture. */
  draw(now, methods) {
    if (now - this.#drawn < PAUSE || !this.#rows.length) {
      return;
    }
    this.#drawn = now;
    const goal = this.#rows.at(-1).elapsed;
    for (const [what, chart] of Object.entries(this.charts)) {
      const most = Math.max(...this.#rows.flatMap((row) => row[what]));
      chart.range = [0, 1.1 * most || 1];
      const lines = methods.map((label, k) => ({ label, bands: [], points: this.#rows.map((row) => [row.elapsed, row[what][k]]) }));
      chart.show(lines, goal);
    }
  }
}
