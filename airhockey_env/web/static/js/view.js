/**
 * A canvas that shows a table as large as it can: along the longer side of the stage, in the screen's own pixels.
 *
 * Lengths are in metres and y is up, as in the engine. In a high stage the table is turned by 90 degrees, so that the
 * left player's goal is at the bottom.
 */
export class View {
  /** Width of the rail around the surface, m. */
  static RAIL = 0.1;
  /** What is left free around the rail, m. */
  static MARGIN = 0.02;

  #size = [2, 1];

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => void} changed - called when everything has another size or place.
   * @param {number} border - what is around the surface, m.
   */
  constructor(canvas, changed, border = View.RAIL + View.MARGIN) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.changed = changed;
    this.border = border;
    this.upright = false;
    this.scale = 1;
    new ResizeObserver(() => this.#fit()).observe(canvas);
  }

  /** Show a table of this length and width, m. */
  show(length, width) {
    this.#size = [length, width];
    this.#fit();
  }

  /** Pixels of the canvas for a place on the table. */
  toCanvas(x, y) {
    const { width, height } = this.canvas;
    return this.upright
      ? [0.5 * width - y * this.scale, 0.5 * height - x * this.scale]
      : [0.5 * width + x * this.scale, 0.5 * height - y * this.scale];
  }

  /** The place on the table under a point of the window, as in mouse events. */
  toTable(clientX, clientY) {
    const box = this.canvas.getBoundingClientRect();
    const right = ((clientX - box.left) / box.width - 0.5) * (this.canvas.width / this.scale);
    const up = (0.5 - (clientY - box.top) / box.height) * (this.canvas.height / this.scale);
    return this.upright ? [up, -right] : [right, up];
  }

  /** Pixels of the canvas for a pixel of the style sheet. */
  get ratio() {
    return this.canvas.width / Math.max(1, this.canvas.clientWidth);
  }

  #fit() {
    const canvas = this.canvas;
    const ratio = Math.min(window.devicePixelRatio || 1, 3);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    const [length, across] = this.#size.map((side) => side + 2 * this.border);
    const lying = Math.min(width / length, height / across);
    const standing = Math.min(height / length, width / across);
    this.upright = standing > lying;
    this.scale = Math.max(lying, standing);
    this.changed();
  }
}
