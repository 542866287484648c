/** The page "Play": a match against a player of the server. */
import { Aim } from "./aim.js";
import { Connection } from "./connection.js";
import { byId, capital, download, everyPicture, seconds, setOptions, showValue } from "./page.js";
import { Playout } from "./playout.js";
import { drawShotClock } from "./shot_clock.js";
import { Sounds } from "./sounds.js";
import { Table } from "./table.js";
import { Turns } from "./turns.js";
import { View } from "./view.js";

/** What is written over the table while the game rests: a title, a line, and whether it goes away by itself. */
const NOTICES = {
  start: (match) => [`First to ${match.points}`, "Your paddle follows the pointer", true],
  goal: () => ["Goal!", "", true],
  conceded: (match) => [`Goal for ${match.opponent}`, "", true],
  foul: () => ["Shot clock", "Seven seconds are over: the other side serves", true],
  paused: () => ["Paused", "", false],
  won: (match, [left, right]) => [`You win ${left} : ${right}`, "", false],
  lost: (match, [left, right]) => [`${capital(match.opponent)} wins ${right} : ${left}`, "", false],
};

const connection = new Connection("play");
const playout = new Playout();
const sounds = new Sounds();
const turns = new Turns(ask);
const canvas = byId("table");
const view = new View(canvas, () => table?.prepare());
let table = null;
let palette = null;
let tables = {};
let match = null; // the server's message "match", while there is one
let shown = null; // the state in the picture
let notice = null; // what is written over the table
let resuming = false;
let starting = false; // a match, as soon as there is a session

const aim = new Aim(
  view,
  () => shown?.positions[0] ?? [-0.8, 0],
  () => {
    const { length, width, paddle_radius: radius } = match.table;
    return [[radius - 0.5 * length, radius - 0.5 * width], [-radius, 0.5 * width - radius]];
  },
);

// What the server says ------------------------------------------------------------------------------------------------

connection.on("hello", (hello) => {
  ({ palette, tables } = hello);
  table ??= new Table(view, palette);
  setOptions(byId("opponent"), hello.players, "striker");
  setOptions(byId("tables"), Object.keys(tables), "full_size");
  shown ?? showTable();
  showOpponent();
  say("Air hockey", "You are red, and your paddle follows the pointer. Choose an opponent below, or just play.", false, ["begin"]);
  if (starting) {
    starting = false;
    start();
  }
});

connection.on("match", (message) => {
  match = message;
  table.show(match.table);
  playout.clear();
  turns.clear();
  notice = null;
  showOpponent();
  byId("pause").disabled = false;
  byId("download").disabled = false;
});

connection.on("state", (state) => {
  const now = seconds();
  playout.push(state, now);
  turns.answered(now);
  sounds.play(state.events, match.table.length);
});

connection.on("bytes", ({ data }) => download(data, `airhockey-${match.opponent}.npz`));

connection.on("end", ({ reason }) => {
  match = null;
  byId("pause").disabled = true;
  byId("download").disabled = true;
  say("The session is over", capital(reason), false, ["again"]);
});

// What the person does ------------------------------------------------------------------------------------------------

function start() {
  const points = byId("points");
  if (!points.reportValidity()) {
    return;
  }
  if (!connection.isOpen) {
    starting = true;
    connection.open();
    return;
  }
  connection.send("start", {
    opponent: byId("opponent").value,
    table: byId("tables").value,
    skill: Number(byId("skill").value) / 100,
    points: Number(points.value),
  });
  canvas.focus({ preventScroll: true });
}

function pause() {
  if (match !== null && !["won", "lost", "paused"].includes(notice)) {
    connection.send("pause");
  }
}

function resume() {
  if (match !== null && notice === "paused") {
    resuming = true;
    connection.send("resume");
    canvas.focus({ preventScroll: true });
  }
}

byId("choices").addEventListener("submit", (event) => {
  event.preventDefault();
  start();
});
byId("tables").addEventListener("change", () => match ?? showTable());
byId("opponent").addEventListener("change", () => match ?? showOpponent());
byId("skill").addEventListener("input", () => {
  showValue("skill", `${byId("skill").value} %`);
});
byId("sound").addEventListener("change", (event) => {
  sounds.on = event.target.checked;
});
byId("pause").addEventListener("click", () => (notice === "paused" ? resume() : pause()));
byId("download").addEventListener("click", () => connection.send("replay"));
document.addEventListener("visibilitychange", () => document.hidden && pause());
canvas.addEventListener("keydown", (event) => {
  if (event.code === "KeyP") {
    notice === "paused" ? resume() : pause();
  } else if (event.code === "KeyR" && match !== null) {
    connection.send("restart");
  }
});

const BUTTONS = {
  begin: ["Play", start],
  again: ["Play again", start],
  resume: ["Resume", resume],
  replay: ["Download replay", () => connection.send("replay")],
};

// What is shown -------------------------------------------------------------------------------------------------------

function showTable() {
  const chosen = tables[byId("tables").value];
  const home = 0.4 * chosen.length;
  shown = { positions: [[-home, 0], [home, 0], [0, 0]] };
  table.show(chosen);
}

function showOpponent() {
  byId("opponent-name").textContent = capital(match?.opponent ?? byId("opponent").value);
}

/** Write a title and a line over the table; one that passes lets the pointer through. */
function say(title, line, passing, buttons = []) {
  byId("title").textContent = title;
  byId("line").textContent = line;
  byId("buttons").replaceChildren(
    ...buttons.map((name, k) => {
      const button = document.createElement("button");
      button.id = name;
      button.type = "button";
      button.className = k ? "" : "main";
      button.textContent = BUTTONS[name][0];
      button.addEventListener("click", BUTTONS[name][1]);
      return button;
    }),
  );
  byId("banner").classList.toggle("passing", passing);
  byId("banner").hidden = false;
  setPlaying(passing);
  byId("said").textContent = `${title}. ${line}`;
}

/** Whether the match is on, but for short rests: small screens show less around it then. */
function setPlaying(playing) {
  document.body.classList.toggle("playing", playing);
}

function note(state) {
  byId("score-left").textContent = state.score[0];
  byId("score-right").textContent = state.score[1];
  drawShotClock(byId("clock"), state.clock, palette);
  if (state.notice === notice && !(resuming && notice === "paused")) {
    return;
  }
  notice = state.notice;
  if (!notice) {
    byId("banner").hidden = true;
    setPlaying(true);
    resuming = false;
  } else if (resuming) {
    say("Ready", "", true);
    resuming = false;
  } else {
    const [title, line, passing] = NOTICES[notice](match, state.score);
    say(title, line, passing, passing ? [] : notice === "paused" ? ["resume"] : ["again", "replay"]);
  }
  byId("pause").textContent = notice === "paused" ? "Resume" : "Pause";
  byId("pause").disabled = ["won", "lost"].includes(notice);
}

function ask() {
  if (match !== null) {
    aim.advance(seconds());
    connection.send("turn", { pointer: aim.place?.map((p) => Math.max(-10, Math.min(10, Number(p.toFixed(5))))) });
  }
}

everyPicture((now) => {
  if (match !== null) {
    turns.picture(now);
    const state = playout.at(seconds());
    if (state !== null) {
      shown = state;
      note(state);
    }
  }
  if (table !== null && shown !== null) {
    table.draw(shown.positions);
    if (match !== null && aim.place !== null && !["won", "lost"].includes(notice)) {
      table.drawTarget(aim.place, shown.positions[0]);
    }
  }
});

connection.open();
