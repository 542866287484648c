/** A match of a person against the clock on the wall: airhockey_env/live/match.py in JavaScript. */
import { HAPPENINGS } from "./game.js";
import { Hand } from "./hand.js";
import { Pointer } from "./pointer.js";
import { Recording } from "./recording.js";

export class Match {
  #game;
  #live; // constants: see airhockey_env/live
  #choice;
  #table;
  #tick;
  #hand;
  #pointer;
  #recording;
  #played; // the time on the wall up to which the game has been played, s
  #restUntil;
  #before; // the state before the last step
  #now; // and after it
  #shown; // what the page draws

  /**
   * @param {import("./game.js").Game} game
   * @param {object} choice - opponent, table, points and skill, as `Game.start` takes them.
   * @param {number} now - s, of a clock that never goes back.
   */
  constructor(game, choice, now) {
    this.#game = game;
    this.#live = game.facts.live;
    this.#choice = choice;
    this.#table = game.facts.tables[choice.table];
    this.#tick = 1 / game.facts.control_hz;
    this.#hand = new Hand(this.#table, this.#tick);
    this.restart(now);
  }

  /** Begin a new match; it is on after a short rest. */
  restart(now) {
    const [stream] = crypto.getRandomValues(new BigUint64Array(1));
    this.#game.start({ ...this.#choice, stream });
    this.#recording = new Recording(this.#game, this.#table.replays, this.#choice.opponent);
    this.#pointer = new Pointer(this.#live);
    this.#played = now;
    this.#before = this.#now = this.#game.look();
    this.#shown = this.#now;
    this.#rest(now + this.#live.start_pause, "start");
  }

  /** Rest until `resume` is called. A match that is over stays so. */
  pause() {
    if (!this.#now.done) {
      this.#rest(Infinity, "paused");
    }
  }

  /** Go on after `pause`, when a short rest is over. */
  resume(now) {
    if (this.notice === "paused") {
      this.#rest(now + this.#live.start_pause, "paused");
    }
  }

  /** The bytes of a replay of what was played. */
  replay() {
    return this.#recording.bytes();
  }

  /** Play up to a time on the wall, s; `pointer` is where the person points, m, or null. Returns what the page draws. */
  advance(now, pointer) {
    if (pointer) {
      this.#pointer.move(now, pointer);
    }
    if (this.notice && !this.#now.done && now >= this.#restUntil) {
      this.#played = Math.max(this.#played, this.#restUntil);
      this.#before = this.#now;
      this.notice = "";
    }
    this.#played = Math.max(this.#played, now - this.#live.most_behind);
    const events = [];
    while (!this.notice && now - this.#played >= this.#tick) {
      this.#played += this.#tick;
      this.#step(events);
    }
    if (!this.notice) {
      const share = (now - this.#played) / this.#tick;
      const positions = this.#now.positions.map((place, disc) =>
        place.map((p, axis) => this.#before.positions[disc][axis] + share * (p - this.#before.positions[disc][axis])),
      );
      this.#shown = { ...this.#now, positions };
    }
    const { positions, score, side, clock } = this.#shown;
    return { positions, score, clock: (side * clock) / this.#table.clock_limit, notice: this.notice, events };
  }

  #step(events) {
    const action = this.#action();
    const happened = HAPPENINGS[this.#game.step(action)];
    this.#recording.add(action, this.#game.answer());
    this.#before = this.#now;
    this.#now = this.#game.look();
    for (const { kind, x, impulse } of this.#game.contacts()) {
      events.push([kind, Math.min(Math.abs(impulse) / this.#table.hardest_impulse, 1), x]);
    }
    if (happened) {
      this.#stop(events, this.#now.done ? { goal: "won", conceded: "lost" }[happened] : happened);
    }
  }

  /** What the person's paddle does in the coming tick. */
  #action() {
    if (!this.#pointer.known) {
      return [0, 0];
    }
    const there = this.#pointer.place(this.#played);
    const target = this.#hand.reachable(there);
    // A pointer that is out of reach moves the paddle along the edge of its half only.
    const velocity = this.#pointer
      .velocity(this.#played)
      .map((v, axis) => (there[axis] === target[axis] ? this.#live.trust * v : 0));
    return this.#hand.follow(this.#now.positions[0], this.#now.velocities[0], target, velocity);
  }

  /** Rest on a picture of what ended the rally; the table has been laid for the serve already. */
  #stop(events, notice) {
    const { positions, velocities } = this.#before;
    const line = 0.5 * this.#table.dimensions.length;
    const [x, y] = positions[2].map((place, axis) => place + velocities[2][axis] * this.#tick);
    const puck = [Math.min(Math.max(x, -line), line), y];
    this.#shown = { ...this.#shown, positions: [positions[0], positions[1], puck], score: this.#now.score };
    events.push([notice, 1, puck[0]]);
    this.#rest(this.#played + this.#live[notice === "foul" ? "foul_pause" : "point_pause"], notice);
  }

  #rest(until, notice) {
    this.#restUntil = until;
    this.notice = notice;
  }
}
