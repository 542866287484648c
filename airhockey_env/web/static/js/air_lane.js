/**
 * One method's table: its pucks, their velocities, the normals of its contacts and the paths of a fan.
 */
import { arrow } from "./marks.js";
import { css, discPicture } from "./table.js";
import { View } from "./view.js";

const TURN = 2 * Math.PI;
const SIZE = [2, 1]; // m, as airhockey_env/web/scenes.py has it
const BORDER = 0.065; // m around the surface
const NORMAL = 0.12; // m
const LASTS = 0.8; // s on the wall that a normal is shown
export const PER_SPEED = 0.08; // m of arrow for 1 m/s

/** Colours of pucks by number, told apart by people who see fewer colours too (Okabe and Ito 2008). */
const COLORS = [
  [0, 114, 178],
  [213, 94, 0],
  [0, 158, 115],
  [204, 121, 167],
  [230, 159, 0],
  [86, 180, 233],
  [240, 228, 66],
];

/** The colour of a puck. */
export function puckColor(number) {
  return COLORS[number % COLORS.length];
}

/** The layers of a puck of this colour: see discPicture. */
function layers(palette, color) {
  const dark = color.map((part) => Math.round(0.6 * part));
  return [
    [1.04, 0.14, 0.4, palette.black, 0.3],
    [1.0, 0.0, 0.0, dark, 1.0],
    [0.9, 0.0, 0.0, color, 1.0],
  ];
}

export class Lane {
  #pictures = new Map();
  #marks = [];

  /**
   * @param {string} method
   * @param {string} about - what it does, for the caption.
   * @param {(lane: Lane) => void} choose - called when its button is pressed.
   */
  constructor(method, about, choose) {
    this.method = method;
    this.figure = document.createElement("figure");
    this.figure.className = "lane";
    this.figure.innerHTML =
      '<figcaption><button type="button"></button><span class="about"></span><output></output></figcaption>' +
      '<div class="stage"><canvas role="application" tabindex="0"></canvas></div>';
    this.button = this.figure.querySelector("button");
    this.button.textContent = method;
    this.button.addEventListener("click", () => choose(this));
    this.figure.querySelector(".about").textContent = about;
    this.output = this.figure.querySelector("output");
    this.canvas = this.figure.querySelector("canvas");
    this.canvas.id = `table-${method}`;
    this.canvas.setAttribute(
      "aria-label",
      `The table of the method ${method}: ${about}. Brackets choose a puck, arrow keys move it, with Shift they aim it.`,
    );
    this.palette = null;
  }

  /** Begin to draw, with the server's colours. The figure stands on the page now. */
  prepare(palette) {
    this.palette = palette;
    this.view ??= new View(this.canvas, () => this.#pictures.clear(), BORDER);
    this.view.show(...SIZE);
  }

  /** Whether it is the one that is large. */
  set chosen(chosen) {
    this.figure.classList.toggle("chosen", chosen);
    this.button.setAttribute("aria-pressed", chosen);
  }

  /** Show the normal of this contact for a moment. */
  mark(contact, now) {
    this.#marks.push({ ...contact, until: now + LASTS });
    this.#marks.splice(0, Math.max(0, this.#marks.length - 30));
  }

  /** Forget all normals. */
  clear() {
    this.#marks = [];
  }

  /** The number of the puck at a place, m, or null; small ones are easy to hit, too. */
  puckAt([x, y], pucks, positions) {
    const finger = (20 * this.view.ratio) / this.view.scale;
    const distance = (k) => Math.hypot(positions[k][0] - x, positions[k][1] - y) - pucks[k].radius;
    const nearest = pucks.map((_, k) => k).sort((a, b) => distance(a) - distance(b))[0];
    return nearest !== undefined && distance(nearest) < 0.5 * finger ? nearest : null;
  }

  /**
   * Draw everything.
   *
   * @param {object} picture - pucks, positions, velocities (rows of this method), selected, now, arrows, normals,
   *   paused, fan (`paths` of this method by phase and puck, the number of the `current` phase) or null.
   */
  draw({ pucks, positions, velocities, selected, now, arrows, normals, paused, fan }) {
    const { context, canvas, scale, ratio } = this.view;
    context.clearRect(0, 0, canvas.width, canvas.height);
    this.#ground();
    if (fan) {
      fan.paths.forEach((phase, number) => {
        const current = number === fan.current;
        phase.forEach((path, k) => {
          context.lineWidth = (current ? 3.5 : 1.4) * ratio;
          context.strokeStyle = css(puckColor(k), current ? 1 : 0.5);
          context.beginPath();
          path.forEach((place) => context.lineTo(...this.view.toCanvas(...place)));
          context.stroke();
        });
      });
    }
    pucks.forEach((puck, k) => {
      const picture = this.#picture(k, puck.radius * scale);
      const [x, y] = this.view.toCanvas(...positions[k]);
      context.drawImage(picture, x - 0.5 * picture.width, y - 0.5 * picture.height);
      if (k === selected) {
        context.strokeStyle = css(this.palette.black, 0.85);
        context.lineWidth = 2 * ratio;
        context.setLineDash([5 * ratio, 4 * ratio]);
        context.beginPath();
        context.arc(x, y, puck.radius * scale + 4 * ratio, 0, TURN);
        context.stroke();
        context.setLineDash([]);
      }
    });
    if (arrows) {
      velocities.forEach(([vx, vy], k) => {
        const [x, y] = positions[k];
        arrow(this.view, [x, y], [x + PER_SPEED * vx, y + PER_SPEED * vy], css(puckColor(k)));
      });
    }
    this.#marks = this.#marks.filter(({ until }) => paused || until > now);
    if (normals) {
      for (const { place: [x, y], normal: [nx, ny], until } of this.#marks.slice(paused ? -4 : 0)) {
        context.globalAlpha = paused ? 0.9 : Math.max(0, (until - now) / LASTS);
        arrow(this.view, [x - NORMAL * nx, y - NORMAL * ny], [x + NORMAL * nx, y + NORMAL * ny], "#cc2f8f");
      }
      context.globalAlpha = 1;
    }
  }

  #ground() {
    const { context, scale } = this.view;
    const box = (grow, corner, color) => {
      const [x0, y0] = this.view.toCanvas(-0.5 * SIZE[0] - grow, -0.5 * SIZE[1] - grow);
      const [x1, y1] = this.view.toCanvas(0.5 * SIZE[0] + grow, 0.5 * SIZE[1] + grow);
      context.fillStyle = color;
      context.beginPath();
      context.roundRect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0), corner * scale);
      context.fill();
    };
    box(0.06, 0.06, css(this.palette.rail_edge));
    box(0.05, 0.05, css(this.palette.rail));
    box(0.012, 0.004, css(this.palette.lip));
    box(0, 0, css(this.palette.surface));
  }

  #picture(number, radius) {
    const key = `${number % COLORS.length} ${radius.toFixed(1)}`;
    if (!this.#pictures.has(key)) {
      this.#pictures.set(key, discPicture(layers(this.palette, puckColor(number)), radius));
    }
    return this.#pictures.get(key);
  }
}
