/**
 * The session of the page "Play", in the page itself: it takes the server's place and gives the same answers.
 *
 * docs/web.md describes the messages.
 */
import { Game } from "./game.js";
import { Match } from "./match.js";

function seconds() {
  return performance.now() / 1000;
}

export class Connection {
  #listeners = new Map();
  #game = null;
  #match = null;

  /** Call `listener` with every message of this type. Bytes are of type "bytes", the session's end is of type "end". */
  on(type, listener) {
    this.#listeners.set(type, listener);
  }

  /** Load the game; the first message is of type "hello". */
  async open() {
    try {
      this.#game = await Game.load();
    } catch (error) {
      this.#tell("end", { reason: error.message });
      return;
    }
    const { tables, palette } = this.#game.facts;
    const sizes = Object.fromEntries(Object.entries(tables).map(([name, table]) => [name, table.dimensions]));
    this.#tell("hello", { players: this.#game.players, tables: sizes, palette });
  }

  /** Whether messages can be sent. */
  get isOpen() {
    return this.#game !== null;
  }

  /** Answer a message, if the game is loaded. */
  send(type, fields = {}) {
    const now = seconds();
    if (type === "start" && this.isOpen) {
      this.#match = new Match(this.#game, fields, now);
      this.#tell("match", { ...fields, table: this.#game.facts.tables[fields.table].dimensions });
    } else if (type === "turn") {
      this.#tell("state", { time: now, ...this.#match.advance(now, fields.pointer) });
    } else if (type === "replay") {
      this.#tell("bytes", { data: this.#match.replay() });
    } else {
      this.#match?.[type](now); // restart, pause or resume
    }
  }

  #tell(type, fields) {
    this.#listeners.get(type)?.({ type, ...fields });
  }
}
