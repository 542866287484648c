/** Where a person points, between the moments at which it is reported: airhockey_env/live/pointer.py in JavaScript. */

/** What is left of a velocity along one axis: one that gets slower is taken to go on doing so. */
function kept(latest, earlier) {
  if (latest * earlier <= 0) {
    return 0;
  }
  if (Math.abs(latest) > Math.abs(earlier)) {
    return earlier;
  }
  const slower = 2 * latest - earlier;
  return slower * latest > 0 ? slower : 0;
}

export class Pointer {
  #path = []; // [s, [m, m]]

  /** @param {{grasp: number, memory: number}} live - constants of game.json, s. */
  constructor({ grasp, memory }) {
    this.grasp = grasp;
    this.memory = memory;
  }

  /** Whether it has been anywhere. */
  get known() {
    return this.#path.length > 0;
  }

  /** Note where the pointer is now. */
  move(now, place) {
    this.#path.push([now, place]);
    while (this.#path.length > 2 && this.#path[1][0] < now - this.memory) {
      this.#path.shift();
    }
  }

  /** Where it was; between two reports on the straight line between them. */
  place(time) {
    let after = this.#path.at(-1);
    for (const before of this.#path.toReversed()) {
      if (before[0] <= time) {
        const share = time >= after[0] ? 1 : (time - before[0]) / (after[0] - before[0]);
        return before[1].map((place, axis) => place + share * (after[1][axis] - place));
      }
      after = before;
    }
    return after[1];
  }

  /** The velocity that it will keep as far as one can tell: that of the last two moments. */
  velocity(time) {
    const [now, before, earlier] = [0, 1, 2].map((k) => this.place(time - k * this.grasp));
    return now.map((p, axis) => kept((p - before[axis]) / this.grasp, (before[axis] - earlier[axis]) / this.grasp));
  }
}
