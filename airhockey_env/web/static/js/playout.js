/**
 * What to draw when: between states that come over a network, at the times of the screen.
 *
 * States are drawn as late as it takes for the next one to be there already, and no later: the delay follows how old the
 * newest state has been in the last pictures. So the picture moves as evenly as the game, whatever the network does.
 */
const KEPT = 64;
const PICTURES = 24;
const FALL = 0.08; // of the delay's excess, with every picture
const DRIFT = 1e-4; // s a second by which two clocks may go apart

/** Two states mixed: positions between, everything else as in the later one. */
function between(before, after, share) {
  const positions = after.positions.map(([x, y], disc) => {
    const [x0, y0] = before.positions[disc];
    return [x0 + share * (x - x0), y0 + share * (y - y0)];
  });
  const elapsed = before.elapsed + share * (after.elapsed - before.elapsed); // where states say it
  return { ...after, positions, elapsed };
}

export class Playout {
  #states = [];
  #offset = null; // s: the server's clock less ours, less the way here
  #arrived = 0;
  #delay = 0;
  #ages = []; // s: of the newest state, in the last pictures

  /** Forget everything: another game begins. */
  clear() {
    this.#states = [];
    this.#offset = null;
    this.#delay = 0;
    this.#ages = [];
  }

  /**
   * Take in a state.
   *
   * @param {{time: number, positions: number[][], notice: string}} state - `time` in s of the server's clock.
   * @param {number} now - s of ours.
   */
  push(state, now) {
    const offset = state.time - now;
    const kept = this.#offset === null ? offset : this.#offset - DRIFT * (now - this.#arrived);
    this.#offset = Math.max(offset, kept);
    this.#arrived = now;
    this.#states.push(state);
    if (this.#states.length > KEPT) {
      this.#states.shift();
    }
  }

  /** The state to draw now, or null before the first one has come. */
  at(now) {
    const states = this.#states;
    if (!states.length) {
      return null;
    }
    const newest = states.at(-1);
    this.#ages.push(now + this.#offset - newest.time);
    if (this.#ages.length > PICTURES) {
      this.#ages.shift();
    }
    const oldest = Math.max(...this.#ages);
    this.#delay = Math.max(oldest, this.#delay - FALL * (this.#delay - oldest));
    const time = now + this.#offset - this.#delay;
    let k = states.length - 1;
    while (k > 0 && states[k - 1].time > time) {
      k -= 1;
    }
    if (k === 0 || states[k].time <= time) {
      return states[k];
    }
    const [before, after] = [states[k - 1], states[k]];
    if (before.notice !== after.notice) {
      return before; // a serve is no movement
    }
    return between(before, after, (time - before.time) / (after.time - before.time));
  }
}
