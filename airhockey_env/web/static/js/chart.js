/**
 * A line chart on a canvas, in the page's own colours.
 */
/** The lines, in order: dashes tell them apart where they lie on each other, and to people who see fewer colours. */
const LINES = [
  { color: "--left", dash: [] },
  { color: "--right", dash: [7, 5] },
  { color: "--ink", dash: [2, 4] },
];

function short(value) {
  const size = Math.abs(value);
  if (size >= 1e6) {
    return `${Number((value / 1e6).toPrecision(3))} M`;
  }
  return size >= 1e4 ? `${Number((value / 1e3).toPrecision(3))} k` : `${Number(value.toPrecision(3))}`;
}

/** Round numbers that divide a range into a few parts. */
function ticks(low, high, about) {
  const rough = (high - low) / about || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step) {
    found.push(value);
  }
  return found;
}

export class Chart {
  /**
   * @param {string} title
   * @param {[number, number] | null} range - of the vertical axis; null: that of the values.
   * @param {string} axis - what the horizontal axis shows.
   */
  constructor(title, range = null, axis = "steps") {
    this.title = title;
    this.axis = axis;
    this.range = range;
    this.figure = document.createElement("figure");
    this.figure.className = "chart";
    this.caption = document.createElement("figcaption");
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.figure.append(this.caption, this.canvas);
    this.lines = [];
    this.goal = 0;
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /**
   * Show other values.
   *
   * @param {{label: string, points: number[][], bands: number[][]}[]} lines - points [x, y], bands [x, low, high].
   * @param {number} goal - the horizontal axis reaches to there at least.
   */
  show(lines, goal) {
    this.lines = lines.filter((line) => line.points.length);
    this.goal = goal;
    this.figure.hidden = !this.lines.length;
    const latest = this.lines.map(({ label, points }) => `${label} ${short(points.at(-1)[1])}`.trim());
    const parts = latest.map((text, k) => {
      const part = document.createElement("span");
      part.textContent = text;
      part.className = latest.length > 1 ? `line line-${k % LINES.length}` : "";
      return part;
    });
    this.caption.replaceChildren(`${this.title}: `, ...parts.flatMap((part, k) => (k ? [", ", part] : [part])));
    this.canvas.setAttribute("aria-label", `${this.title}, over ${this.axis}. Latest: ${latest.join(", ")}`);
    this.draw();
  }

  draw() {
    const { canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    if (!this.lines.length || !canvas.width) {
      return;
    }
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const style = getComputedStyle(canvas);
    const color = (name) => style.getPropertyValue(name).trim();
    const values = this.lines.flatMap(({ points, bands }) => [...points.map((p) => p[1]), ...bands.flatMap((b) => b.slice(1))]);
    let [low, high] = this.range ?? [Math.min(...values), Math.max(...values)];
    if (low === high) {
      [low, high] = [low - 0.5, high + 0.5];
    }
    const most = Math.max(this.goal, ...this.lines.flatMap(({ points }) => points.map((p) => p[0])), 1);
    const size = 0.7 * parseFloat(getComputedStyle(document.documentElement).fontSize);
    const [left, right, top, bottom] = [3.6 * size, width - 8, 0.7 * size, height - 1.7 * size];
    const x = (value) => left + ((right - left) * value) / most;
    const y = (value) => bottom - ((bottom - top) * (value - low)) / (high - low);
    context.font = `${size}px ${style.fontFamily}`;
    context.fillStyle = color("--quiet");
    context.strokeStyle = color("--line");
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (const value of ticks(low, high, 4)) {
      context.beginPath();
      context.moveTo(left, y(value));
      context.lineTo(right, y(value));
      context.stroke();
      context.fillText(short(value), left - 5, y(value));
    }
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const value of ticks(0, most, 4)) {
      context.fillText(short(value), Math.min(x(value), right - size), bottom + 5);
    }
    this.lines.forEach(({ points, bands }, k) => {
      const look = LINES[k % LINES.length];
      context.strokeStyle = context.fillStyle = color(look.color);
      if (bands.length) {
        context.globalAlpha = 0.18;
        context.beginPath();
        bands.forEach(([at, , upper]) => context.lineTo(x(at), y(upper)));
        bands.toReversed().forEach(([at, lower]) => context.lineTo(x(at), y(lower)));
        context.fill();
        context.globalAlpha = 1;
      }
      context.lineWidth = 1.8;
      context.setLineDash(look.dash);
      context.beginPath();
      points.forEach(([at, value]) => context.lineTo(x(at), y(value)));
      context.stroke();
      context.setLineDash([]);
      const [at, value] = points.at(-1);
      context.beginPath();
      context.arc(x(at), y(value), 3, 0, 2 * Math.PI);
      context.fill();
    });
  }
}
