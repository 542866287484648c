/** What was played in a match, and the replay file of it, which airhockey_env/replay reads. */
import { npz, textArray } from "./npz.js";

export class Recording {
  #game;
  #notes;
  #start;
  #end = null;
  #left = []; // actions
  #right = [];
  #recordsRight;

  /**
   * @param {import("./game.js").Game} game - that was just started.
   * @param {object} notes - of replays with each kind of opponent, JSON.
   * @param {string} opponent
   */
  constructor(game, notes, opponent) {
    this.#game = game;
    this.#recordsRight = opponent in game.facts.policies; // a replay knows what scripted players do
    this.#notes = notes[this.#recordsRight ? "policy" : opponent];
    this.#start = game.save();
  }

  /** Note the actions of the step that was just played. */
  add(left, right) {
    const limit = 2 * this.#game.facts.live.most_seconds * this.#game.facts.control_hz;
    if (this.#left.length < limit) {
      this.#left.push(...left);
      if (this.#recordsRight) {
        this.#right.push(...right);
      }
      if (this.#left.length === limit) {
        this.#end = this.#game.save();
      }
    }
  }

  /** The file. */
  bytes() {
    const { descr } = this.#game.facts.state;
    const bytes = (numbers) => new Uint8Array(Float32Array.from(numbers).buffer);
    return npz({
      replay: textArray(this.#notes),
      starts: ["'<i8'", [1], new Uint8Array(8)],
      states: [descr, [1], this.#start],
      ends: [descr, [1], this.#end ?? this.#game.save()],
      actions: ["'<f4'", [this.#left.length / 2, 2], bytes(this.#left)],
      right_actions: ["'<f4'", [this.#right.length / 2, 2], bytes(this.#right)],
    });
  }
}
