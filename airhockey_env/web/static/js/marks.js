/**
 * Contacts, drawn over the table: where two discs (or a disc and a wall) touch, the normal, and the impulse.
 */
const LASTS = 0.6; // s on the wall
const NORMAL = 0.12; // m
const PER_IMPULSE = 0.6; // m for 1 N s
/** By the name of what is drawn. */
export const COLORS = { contacts: "#e69f00", normals: "#009e73", impulses: "#cc2f8f" };

export class Marks {
  #contacts = [];

  /** Add contacts, [time, a, b, x, y, nx, ny, impulse] each: the normal points from b to a, b is -1 for a wall. */
  add(contacts) {
    this.#contacts.push(...contacts);
    if (this.#contacts.length > 400) {
      this.#contacts.splice(0, this.#contacts.length - 400);
    }
  }

  /** Forget all of them. */
  clear() {
    this.#contacts = [];
  }

  /**
   * Draw those of the last moment.
   *
   * @param {import("./view.js").View} view
   * @param {number} time - s of the match at which the picture is.
   * @param {number} speed - s of the match for a second on the wall.
   * @param {{contacts: boolean, normals: boolean, impulses: boolean}} what
   */
  draw(view, time, speed, what) {
    const lasts = LASTS * Math.max(speed, 0.02);
    for (const [at, a, , x, y, nx, ny, impulse] of this.#contacts) {
      if (at > time || at < time - lasts) {
        continue;
      }
      const { context } = view;
      context.globalAlpha = 1 - 0.7 * ((time - at) / lasts);
      if (what.normals) {
        arrow(view, [x - NORMAL * nx, y - NORMAL * ny], [x + NORMAL * nx, y + NORMAL * ny], COLORS.normals);
      }
      if (what.impulses) {
        const reach = (a === 2 ? 1 : -1) * PER_IMPULSE * impulse; // on the puck, which is disc 2
        const end = [x + reach * nx, y + reach * ny];
        arrow(view, [x, y], end, COLORS.impulses);
        label(view, end, `${impulse.toFixed(3)} N s`);
      }
      if (what.contacts) {
        context.fillStyle = COLORS.contacts;
        context.beginPath();
        context.arc(...view.toCanvas(x, y), 4 * view.ratio, 0, 2 * Math.PI);
        context.fill();
      }
      context.globalAlpha = 1;
    }
  }
}

/** Draw an arrow between two places on the table. */
export function arrow(view, from, to, color) {
  const { context } = view;
  const [x0, y0] = view.toCanvas(...from);
  const [x1, y1] = view.toCanvas(...to);
  const length = Math.hypot(x1 - x0, y1 - y0);
  const head = Math.min(8 * view.ratio, 0.5 * length);
  if (length < 1) {
    return;
  }
  const [ux, uy] = [(x1 - x0) / length, (y1 - y0) / length];
  context.strokeStyle = color;
  context.fillStyle = color;
  context.lineWidth = 2.5 * view.ratio;
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1 - head * ux, y1 - head * uy);
  context.stroke();
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x1 - head * (ux - 0.5 * uy), y1 - head * (uy + 0.5 * ux));
  context.lineTo(x1 - head * (ux + 0.5 * uy), y1 - head * (uy - 0.5 * ux));
  context.fill();
}

/** Write a text beside a place on the table. */
export function label(view, place, text) {
  const { context, canvas } = view;
  const [x, y] = view.toCanvas(...place);
  context.font = `${Math.round(13 * view.ratio)}px system-ui, sans-serif`;
  const width = context.measureText(text).width;
  const [gap, height] = [6 * view.ratio, 16 * view.ratio];
  const left = Math.min(Math.max(x + gap, 0), canvas.width - width - gap);
  const top = Math.min(Math.max(y - 0.5 * height, 0), canvas.height - height);
  context.fillStyle = "rgb(255 255 255 / 85%)";
  context.fillRect(left - 0.4 * gap, top, width + 0.8 * gap, height);
  context.fillStyle = "#1c2230";
  context.textBaseline = "middle";
  context.fillText(text, left, top + 0.5 * height);
}
