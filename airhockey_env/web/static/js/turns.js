/**
 * When to ask the server for the next state: so shortly before the next picture that the answer is still there in time.
 *
 * The page sends one message a picture, and none while it is hidden. A slow network only makes the answers older.
 */
const LEAST = 0.007; // s between two questions: 140 a second at most
const MOST_WAITING = 30; // questions without an answer

export class Turns {
  #ask;
  #sent = [];
  #last = 0;
  #round = 0.002; // s, a high estimate of the time to an answer
  #period = 1 / 60;
  #picture = 0;
  #timer = null;

  /** @param {() => void} ask - sends the question. */
  constructor(ask) {
    this.#ask = ask;
  }

  /** Note that a picture is drawn now, s, and plan the question for the next one. */
  picture(now) {
    const period = now - this.#picture;
    if (period > 0.002 && period < 0.1) {
      this.#period += 0.1 * (period - this.#period);
    }
    this.#picture = now;
    if (this.#timer === null) {
      const lead = Math.min(this.#round + 0.002, this.#period);
      this.#timer = setTimeout(() => this.#send(), 1000 * Math.max(0, this.#period - lead));
    }
  }

  /** Note that an answer has come, s. */
  answered(now) {
    if (this.#sent.length) {
      const round = now - this.#sent.shift();
      this.#round = Math.max(round, this.#round + 0.05 * (round - this.#round));
    }
  }

  /** Note that another question was sent, which will have an answer like the rest. */
  asked() {
    this.#sent.push(performance.now() / 1000);
  }

  /** Forget the questions without an answer: there is another session. */
  clear() {
    this.#sent = [];
  }

  #send() {
    this.#timer = null;
    const now = performance.now() / 1000;
    if (now - this.#last < LEAST || this.#sent.length >= MOST_WAITING) {
      return;
    }
    this.#last = now;
    this.#sent.push(now);
    this.#ask();
  }
}
