/** The page "Air table": pucks without friction, the same scene with three methods, and the geometry of their contacts. */
import { ContactPanel } from "./air_contact.js";
import { Lane, PER_SPEED } from "./air_lane.js";
import { Plots } from "./air_plots.js";
import { Connection } from "./connection.js";
import { byId, capital, everyPicture, seconds, showValue } from "./page.js";
import { Playout } from "./playout.js";
import { Turns } from "./turns.js";

const ABOUT = {
  continuous: "exact: finds every kiss on the way",
  kiss: "at the end of a tick, goes back by tₚ to the kiss",
  overlap: "at the end of a tick, takes the overlap's normal",
};
/** The named scenes: what they are called, and what there is to be seen. */
const SCENES = {
  pool_shot: [
    "Pool shot",
    "One puck hits another off its centre. Go to the next contact and read what is beside the tables, then move the phase: " +
      "the shot starts earlier by that share of a tick, and only “overlap” is misled.",
  ],
  newtons_cradle: [
    "Newton's cradle",
    "A puck hits a row of five equal ones, head on: all five contacts are at the same moment, and only the last puck leaves.",
  ],
  break_of_a_rack: [
    "Break of a rack",
    "Fifteen pucks, half a millimetre apart, are broken. Every contact enlarges what was wrong in the one before, and soon the three tables have nothing in common.",
  ],
  tunnelling_at_speed: [
    "Tunnelling at speed",
    "The fast puck travels three times the sum of the radii in a tick. Methods that look only at the end of a tick let it pass through the others.",
  ],
  reversal: ["Reversal", "Let it run for a second, then press “Reverse time”: which method finds the way back to the start?"],
  large_and_small: ["Large and small", "Five pucks of different sizes and masses. Grab one and throw it."],
};
const OWN = [
  "Your own",
  "Grab a puck and throw it, or pause and drag it to another place; a double click adds one. The link keeps the scene as it starts.",
];
const FIRST = "scene=pool_shot";
const SEARCHES = 200; // messages until a contact is found
const NUDGE = 0.01; // m that an arrow key moves a puck
const LATELY = 0.1; // s on the wall of a pointer's way that a throw goes by
const FASTEST = 10; // m/s, each component of a throw
const AIM = 0.1; // m/s that it changes a velocity by

const connection = new Connection("air");
const playout = new Playout();
const turns = new Turns(ask);
const panel = new ContactPanel();
const plots = new Plots(byId("charts"));
const lanes = ["continuous", "kiss", "overlap"].map((method) => new Lane(method, ABOUT[method], choose));
let lane = lanes[0]; // the large one
let scene = null; // the server's message "scene", while there is one
let newest = null; // the last state
let shown = null; // the state in the picture
let running = !matchMedia("(prefers-reduced-motion: reduce)").matches;
let opening = true; // the next scene is run as it comes
let selected = 0;
let held = null; // what the pointer does: {kind: "hold", "position" or "velocity", puck, place, trace}
let pending = null; // a change that waits for the answer to the one before
let waiting = false;
let searches = 0; // messages left to find a contact
let seeking = false; // the next scene is played up to its first contact, as the one before was
let log = []; // contacts
let at = null; // the one in the panel; null: the newest of the large table
let paths = null; // the fan: {paths, spread}
let fanned = ""; // the scene that it is of

byId("lanes").append(...lanes.map(({ figure }) => figure));
choose(lanes[0]);

// What the server says ------------------------------------------------------------------------------------------------

connection.on("hello", ({ palette }) => {
  lanes.forEach((one) => one.prepare(palette));
  byId("banner").hidden = true;
  connection.send("start", { scene: fragment() });
});

connection.on("scene", (message) => {
  const first = scene === null;
  scene = message;
  waiting = false;
  selected = Math.min(selected, scene.pucks.length - 1);
  const titles = scene.scenes.map((name) => [name, SCENES[name][0]]);
  byId("scenes").replaceChildren(...[...titles, ...(scene.name ? [] : [["", OWN[0]]])].map(([name, title]) => new Option(title, name)));
  byId("scenes").value = scene.name;
  byId("about").textContent = (SCENES[scene.name] ?? OWN)[1];
  if (!opening) {
    history.replaceState(null, "", `#${scene.name && !scene.phase ? `scene=${scene.name}` : scene.text}`);
  }
  lanes.forEach((one) => one.clear());
  plots.clear();
  playout.clear();
  turns.clear();
  log = [];
  at = null;
  showContact();
  if (first || opening) {
    setRunning(running);
  }
  opening = false;
  take(message);
  fill();
  askForFan();
  if (pending !== null) {
    flush();
  } else if (seeking && !running) {
    nextContact();
  }
});

connection.on("state", (state) => {
  turns.answered(seconds());
  take(state);
});

connection.on("bytes", ({ data }) => {
  const message = JSON.parse(new TextDecoder().decode(data));
  if (message.type === "state") {
    turns.answered(seconds());
    take(message);
  } else {
    paths = message;
    note(`Paths of ${message.phases.length} starts of the same motion, each at another phase of the tick; exact methods have one outcome`);
    captions();
  }
});

connection.on("note", ({ text }) => {
  waiting = false;
  note(capital(text));
  fill();
  if (pending !== null) {
    flush();
  }
});

connection.on("end", ({ reason }) => {
  scene = null;
  byId("title").textContent = "The session is over";
  byId("line").textContent = capital(reason);
  byId("banner").hidden = false;
  byId("again").focus();
  note(capital(reason));
});

/** Take in a state of the tables. */
function take(state) {
  const now = seconds();
  const notice = scene.revision;
  if ((state.notice ?? notice) !== notice) {
    return; // of the scene before
  }
  const before = newest;
  newest = { ...state, notice };
  playout.push(newest, now);
  plots.push(state);
  for (const contact of state.contacts) {
    lanes.find(({ method }) => method === contact.method).mark(contact, now);
    log.push(contact);
  }
  log.splice(0, Math.max(0, log.length - 300));
  const back = state.returned && !before?.returned;
  if (state.contacts.length) {
    showContact();
    if (!running) {
      note(ContactPanel.sentence(state.contacts.find(({ method }) => method === lane.method) ?? state.contacts[0]));
    }
  } else if (state.sought && !back) {
    searches -= 1;
    searches > 0 ? search() : note("No pucks touch for a long time");
  }
  if (back) {
    setRunning(false);
    const far = scene.methods.map((method, k) => `${method} ${distance(state.returned[k])}`).join(", ");
    note(`Back at the start of time. Farthest puck from where it began: ${far}`);
  }
  captions();
}

/** A length over many orders of magnitude. */
function distance(metres) {
  return metres >= 1e-4 ? `${(1e3 * metres).toFixed(1)} mm` : `${metres.toExponential(0)} m`;
}

// What the person does ------------------------------------------------------------------------------------------------

/** The scene in the address, or the first one. */
function fragment() {
  try {
    return decodeURIComponent(location.hash.slice(1)) || FIRST;
  } catch {
    return location.hash.slice(1);
  }
}

function open(text) {
  opening = true;
  seeking = false;
  history.replaceState(null, "", `#${text}`);
  running = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (connection.isOpen) {
    connection.send("start", { scene: text });
  } else {
    connection.open();
  }
}

/** s of the table for a second on the wall. */
function pace() {
  return 10 ** Number(byId("speed").value);
}

function setRunning(now) {
  running = now;
  byId("run").textContent = running ? "Pause" : "Run";
  byId("step").disabled = running;
  connection.send("speed", { speed: running ? pace() : 0 });
}

function step() {
  if (!running) {
    turns.asked();
    connection.send("step");
  }
}

function search() {
  turns.asked();
  connection.send("step", { until_contact: true });
}

function nextContact() {
  setRunning(false);
  at = null;
  searches = SEARCHES;
  search();
}

/** Make a table the large one. */
function choose(one) {
  lane = one;
  lanes.forEach((other) => (other.chosen = other === one));
  at = null;
  showContact();
}

function showContact() {
  const mine = log.filter(({ method }) => method === lane.method);
  const k = at === null ? mine.length - 1 : mine.indexOf(at);
  panel.show(mine[k] ?? null);
  byId("earlier").disabled = k <= 0;
  byId("later").disabled = k < 0 || k >= mine.length - 1;
}

function browse(by) {
  const mine = log.filter(({ method }) => method === lane.method);
  const k = (at === null ? mine.length - 1 : mine.indexOf(at)) + by;
  at = mine[k] ?? at;
  setRunning(false);
  showContact();
}

/** Change the scene as the large table shows it. */
function change(type, fields) {
  seeking = false;
  request(type, { method: lane.method, ...fields });
}

/** Ask for another scene. Only one change is under way; of those that wait, the last counts. */
function request(type, fields) {
  pending = [type, fields];
  if (!waiting) {
    flush();
  }
}

function flush() {
  waiting = true;
  connection.send(...pending);
  pending = null;
}

function add(place) {
  const radius = 0.05;
  const spots = [place, ...Array.from({ length: 200 }, (_, k) => [-0.9 + 0.095 * (k % 20), -0.4 + 0.088 * Math.floor(k / 20)])];
  const rows = positionsOf(lane, newest);
  const free = ([x, y]) => rows.every(([a, b], k) => Math.hypot(a - x, b - y) > radius + scene.pucks[k].radius + 0.002);
  const [x, y] = spots.find(free) ?? place;
  selected = scene.pucks.length;
  change("add", { position: [round(x), round(y)], radius, mass: 1 });
}

function remove() {
  change("remove", { puck: selected });
}

/** Step the scene otherwise, from its start; a contact that is studied stays in view. */
function settings(name, value) {
  seeking = !running && (seeking || log.length > 0);
  request("settings", { [name]: value });
}

const round = (x) => Math.min(Math.max(Number(x.toFixed(4)), -9999), 9999);

byId("run").addEventListener("click", () => setRunning(!running));
byId("step").addEventListener("click", step);
byId("contact").addEventListener("click", nextContact);
byId("restart").addEventListener("click", restart);
byId("reverse").addEventListener("click", reverse);
byId("earlier").addEventListener("click", () => browse(-1));
byId("later").addEventListener("click", () => browse(1));
byId("again").addEventListener("click", () => open(FIRST));
byId("scenes").addEventListener("change", (event) => event.target.value && open(`scene=${event.target.value}`));
byId("speed").addEventListener("input", () => {
  showValue("speed", `× ${Number(pace().toPrecision(2))}`);
  if (running) {
    setRunning(true);
  }
});
byId("phase").addEventListener("input", (event) => settings("phase", Number(event.target.value)));
byId("fan").addEventListener("change", askForFan);
byId("add").addEventListener("click", () => add([0, 0.25]));
byId("remove").addEventListener("click", remove);
byId("puck").addEventListener("change", (event) => {
  selected = Number(event.target.value);
  fill();
});
byId("keep").addEventListener("click", () => change("keep", {}));
byId("link").addEventListener("click", async () => {
  try {
    await navigator.clipboard.writeText(location.href);
    note("The link to this scene is copied");
  } catch {
    note("The address of this page is the link to this scene");
  }
});
for (const name of ["radius", "mass", "vx", "vy"]) {
  byId(name).addEventListener("change", () => {
    const value = Number(byId(name).value);
    const velocity = [Number(byId("vx").value), Number(byId("vy").value)];
    change("change", { puck: selected, ...{ radius: { radius: value / 100 }, mass: { mass: value } }[name] ?? { velocity } });
  });
}
for (const [name, scale] of [["tick", 1000], ["restitution", 1], ["wall_restitution", 1]]) {
  byId(name).addEventListener("change", (event) => settings(name, Number(event.target.value) / scale));
}
for (const form of document.forms) {
  form.addEventListener("submit", (event) => event.preventDefault());
}
window.addEventListener("hashchange", () => open(fragment()));

function restart() {
  seeking = false;
  connection.send("restart");
}

function reverse() {
  connection.send("reverse");
  note(newest?.turned ? "Time goes on" : "Time is turned round: every puck goes back the way it came");
  if (!running) {
    setRunning(true);
  }
}

// Pointer and keys ----------------------------------------------------------------------------------------------------

for (const one of lanes) {
  const { canvas } = one;
  canvas.addEventListener("pointerdown", (event) => {
    if (scene === null || shown === null) {
      return;
    }
    const place = one.view.toTable(event.clientX, event.clientY);
    const puck = one.puckAt(place, scene.pucks, positionsOf(one, shown));
    if (puck === null) {
      return;
    }
    canvas.setPointerCapture(event.pointerId);
    choose(one);
    selected = puck;
    fill();
    const kind = running ? "hold" : event.shiftKey ? "velocity" : byId("drag").value;
    held = { kind, puck, place, trace: [[seconds(), ...place]] };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (held === null) {
      return;
    }
    held.place = one.view.toTable(event.clientX, event.clientY);
    held.trace.push([seconds(), ...held.place]);
    held.trace.splice(0, held.trace.length - 100);
    if (held.kind === "position") {
      change("change", { puck: held.puck, position: held.place.map(round) });
    } else if (held.kind === "velocity") {
      const [x, y] = positionsOf(one, newest)[held.puck];
      change("change", { puck: held.puck, velocity: [round((held.place[0] - x) / PER_SPEED), round((held.place[1] - y) / PER_SPEED)] });
    }
  });
  for (const kind of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(kind, () => {
      if (held?.kind === "hold" && running) {
        connection.send("throw", { puck: held.puck, velocity: velocityOf(held.trace) });
      }
      held = null;
    });
  }
  canvas.addEventListener("dblclick", (event) => {
    const place = one.view.toTable(event.clientX, event.clientY);
    if (scene !== null && one.puckAt(place, scene.pucks, positionsOf(one, shown)) === null) {
      choose(one);
      add(place);
    }
  });
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (scene === null || newest === null) {
      return;
    }
    if (event.key === "[" || event.key === "]") {
      const n = scene.pucks.length;
      selected = (selected + (event.key === "]" ? 1 : n - 1)) % n;
      fill();
      note(`Puck ${selected + 1}: ${describe()}`);
    } else if (by) {
      event.preventDefault();
      const [step, rows, name] = event.shiftKey
        ? [AIM, rowsOf(one, newest.velocities), "velocity"]
        : [NUDGE, positionsOf(one, newest), "position"];
      choose(one);
      setRunning(false);
      change("change", { puck: selected, [name]: rows[selected].map((value, k) => round(value + step * by[k])) });
    }
  });
}

/** The velocity, m/s of the table's time, with which the pointer was moved just now. */
function velocityOf(trace) {
  const now = seconds();
  const [since, x0, y0] = trace.findLast(([time]) => time <= now - LATELY) ?? trace[0];
  const [, x1, y1] = trace.at(-1);
  const elapsed = Math.min(Math.max(now - since, 0.016), LATELY) * pace();
  return [x1 - x0, y1 - y0].map((way) => Math.min(Math.max(round(way / elapsed), -FASTEST), FASTEST));
}

document.addEventListener("keydown", (event) => {
  if (event.target.closest("input, select, button, summary, a") || event.ctrlKey || event.metaKey || event.altKey) {
    return;
  }
  const action = {
    " ": () => setRunning(!running),
    ".": step,
    c: nextContact,
    r: restart,
    t: reverse,
    "+": () => add([0, 0.25]),
    Delete: remove,
  }[event.key];
  if (action && scene !== null) {
    event.preventDefault();
    action();
  }
});

// What is shown -------------------------------------------------------------------------------------------------------

function rowsOf(one, rows) {
  const n = scene.pucks.length;
  const k = lanes.indexOf(one);
  return rows.slice(k * n, (k + 1) * n);
}

function positionsOf(one, state) {
  return rowsOf(one, state.positions);
}

function describe() {
  const { radius, mass, x, y, vx, vy } = scene.pucks[selected];
  return `radius ${(100 * radius).toFixed(1)} cm, mass ${mass} kg, at ${x.toFixed(2)}, ${y.toFixed(2)} m, velocity ${vx.toFixed(2)}, ${vy.toFixed(2)} m/s`;
}

/** Fill the fields with what the scene is. */
function fill() {
  const numbers = scene.pucks.map((_, k) => String(k + 1));
  if (byId("puck").options.length !== numbers.length) {
    byId("puck").replaceChildren(...numbers.map((text, k) => new Option(text, k)));
  }
  const puck = scene.pucks[selected];
  const values = {
    puck: selected,
    radius: Number((100 * puck.radius).toPrecision(4)),
    mass: puck.mass,
    vx: Number(puck.vx.toFixed(3)),
    vy: Number(puck.vy.toFixed(3)),
    tick: Number((1000 * scene.tick).toPrecision(4)),
    restitution: scene.restitution,
    wall_restitution: scene.wall_restitution,
  };
  for (const [name, value] of Object.entries(values)) {
    if (document.activeElement !== byId(name) || name === "puck") {
      byId(name).value = value;
    }
  }
  byId("phase").value = scene.phase;
  showValue("phase", `${Math.round(100 * scene.phase)} %`);
  byId("remove").disabled = scene.pucks.length === 1;
  byId("add").disabled = scene.pucks.length >= scene.most_pucks;
}

function captions() {
  for (const one of lanes) {
    const spread = paths && byId("fan").checked ? `paths end up to ${distance(paths.spread[one.method])} apart` : "";
    const time = newest && one === lane ? `${newest.clock.toFixed(3).replace("-0.000", "0.000")} s` : "";
    one.output.textContent = [spread, time].filter(Boolean).join(" · ");
  }
}

function note(text) {
  byId("said").textContent = text;
}

/** Ask for the paths from all phases, unless they are known: they do not depend on the phase that is shown. */
function askForFan() {
  if (scene === null || !byId("fan").checked) {
    captions();
    return;
  }
  const text = scene.text.replace(/&phase=.*/, "");
  if (text !== fanned || paths === null) {
    fanned = text;
    paths = null;
    connection.send("fan");
  }
  captions();
}

function ask() {
  if (scene === null) {
    return;
  }
  const hold = held?.kind === "hold" && running ? { hold: [held.puck, ...held.place.map(round)] } : {};
  connection.send("turn", hold);
}

everyPicture(() => {
  if (scene === null || newest === null) {
    return;
  }
  const now = seconds();
  turns.picture(now);
  const state = running ? playout.at(now) : newest;
  shown = state !== null && state.positions.length === 3 * scene.pucks.length ? state : newest;
  const off = (phase) => Math.min(Math.abs(phase - scene.phase), 1 - Math.abs(phase - scene.phase));
  const current = paths?.phases.reduce((best, phase, k, all) => (off(phase) < off(all[best]) ? k : best), 0);
  for (const one of lanes) {
    one.draw({
      pucks: scene.pucks,
      positions: positionsOf(one, shown),
      velocities: rowsOf(one, shown.velocities),
      selected,
      now,
      arrows: byId("arrows").checked,
      normals: byId("normals").checked,
      paused: !running,
      fan: byId("fan").checked && paths ? { paths: paths.paths[one.method], current } : null,
    });
  }
  plots.draw(now, scene.methods);
});

connection.open();
