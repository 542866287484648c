/**
 * Draws a table, its paddles and its puck, with the colours that the server has (see airhockey_env/drawing).
 *
 * What does not move is drawn once into a canvas of its own, and so is every kind of disc.
 */
import { View } from "./view.js";

const TURN = 2 * Math.PI;
const LINE = 0.008; // m, like all that follow
const HOLE_SPACING = 0.05;
const HOLE_RADIUS = 0.0036;
const CENTRE_CIRCLE = 0.16;
const CREASE_MARGIN = 0.09;
const POCKET_DEPTH = 0.062;
const POST_RADIUS = 0.013;

/** A colour of the palette for the canvas. */
export function css([red, green, blue], alpha = 1) {
  return `rgb(${red} ${green} ${blue} / ${alpha})`;
}

/** The layers of a mallet: radius and shift as shares of its radius, softness, colour, alpha. */
function mallet(palette, side) {
  const [color, dark, light] = [palette[side], palette[`${side}_dark`], palette[`${side}_light`]];
  return [
    [1.06, 0.26, 0.55, palette.black, 0.42],
    [1.0, 0.0, 0.0, dark, 1.0],
    [0.93, -0.03, 0.0, color, 1.0],
    [0.74, 0.0, 0.0, dark, 0.55],
    [0.7, 0.02, 0.0, color, 1.0],
    [0.52, 0.14, 0.35, palette.black, 0.4],
    [0.44, 0.0, 0.0, dark, 1.0],
    [0.41, -0.03, 0.0, light, 1.0],
    [0.24, -0.12, 0.4, palette.white, 0.65],
  ];
}

/** The layers of a puck, likewise; its rim has the colour given. */
export function puckLayers(palette, rim = palette.puck_light) {
  return [
    [1.04, 0.16, 0.4, palette.black, 0.38],
    [1.0, 0.0, 0.0, palette.puck_dark, 1.0],
    [0.92, -0.03, 0.0, palette.puck, 1.0],
    [0.74, 0.0, 0.0, rim, 1.0],
    [0.54, 0.0, 0.0, palette.puck_dark, 1.0],
    [0.5, 0.02, 0.0, palette.puck, 1.0],
  ];
}

/** A picture of a disc of `radius` pixels, made of layers. */
export function discPicture(layers, radius) {
  const size = Math.ceil(2 * 1.7 * radius) + 2;
  const picture = new OffscreenCanvas(size, size);
  const context = picture.getContext("2d");
  for (const [share, down, softness, color, alpha] of layers) {
    const [x, y] = [0.5 * size, 0.5 * size + down * radius];
    const outer = (share + 0.5 * softness) * radius;
    if (softness > 0) {
      const fade = context.createRadialGradient(x, y, Math.max(0, (share - 0.5 * softness) * radius), x, y, outer);
      fade.addColorStop(0, css(color, alpha));
      fade.addColorStop(1, css(color, 0));
      context.fillStyle = fade;
    } else {
      context.fillStyle = css(color, alpha);
    }
    context.beginPath();
    context.arc(x, y, outer, 0, TURN);
    context.fill();
  }
  return picture;
}

export class Table {
  #view;
  #palette;
  #table = null;
  #ground = null;
  #discs = [];

  /**
   * @param {View} view
   * @param {Object<string, number[]>} palette - of the server's hello.
   */
  constructor(view, palette) {
    this.#view = view;
    this.#palette = palette;
  }

  /** Draw this table from now on: its length, width, goal_width, puck_radius and paddle_radius, m. */
  show(table) {
    this.#table = table;
    this.#view.show(table.length, table.width);
  }

  /** Make the pictures anew; the view calls this when its size has changed. */
  prepare() {
    if (this.#table === null) {
      return;
    }
    const { paddle_radius: paddle, puck_radius: puck } = this.#table;
    const scale = this.#view.scale;
    this.#discs = [
      discPicture(mallet(this.#palette, "left"), paddle * scale),
      discPicture(mallet(this.#palette, "right"), paddle * scale),
      discPicture(puckLayers(this.#palette), puck * scale),
    ];
    this.#ground = this.#drawGround();
  }

  /** Draw the table with its discs: left paddle, right paddle, puck, m. */
  draw(positions) {
    const { context, canvas } = this.#view;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(this.#ground, 0, 0);
    for (const disc of [2, 0, 1]) {
      const picture = this.#discs[disc];
      const [x, y] = this.#view.toCanvas(...positions[disc]);
      context.drawImage(picture, x - 0.5 * picture.width, y - 0.5 * picture.height);
    }
  }

  /** Draw a ring where the pointer is, while the paddle is not there: the pointer itself is hidden. */
  drawTarget([x, y], paddle) {
    const radius = this.#table.paddle_radius;
    if (Math.hypot(x - paddle[0], y - paddle[1]) < 0.6 * radius) {
      return;
    }
    const { context, scale } = this.#view;
    context.strokeStyle = css(this.#palette.left, 0.75);
    context.lineWidth = Math.max(1.5, 0.07 * radius * scale);
    context.beginPath();
    context.arc(...this.#view.toCanvas(x, y), 0.35 * radius * scale, 0, TURN);
    context.stroke();
  }

  #drawGround() {
    const { canvas, scale, upright } = this.#view;
    const { length, width, goal_width: goal } = this.#table;
    const palette = this.#palette;
    const picture = new OffscreenCanvas(canvas.width, canvas.height);
    const context = picture.getContext("2d");
    // From here on in metres, with y up, turned as the view is.
    context.translate(0.5 * canvas.width, 0.5 * canvas.height);
    context.scale(scale, -scale);
    if (upright) {
      context.rotate(0.5 * Math.PI);
    }
    const pixel = 1 / scale;
    const box = (grow, corner, color) => {
      context.fillStyle = color;
      context.beginPath();
      context.roundRect(-0.5 * length - grow, -0.5 * width - grow, length + 2 * grow, width + 2 * grow, corner);
      context.fill();
    };
    const circle = (x, y, radius, fill, stroke) => {
      context.beginPath();
      context.arc(x, y, radius, 0, TURN);
      if (fill) {
        context.fillStyle = fill;
        context.fill();
      }
      if (stroke) {
        context.strokeStyle = stroke;
        context.stroke();
      }
    };
    box(View.RAIL, 0.11, css(palette.rail_edge));
    box(View.RAIL - 0.006, 0.104, css(palette.rail));
    box(View.RAIL - 0.03, 0.08, css(palette.rail_top));
    for (const side of [-1, 1]) {
      context.fillStyle = css(palette.pocket);
      context.beginPath();
      const near = side < 0 ? -0.5 * length - POCKET_DEPTH : 0.5 * length - 0.01;
      context.roundRect(near, -0.5 * goal, POCKET_DEPTH + 0.01, goal, 0.02);
      context.fill();
    }
    box(0.012, 0.004, css(palette.lip));
    box(0, 0, css(palette.surface));
    for (const side of [-1, 1]) {
      // The goal opens the lip.
      context.fillStyle = css(palette.pocket);
      context.fillRect(side < 0 ? -0.5 * length - 0.014 : 0.5 * length, -0.5 * goal, 0.014, goal);
    }
    context.save();
    context.beginPath();
    context.rect(-0.5 * length, -0.5 * width, length, width);
    context.clip();
    if (HOLE_SPACING * scale >= 8) {
      context.fillStyle = css(palette.hole);
      context.beginPath();
      for (let x = HOLE_SPACING * Math.ceil(-0.5 * length / HOLE_SPACING + 0.2); x < 0.5 * length; x += HOLE_SPACING) {
        for (let y = HOLE_SPACING * Math.ceil(-0.5 * width / HOLE_SPACING + 0.2); y < 0.5 * width; y += HOLE_SPACING) {
          context.moveTo(x + HOLE_RADIUS, y);
          context.arc(x, y, HOLE_RADIUS, 0, TURN);
        }
      }
      context.fill();
    }
    context.lineWidth = Math.max(pixel, LINE);
    context.strokeStyle = css(palette.marking);
    context.beginPath();
    context.moveTo(0, -0.5 * width);
    context.lineTo(0, 0.5 * width);
    context.stroke();
    circle(0, 0, CENTRE_CIRCLE, css(palette.surface), css(palette.marking));
    circle(0, 0, 0.018, css(palette.marking));
    for (const [side, color] of [[-1, palette.left], [1, palette.right]]) {
      circle(side * 0.5 * length, 0, 0.5 * goal + CREASE_MARGIN, css(color, 0.1), css(color, 0.8));
    }
    context.restore();
    for (const [side, color] of [[-1, palette.left], [1, palette.right]]) {
      context.strokeStyle = css(color);
      context.lineWidth = Math.max(1.5 * pixel, 1.5 * LINE);
      context.beginPath();
      context.moveTo(side * 0.5 * length, -0.5 * goal);
      context.lineTo(side * 0.5 * length, 0.5 * goal);
      context.stroke();
      for (const end of [-1, 1]) {
        circle(side * 0.5 * length, end * 0.5 * goal, POST_RADIUS, css(palette.lip));
      }
    }
    return picture;
  }
}
