/**
 * Where the person points, by mouse, touch, pen or arrow keys, in metres on the table.
 */
const FINGER = 44; // pixels of the style sheet by which a paddle stands off a finger, so that it can be seen
const KEY_SPEED = 1.6; // m/s
const KEYS = {
  ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
  KeyA: [-1, 0], KeyD: [1, 0], KeyW: [0, 1], KeyS: [0, -1],
};

export class Aim {
  #view;
  #held = new Set();
  #moved = 0;

  /**
   * @param {import("./view.js").View} view
   * @param {() => number[]} paddle - where the paddle is: arrow keys start from there.
   * @param {() => number[][]} reach - least and greatest x and y that arrow keys lead to.
   */
  constructor(view, paddle, reach) {
    this.#view = view;
    this.paddle = paddle;
    this.reach = reach;
    /** [x, y] in m, or null before anything was pointed at. */
    this.place = null;
    const canvas = view.canvas;
    // Raw updates come as the hand moves, the others only with the next picture; not all browsers have the former.
    for (const name of ["pointerdown", "pointermove", "pointerrawupdate"]) {
      canvas.addEventListener(name, (event) => this.#point(event));
    }
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("keydown", (event) => this.#press(event));
    canvas.addEventListener("keyup", (event) => this.#held.delete(event.code));
    canvas.addEventListener("blur", () => this.#held.clear());
  }

  /** Move on by the arrow keys that are held, up to now, s. */
  advance(now) {
    const elapsed = Math.min(now - this.#moved, 0.1);
    this.#moved = now;
    if (!this.#held.size) {
      return;
    }
    let [right, up] = [0, 0];
    for (const code of this.#held) {
      right += KEYS[code][0];
      up += KEYS[code][1];
    }
    const length = Math.hypot(right, up) || 1;
    const [x, y] = this.#view.upright ? [up, -right] : [right, up];
    const from = this.place ?? this.paddle();
    const way = (KEY_SPEED * elapsed) / length;
    const [least, most] = this.reach();
    this.place = [from[0] + x * way, from[1] + y * way].map((p, k) => Math.min(Math.max(p, least[k]), most[k]));
  }

  #point(event) {
    if (event.pointerType === "touch" && !event.isPrimary) {
      return;
    }
    let { clientX, clientY } = event;
    if (event.pointerType === "touch") {
      [clientX, clientY] = this.#view.upright ? [clientX, clientY - FINGER] : [clientX + FINGER, clientY];
    }
    this.place = this.#view.toTable(clientX, clientY);
  }

  #press(event) {
    if (event.code in KEYS && !event.ctrlKey && !event.metaKey && !event.altKey) {
      this.#held.add(event.code);
      event.preventDefault();
    }
  }
}
