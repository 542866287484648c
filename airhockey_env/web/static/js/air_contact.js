/**
 * One contact: the picture of its two triangles, seen from puck B, and its numbers. All of them come from the server.
 */
import { byId } from "./page.js";

const TURN = 2 * Math.PI;
const mm = (length) => `${(1e3 * length).toFixed(3)} mm`;
const degrees = (angle) => `${angle.toFixed(3)}°`;
const none = "no overlap is seen";

const wayToKiss = (c) => c.projection - c.top_leg;

/** The rows of the tables: what a number is called, its text for a contact, and whether it is what the page is about. */
const RESULTS = {
  penetration_time: ["Penetration time t<sub>p</sub>", (c) => `${(1e3 * c.penetration_time).toFixed(4)} ms`, true],
  between: ["Angle between the two normals", (c) => (c.between === null ? none : degrees(c.between)), true],
};
const NORMALS = {
  ideal: ["Ideal normal", (c) => degrees(c.ideal)],
  approximate: ["Approximate normal", (c) => (c.approximate === null ? none : degrees(c.approximate))],
  used: ["Normal that this method used", (c) => degrees(c.used)],
};
const DERIVATION = {
  shared_leg: ["Leg that both triangles share", (c) => mm(c.shared_leg)],
  projection: ["Large triangle, leg along the path", (c) => mm(c.projection)],
  hypotenuse: ["Small triangle, hypotenuse", (c) => mm(c.hypotenuse)],
  top_leg: ["Small triangle, leg along the path", (c) => mm(c.top_leg)],
  to_kiss: ["Way from A₁ to the kiss", (c) => mm(wayToKiss(c))],
  path: ["Way in the whole tick", (c) => mm(c.path)],
  tick: ["Tick", (c) => `${(1e3 * c.tick).toFixed(2)} ms`],
};
const ROWS = { ...RESULTS, ...NORMALS, ...DERIVATION };
const TABLES = { results: RESULTS, "normals-of-contact": NORMALS, derivation: DERIVATION };

export class ContactPanel {
  #contact = null;
  #cells = {};

  constructor() {
    this.canvas = byId("triangles");
    for (const [table, rows] of Object.entries(TABLES)) {
      for (const [name, [title, , important]] of Object.entries(rows)) {
        const row = byId(table).insertRow();
        row.className = important ? "key-number" : "";
        const head = document.createElement("th");
        head.scope = "row";
        head.innerHTML = title;
        row.append(head);
        this.#cells[name] = row.insertCell();
        this.#cells[name].id = `number-${name}`;
        this.#cells[name].textContent = "–";
      }
    }
    new ResizeObserver(() => this.#draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#draw());
  }

  /** Show this contact, or none. */
  show(contact) {
    this.#contact = contact;
    byId("contact-line").textContent = contact
      ? `Puck ${contact.a + 1} (A) and puck ${contact.b + 1} (B) at ${contact.time.toFixed(4)} s, with the method “${contact.method}”`
      : "None yet. Run the scene, or go to the next contact.";
    for (const [name, [, text]] of Object.entries(ROWS)) {
      this.#cells[name].textContent = contact ? text(contact) : "–";
    }
    byId("sum").textContent = contact
      ? `tₚ = ${DERIVATION.tick[1](contact)} × (${mm(contact.path)} − ${mm(wayToKiss(contact))}) / ${mm(contact.path)} = ${RESULTS.penetration_time[1](contact)}`
      : "";
    this.#draw();
  }

  /** The contact in a sentence, for screen readers. */
  static sentence(contact) {
    const angle = contact.between === null ? "the pucks do not overlap at the end of the tick" : `the normals are ${degrees(contact.between)} apart`;
    return `Pucks ${contact.a + 1} and ${contact.b + 1} touch at ${contact.time.toFixed(4)} s (${contact.method}): tₚ is ${ROWS.penetration_time[1](contact)}, ${angle}.`;
  }

  #draw() {
    const { canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    const contact = this.#contact;
    if (contact === null || !canvas.width) {
      return;
    }
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const style = getComputedStyle(canvas);
    const color = (name) => style.getPropertyValue(name).trim();
    const { start, kiss, end, foot, radii: [a, b] } = contact;
    const origin = [0, 0];
    // All four circles fit; what is far away only shrinks the picture to a third of what the kiss alone would need.
    const reach = a + b;
    const far = ([x, y]) => {
      const limit = 2.6 * reach;
      const size = Math.hypot(x - kiss[0], y - kiss[1]);
      return size > limit ? [kiss[0] + ((x - kiss[0]) * limit) / size, kiss[1] + ((y - kiss[1]) * limit) / size] : [x, y];
    };
    const shown = [[far(start), a], [kiss, a], [far(end), a], [origin, b]];
    const lows = [0, 1].map((k) => Math.min(...shown.map(([place, r]) => place[k] - r)));
    const highs = [0, 1].map((k) => Math.max(...shown.map(([place, r]) => place[k] + r)));
    const scale = Math.min((width - 40) / (highs[0] - lows[0]), (height - 36) / (highs[1] - lows[1]));
    const px = ([x, y]) => [
      0.5 * width + (x - 0.5 * (lows[0] + highs[0])) * scale,
      0.5 * height - (y - 0.5 * (lows[1] + highs[1])) * scale,
    ];
    const line = (from, to, stroke, thick = 1.5, dash = []) => {
      context.strokeStyle = stroke;
      context.lineWidth = thick;
      context.setLineDash(dash);
      context.beginPath();
      context.moveTo(...px(from));
      context.lineTo(...px(to));
      context.stroke();
      context.setLineDash([]);
    };
    const circle = (place, radius, stroke, alpha, dash = []) => {
      context.beginPath();
      context.arc(...px(place), radius * scale, 0, TURN);
      context.globalAlpha = 0.12 * alpha;
      context.fillStyle = stroke;
      context.fill();
      context.globalAlpha = alpha;
      context.strokeStyle = stroke;
      context.lineWidth = 1.5;
      context.setLineDash(dash);
      context.stroke();
      context.setLineDash([]);
      context.globalAlpha = 1;
    };
    const fill = (places, name, alpha) => {
      context.beginPath();
      places.forEach((place) => context.lineTo(...px(place)));
      context.closePath();
      context.globalAlpha = alpha;
      context.fillStyle = color(name);
      context.fill();
      context.globalAlpha = 1;
    };
    const [blue, red, ink, quiet] = ["--right", "--left", "--ink", "--quiet"].map(color);
    circle(origin, b, red, 1);
    circle(start, a, blue, 0.45);
    circle(end, a, blue, 1);
    circle(kiss, a, blue, 1, [5, 4]);
    fill([start, foot, origin], "--large", 0.28);
    fill([kiss, foot, origin], "--small", 0.45);
    line(start, origin, ink, 1);
    line(start, foot, quiet, 1, [4, 3]);
    line(start, end, blue, 2.2);
    line(foot, origin, ink);
    line(kiss, origin, ink);
    const normal = (angle, dash) => {
      const direction = [Math.cos((Math.PI * angle) / 180), Math.sin((Math.PI * angle) / 180)];
      line(direction.map((d) => -1.15 * b * d), direction.map((d) => (b + 1.3 * a) * d), ink, 2.2, dash);
    };
    normal(contact.ideal, []);
    if (contact.approximate !== null) {
      normal(contact.approximate, [2, 4]);
    }
    context.font = `italic 600 13px ${style.fontFamily}`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    // Away from the path, on the side where B is not, so that names and triangles do not cover each other.
    const away = [-foot[0], -foot[1]].map((d) => (contact.shared_leg > 1e-9 ? -d / contact.shared_leg : 0));
    const up = contact.shared_leg > 1e-9 ? away : [0, 1];
    const name = (text, place, [dx, dy]) => {
      const [x, y] = px(place);
      context.beginPath();
      context.arc(x, y, 3, 0, TURN);
      context.fillStyle = ink;
      context.fill();
      const [left, top] = [Math.min(Math.max(x + 15 * dx, 14), width - 14), Math.min(Math.max(y - 15 * dy, 9), height - 9)];
      context.lineWidth = 3;
      context.strokeStyle = color("--raised");
      context.strokeText(text, left, top);
      context.fillText(text, left, top);
    };
    const along = [0, 1].map((k) => (end[k] - start[k]) / contact.path);
    const beside = (share) => up.map((d, k) => d + share * along[k]);
    name("A₁", start, beside(-0.5));
    name("A′₂ₖ", kiss, beside(-0.9));
    name("A′₂", end, beside(0.9));
    name("B₁", origin, [-up[0], -up[1]]);
  }
}
