/** The page "Watch": two players of the server, a training run's newest policy, or a replay. */
import { Connection } from "./connection.js";
import { COLORS, Marks } from "./marks.js";
import { byId, capital, everyPicture, seconds, setOptions, showValue } from "./page.js";
import { Playout } from "./playout.js";
import { RunCurves } from "./run.js";
import { drawShotClock } from "./shot_clock.js";
import { Table } from "./table.js";
import { playBack } from "./trajectory.js";
import { Turns } from "./turns.js";
import { View } from "./view.js";

const AGAIN = 2500; // ms from the end of a match to the next one
const WAIT = 2000; // ms between two looks whether a run has a policy

const NOTICES = {
  start: () => "",
  goal: () => `Goal for ${match.left}`,
  conceded: () => `Goal for ${match.right}`,
  foul: () => "Shot clock",
  won: (score) => `${capital(match.left)} wins ${score.join(" : ")}`,
  lost: (score) => `${capital(match.right)} wins ${score.toReversed().join(" : ")}`,
};

const connection = new Connection("watch");
const playout = new Playout();
const marks = new Marks();
const turns = new Turns(ask);
const canvas = byId("table");
const view = new View(canvas, () => table?.prepare());
let table = null;
let palette = null;
let tables = {};
let curves = null; // of training runs, where there are some
let run = null; // the name of a training run, if one is watched
let waiting = 0; // the timer until the next look whether it has a policy
let match = null; // the server's message "match", while there is one
let replay = null; // a Trajectory, while one is open
let replayTime = 0;
let shown = null; // the state in the picture
let notice = null;
let paused = false;
let last = 0;

// What the server says ------------------------------------------------------------------------------------------------

connection.on("hello", (hello) => {
  ({ palette, tables } = hello);
  table ??= new Table(view, palette);
  setLeft(hello.runs, hello.players);
  setOptions(byId("right"), hello.players, "striker");
  setOptions(byId("tables"), Object.keys(tables), "full_size");
  start();
});

connection.on("waiting", (message) => {
  match = null;
  showRun(message.run);
  table.show(tables[byId("tables").value]);
  say(`${run} has no policy yet`, "It is watched as soon as its first checkpoint is written");
  waiting = setTimeout(start, WAIT);
});

connection.on("match", (message) => {
  match = message;
  showRun(match.run);
  if (replay === null) {
    table.show(match.table);
    name(match.left, match.right);
  }
  playout.clear();
  marks.clear();
  turns.clear();
  notice = null;
  hush();
});

connection.on("state", (state) => {
  const now = seconds();
  playout.push(state, now);
  turns.answered(now);
  marks.add(state.contacts ?? []);
});

connection.on("end", ({ reason }) => {
  match = null;
  if (replay === null) {
    say("The session is over", capital(reason), ["Watch again", () => connection.open()]);
  }
});

// What the person does ------------------------------------------------------------------------------------------------

function start() {
  clearTimeout(waiting);
  if (!connection.isOpen) {
    connection.open();
    return;
  }
  const { run: learning } = byId("left").selectedOptions[0].dataset;
  const who = learning === undefined ? { left: byId("left").value } : { run: learning };
  connection.send("start", { ...who, right: byId("right").value, table: byId("tables").value, speed: speed() });
}

/** s of the match for a second on the wall. */
function speed() {
  return paused ? 0 : 10 ** Number(byId("speed").value);
}

function setPaused(now) {
  paused = now;
  byId("pause").textContent = paused ? "Resume" : "Pause";
  byId("step").disabled = !paused;
  connection.send("speed", { speed: speed() });
}

/** Pause or go on; a replay that has ended begins again. */
function togglePause() {
  if (paused && replay !== null && replayTime >= replay.seconds) {
    seek(0);
  }
  setPaused(!paused);
}

function step() {
  if (replay !== null) {
    seek(replayTime + 1 / replay.control_hz);
  } else if (match !== null) {
    turns.asked();
    connection.send("step");
  }
}

byId("choices").addEventListener("submit", (event) => {
  event.preventDefault();
  closeReplay();
  start();
});
byId("pause").addEventListener("click", togglePause);
byId("step").addEventListener("click", step);
byId("speed").addEventListener("input", () => {
  showValue("speed", `× ${Number((10 ** Number(byId("speed").value)).toPrecision(2))}`);
  connection.send("speed", { speed: speed() });
});
document.addEventListener("keydown", (event) => {
  if (event.target.closest("input, select, button")) {
    return;
  }
  if (event.code === "Space") {
    event.preventDefault();
    togglePause();
  } else if (event.code === "Period" && paused) {
    step();
  }
});

// Replays -------------------------------------------------------------------------------------------------------------

async function openReplay(file) {
  say("Playing the replay back", file.name);
  try {
    replay = await playBack(file);
  } catch (error) {
    say("This replay cannot be shown", capital(error.message), ["Close", hush]);
    return;
  }
  hush();
  table.show(replay.table);
  name("left", replay.opponent ?? "right");
  byId("timeline").hidden = false;
  byId("side").hidden = true;
  byId("scrubber").max = replay.seconds;
  byId("said").textContent = `A replay of ${replay.seconds.toFixed(1)} s, played back to the bit`;
  seek(0);
  setPaused(false);
}

function closeReplay() {
  if (replay !== null) {
    setPaused(false);
  }
  replay = null;
  byId("timeline").hidden = true;
  byId("side").hidden = run === null;
  if (match !== null) {
    table.show(match.table);
    name(match.left, match.right);
  } else {
    connection.open(); // the session has ended meanwhile
  }
}

function seek(time) {
  replayTime = Math.min(Math.max(time, 0), replay.seconds);
  byId("scrubber").value = replayTime;
  byId("time-shown").textContent = `${clockTime(replayTime)} / ${clockTime(replay.seconds)}`;
}

function clockTime(time) {
  return `${Math.floor(time / 60)}:${(time % 60).toFixed(1).padStart(4, "0")}`;
}

byId("scrubber").addEventListener("input", (event) => seek(Number(event.target.value)));
byId("close-replay").addEventListener("click", closeReplay);
byId("file").addEventListener("change", (event) => {
  if (event.target.files.length) {
    openReplay(event.target.files[0]);
    event.target.value = "";
  }
});
const stage = canvas.parentElement;
document.addEventListener("dragover", (event) => {
  event.preventDefault();
  stage.classList.add("dropping");
});
document.addEventListener("dragleave", (event) => event.relatedTarget || stage.classList.remove("dropping"));
document.addEventListener("drop", (event) => {
  event.preventDefault();
  stage.classList.remove("dropping");
  if (event.dataTransfer.files.length) {
    openReplay(event.dataTransfer.files[0]);
  }
});

// What is shown -------------------------------------------------------------------------------------------------------

/** Offer runs and players for the left side: the run that the address asks for, the first one, or the expert. */
function setLeft(runs, players) {
  const [before, asked] = [byId("left").value, new URLSearchParams(location.search).get("run")];
  const options = runs.map((name) => {
    const option = new Option(`${name} (run)`, `run ${name}`);
    option.dataset.run = name;
    return option;
  });
  byId("left").replaceChildren(...options, ...players.map((name) => new Option(name, name)));
  byId("left").value = before || (runs.length ? `run ${runs.includes(asked) ? asked : runs[0]}` : "expert");
}

/** Show the curves of a training run beside the table, or none. */
function showRun(name) {
  run = name;
  byId("side").hidden = run === null || replay !== null;
  if (run !== null) {
    byId("run-name").textContent = run;
    curves ??= new RunCurves(byId("charts"), byId("run-note"));
    curves.follow(run);
  }
}

function name(left, right) {
  byId("left-name").textContent = capital(left);
  byId("right-name").textContent = capital(right);
}

function say(title, line = "", button = null) {
  byId("title").textContent = title;
  byId("line").textContent = line;
  const element = document.createElement("button");
  if (button !== null) {
    element.className = "main";
    element.textContent = button[0];
    element.addEventListener("click", button[1]);
  }
  byId("buttons").replaceChildren(...(button === null ? [] : [element]));
  byId("banner").classList.toggle("passing", button === null);
  byId("banner").hidden = false;
  byId("said").textContent = `${title}. ${line}`;
}

function hush() {
  byId("banner").hidden = true;
}

function note(state) {
  byId("score-left").textContent = state.score[0];
  byId("score-right").textContent = state.score[1];
  drawShotClock(byId("clock"), state.clock, palette);
  if (state.notice === undefined || state.notice === notice) {
    return;
  }
  notice = state.notice;
  const title = notice ? NOTICES[notice](state.score) : "";
  // Fast matches would only flicker.
  title && (speed() <= 2 || ["won", "lost"].includes(notice)) ? say(title) : hush();
  if (["won", "lost"].includes(notice)) {
    const over = match;
    setTimeout(() => over === match && connection.send("restart"), AGAIN);
  }
}

function ask() {
  connection.send("turn", { contacts: byId("contacts").checked || byId("normals").checked || byId("impulses").checked });
}

everyPicture(() => {
  const now = seconds();
  const elapsed = Math.min(now - last, 0.1);
  last = now;
  if (table === null) {
    return;
  }
  const what = { contacts: byId("contacts").checked, normals: byId("normals").checked, impulses: byId("impulses").checked };
  if (replay !== null) {
    if (!paused) {
      seek(replayTime + elapsed * speed());
      replayTime < replay.seconds || setPaused(true);
    }
    shown = replay.at(replayTime);
    note(shown);
    table.draw(shown.positions);
    const pace = paused ? 0.05 : speed();
    marks.clear();
    marks.add(replay.contactsBetween(replayTime - pace, replayTime));
    marks.draw(view, replayTime, pace, what);
  } else if (match !== null) {
    turns.picture(now);
    shown = playout.at(now) ?? shown;
    if (shown !== null) {
      note(shown);
      table.draw(shown.positions);
      marks.draw(view, shown.elapsed, speed(), what);
    }
  }
});

for (const [name, color] of Object.entries(COLORS)) {
  byId(name).style.accentColor = color;
}
connection.open();
