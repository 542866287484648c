/**
 * A replay that the server has played back: every state of it, to be drawn at any time.
 */
const ARRAYS = { "<f4": Float32Array, "<i4": Int32Array };

export class Trajectory {
  /** @param {ArrayBuffer} bytes - the answer to an upload: a line of JSON, and the arrays that it names. */
  constructor(bytes) {
    const all = new Uint8Array(bytes);
    const end = all.indexOf(10);
    const head = JSON.parse(new TextDecoder().decode(all.subarray(0, end)));
    Object.assign(this, head);
    let at = end + 1;
    for (const [name, type, shape] of head.arrays) {
      const size = 4 * shape.reduce((product, side) => product * side, 1);
      this[name] = new ARRAYS[type](bytes.slice(at, at + size));
      at += size;
    }
    this.states = this.clocks.length;
    this.begins = new Set(this.starts);
  }

  /** s of play. */
  get seconds() {
    return (this.states - 1) / this.control_hz;
  }

  /** What to draw at a time, s: positions, score, clock. */
  at(time) {
    const place = Math.min(Math.max(time * this.control_hz, 0), this.states - 1);
    const k = Math.min(Math.floor(place), Math.max(this.states - 2, 0));
    const next = Math.min(k + 1, this.states - 1);
    const share = this.begins.has(next) ? 0 : place - k; // a start is no movement
    const shown = share > 0.999 ? next : k;
    const position = (state, disc) => [this.positions[6 * state + 2 * disc], this.positions[6 * state + 2 * disc + 1]];
    return {
      positions: [0, 1, 2].map((disc) => {
        const [[x0, y0], [x1, y1]] = [position(k, disc), position(next, disc)];
        return [x0 + share * (x1 - x0), y0 + share * (y1 - y0)];
      }),
      score: [this.scores[2 * shown], this.scores[2 * shown + 1]],
      clock: this.clocks[shown],
    };
  }

  /** The contacts between two times, s, as `Marks` takes them. */
  contactsBetween(from, to) {
    const found = [];
    let k = this.#firstFrom(from);
    for (; 8 * k < this.contacts.length && this.contacts[8 * k] <= to * this.control_hz; k += 1) {
      const [state, ...contact] = this.contacts.subarray(8 * k, 8 * k + 8);
      found.push([state / this.control_hz, ...contact]);
    }
    return found;
  }

  #firstFrom(time) {
    let [low, high] = [0, this.contacts.length / 8];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.contacts[8 * middle] < time * this.control_hz) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low;
  }
}

/** Upload a replay file and have it played back. */
export async function playBack(file) {
  const response = await fetch("/replay", { method: "POST", body: file });
  if (!response.ok) {
    throw new Error((await response.text()).trim() || response.statusText);
  }
  return new Trajectory(await response.arrayBuffer());
}
