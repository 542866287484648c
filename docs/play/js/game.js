/** The game in WebAssembly (docs/play/match.c), and the facts about the package that it needs (docs/play/page.py). */

/** What can happen in a step, by the number that `step` returns. */
export const HAPPENINGS = ["", "goal", "conceded", "foul"];

async function fetched(name) {
  const answer = await fetch(new URL(`../${name}`, import.meta.url));
  if (!answer.ok) {
    throw new Error(`the file ${name} could not be loaded`);
  }
  return answer;
}

export class Game {
  #wasm;
  #policies = new Map(); // arguments of setPolicy

  /** Load the game and its policies. */
  static async load() {
    const [code, facts] = await Promise.all([
      fetched("game.wasm").then((answer) => answer.arrayBuffer()),
      fetched("game.json").then((answer) => answer.json()),
    ]);
    const game = new Game((await WebAssembly.instantiate(code)).instance.exports, facts);
    await Promise.all(Object.keys(facts.policies).map((name) => game.#loadPolicy(name)));
    return game;
  }

  constructor(wasm, facts) {
    this.#wasm = wasm;
    this.facts = facts;
    this.players = [...Object.keys(facts.policies), "striker"];
  }

  async #loadPolicy(name) {
    const weights = new Float32Array(await (await fetched(`${name}.bin`)).arrayBuffer());
    const { sizes, tanh, squash } = this.facts.policies[name];
    const layers = sizes.length - 1;
    const [weightsAt, sizesAt, roomAt] = [weights.length, sizes.length, 2 * Math.max(...sizes)].map((numbers) => {
      const at = this.#wasm.allocate(4 * numbers);
      if (!at) {
        throw new Error("there is not enough memory");
      }
      return at;
    });
    const { buffer } = this.#wasm.memory;
    new Float32Array(buffer, weightsAt, weights.length).set(weights);
    new Int32Array(buffer, sizesAt, sizes.length).set(sizes);
    this.#policies.set(name, [weightsAt, sizesAt, layers, tanh, squash, roomAt, this.facts.hold]);
  }

  /**
   * Begin a match.
   *
   * @param {object} match
   * @param {string} match.opponent - one of `players`.
   * @param {string} match.table - a name in `facts.tables`.
   * @param {number} match.points - that win it.
   * @param {number} match.skill - the share of its paddle's speed that the opponent uses.
   * @param {bigint} match.stream - the state of the random stream, 64 bits.
   */
  start({ opponent, table, points, skill, stream }) {
    const { parameters } = this.facts.tables[table];
    new Uint8Array(this.#wasm.memory.buffer, this.#wasm.parameters(), parameters.length).set(parameters);
    if (this.#policies.has(opponent)) {
      this.#wasm.setPolicy(...this.#policies.get(opponent));
    } else {
      this.#wasm.setStriker();
    }
    this.#wasm.start(stream, points, skill);
  }

  /** Play one step; [x, y] is the left player's action. Returns what happened, a number of `HAPPENINGS`. */
  step([x, y]) {
    return this.#wasm.step(x, y);
  }

  /** The bytes of the state, as of a record STATE of airhockey_env/kernel/state.py. */
  save() {
    return new Uint8Array(this.#wasm.memory.buffer, this.#wasm.save(), this.facts.state.size).slice();
  }

  /** The state: positions and velocities of left paddle, right paddle and puck, m and m/s, score, side and clock. */
  look() {
    const [memory, at] = [new DataView(this.#wasm.memory.buffer), this.#wasm.save()];
    const { places } = this.facts.state;
    const vectors = (place) =>
      [0, 16, 32].map((disc) => [0, 8].map((axis) => memory.getFloat64(at + place + disc + axis, true)));
    const whole = (place) => memory.getInt32(at + place, true);
    return {
      positions: vectors(places.position),
      velocities: vectors(places.velocity),
      score: [whole(places.score), whole(places.score + 4)],
      side: whole(places.side),
      clock: whole(places.clock),
      done: whole(places.done) !== 0,
    };
  }

  /** The contacts of the last step: whether the puck met a paddle or a wall, where along the table, and how hard. */
  contacts() {
    const [memory, first] = [new DataView(this.#wasm.memory.buffer), this.#wasm.contacts()];
    const { size, places } = this.facts.contact;
    return Array.from({ length: this.#wasm.contactCount() }, (_, k) => {
      const at = first + k * size;
      return {
        kind: memory.getInt32(at + places.b, true) < 0 ? "wall" : "paddle",
        x: memory.getFloat64(at + places.x, true),
        impulse: memory.getFloat64(at + places.impulse, true),
      };
    });
  }

  /** The present action of the trained player on the right. */
  answer() {
    return [...new Float32Array(this.#wasm.memory.buffer, this.#wasm.answer(), 2)];
  }
}
