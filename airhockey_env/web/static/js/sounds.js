/**
 * The sounds of a match, synthesised: nothing is loaded. They are off until `on` is set, in answer to a click.
 */
const QUIETEST = 0.02;

const TUNES = {
  goal: [[523.3, 659.3, 784.0], 0.09],
  conceded: [[392.0, 311.1], 0.09],
  foul: [[233.1, 233.1], 0.16],
  won: [[523.3, 659.3, 784.0, 1046.5], 0.12],
  lost: [[392.0, 349.2, 311.1, 261.6], 0.16],
};
const KNOCKS = { paddle: [1150, 55], wall: [420, 45] };

export class Sounds {
  #context = null;
  #on = false;

  get on() {
    return this.#on;
  }

  set on(on) {
    this.#on = on;
    if (on && this.#context === null) {
      this.#context = new AudioContext();
    }
    if (on) {
      this.#context.resume();
    }
  }

  /**
   * Play what happened: of each kind the strongest, from the side of the table where it happens.
   *
   * @param {Array} events - [kind, strength, x] each.
   * @param {number} length - of the table, m.
   */
  play(events, length) {
    if (!this.#on) {
      return;
    }
    const strongest = new Map();
    for (const event of events) {
      if (!(strongest.get(event[0])?.[1] >= event[1])) {
        strongest.set(event[0], event);
      }
    }
    for (const [kind, strength, x] of strongest.values()) {
      if (strength >= QUIETEST) {
        this.#sound(kind, Math.min(0.15 + strength, 1), Math.max(-1, Math.min(1, (2 * x) / length)));
      }
    }
  }

  #sound(kind, loud, side) {
    const context = this.#context;
    const out = new StereoPannerNode(context, { pan: 0.7 * side });
    out.connect(context.destination);
    const start = context.currentTime;
    if (kind in KNOCKS) {
      const [pitch, fade] = KNOCKS[kind];
      this.#tone(out, pitch, start, 3 / fade, 0.4 * loud);
      this.#tone(out, 2.76 * pitch, start, 2 / fade, 0.2 * loud);
    } else if (kind in TUNES) {
      const [pitches, apart] = TUNES[kind];
      pitches.forEach((pitch, k) => this.#tone(out, pitch, start + k * apart, 0.4, 0.3 * loud));
    }
  }

  #tone(out, pitch, start, seconds, loud) {
    const tone = new OscillatorNode(this.#context, { frequency: pitch });
    const gain = new GainNode(this.#context, { gain: 0 });
    gain.gain.setValueAtTime(0, start);
    gain.gain.linearRampToValueAtTime(loud, start + 0.002);
    gain.gain.exponentialRampToValueAtTime(0.001, start + seconds);
    tone.connect(gain).connect(out);
    tone.start(start);
    tone.stop(start + seconds);
  }
}
