"""The pages in a real browser, as people use them."""

from __future__ import annotations

import math
import shutil
import time
from pathlib import Path

import pytest

from airhockey_env.drawing.palette import COLORS
from airhockey_env.opponents.trained import trained_policy
from airhockey_env.replay import Replay, play_back
from airhockey_env.tables import FULL_SIZE
from benchmarks.web.browser import Browser
from tests.web.conftest import Serve

PAGES = ("/", "/watch", "/air")
SIZES = [(390, 844), (1280, 720), (1920, 1080)]

PLACE = """
const canvas = document.getElementById('table'), box = canvas.getBoundingClientRect();
const upright = box.height > box.width * 0.9;
const [x, y] = arguments, [length, width] = [2.362 + 0.24, 1.144 + 0.24];
const lying = Math.min(box.width / length, box.height / width);
const standing = Math.min(box.height / length, box.width / width);
const scale = Math.max(lying, standing), [cx, cy] = [box.left + box.width / 2, box.top + box.height / 2];
return standing > lying ? [cx - y * scale, cy - x * scale] : [cx + x * scale, cy - y * scale];
"""
"""The pixel of the page for a place on the table, m."""

ATTACK = """
const place = new Function(arguments[0]), canvas = document.getElementById('table');
const point = ([x, y]) => {
  const [clientX, clientY] = place(x, y);
  canvas.dispatchEvent(new PointerEvent('pointermove', { clientX, clientY, pointerType: 'mouse', bubbles: true }));
};
const play = () => {
  requestAnimationFrame(play);
  const [paddle, , puck] = window.state.positions;
  if (puck[0] > 0) {
    return point([-0.9, 0]);
  }
  let way = [1.181 - puck[0], (puck[1] < 0 ? -0.1 : 0.1) - puck[1]];
  way = way.map((step) => step / Math.hypot(...way));
  const behind = puck.map((at, k) => at - 0.14 * way[k]);
  if (paddle[0] > puck[0]) {
    behind[1] += puck[1] < 0 ? 0.2 : -0.2; // around it
  }
  const there = Math.hypot(paddle[0] - behind[0], paddle[1] - behind[1]) < 0.05;
  point(there ? puck.map((at, k) => at + 0.2 * way[k]) : behind);
};
play();
"""
"""Shoots into the corners of a goal that nobody guards: behind the puck, then through it. The argument is `PLACE`."""


def pixel_of(browser: Browser, x: float, y: float) -> tuple[float, float]:
    px, py = browser.run(PLACE, x, y)
    return px, py


def begin(browser: Browser, address: str, opponent: str = "idle", points: int = 7) -> None:
    """Start a match."""
    browser.open(address)
    browser.wait(lambda: browser.driver.find_elements("id", "begin"), "nothing to begin with")
    browser.choose("opponent", opponent)
    browser.choose("points", points)
    browser.click("begin")
    browser.wait(lambda: not browser.element("banner").is_displayed(), "no play")


def paddle_at(browser: Browser, x: float, y: float) -> bool:
    """Whether the left paddle is at a place of the table: its colour around its middle."""
    radius = 0.62 * FULL_SIZE.paddle_radius
    for angle in range(0, 360, 60):
        place = x + radius * math.cos(math.radians(angle)), y + radius * math.sin(math.radians(angle))
        color = browser.pixel(*pixel_of(browser, *place))
        if max(abs(a - b) for a, b in zip(color, COLORS.left, strict=True)) > 90:
            return False
    return True


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("dark", [False, True])
def test_pages_load_without_errors_and_fit_the_screen(
    page: str, size: tuple[int, int], dark: bool, browser: Browser, address: str
) -> None:
    browser.resize(*size, dark=dark)
    browser.open(address + page)
    browser.wait(lambda: browser.run("return document.readyState") == "complete", "it does not load")
    time.sleep(0.3)
    assert browser.run("return document.documentElement.scrollWidth") <= size[0]
    background = browser.run("return getComputedStyle(document.body).backgroundColor")
    assert (sum(int(part) for part in background[4:-1].split(",")) < 380) is dark


@pytest.mark.parametrize("page", PAGES)
def test_everything_has_a_name_for_those_who_do_not_see(page: str, browser: Browser, address: str) -> None:
    browser.open(address + page)
    browser.wait(lambda: browser.run("return document.readyState") == "complete", "it does not load")
    time.sleep(0.3)
    browser.driver.execute_cdp_cmd("Accessibility.enable", {})
    nodes = browser.driver.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
    named = (
        "button",
        "link",
        "checkbox",
        "combobox",
        "slider",
        "spinbutton",
        "textbox",
        "application",
        "image",
        "navigation",
    )
    nameless = [
        node["role"]["value"]
        for node in nodes
        if not node["ignored"] and node["role"]["value"] in named and not node.get("name", {}).get("value", "").strip()
    ]
    assert not nameless
    languages = browser.run("return document.documentElement.lang"), browser.run("return document.title")
    assert all(languages)


def test_the_opponent_is_named_before_the_match(browser: Browser, address: str) -> None:
    browser.open(address)
    browser.wait(lambda: browser.text("opponent-name") == "Striker", "nobody is named")
    browser.choose("opponent", "goalie")
    assert browser.text("opponent-name") == "Goalie"


def test_the_paddle_follows_the_mouse(browser: Browser, address: str) -> None:
    begin(browser, address)
    for place in ((-0.85, 0.35), (-0.75, -0.40), (-0.90, 0.30)):
        browser.point(*pixel_of(browser, *place))
        browser.wait(lambda place=place: paddle_at(browser, *place), f"the paddle is not at {place}")


def test_the_paddle_stands_off_a_finger_so_that_it_is_seen(browser: Browser, address: str) -> None:
    browser.resize(390, 844, touch=True)
    begin(browser, address)
    x, y = pixel_of(browser, -0.9, 0.2)
    browser.touch("touchStart", (x, y + 60))
    browser.touch("touchMove", (x, y + 44))
    browser.wait(lambda: paddle_at(browser, -0.9, 0.2), "the paddle is not where the finger points")
    browser.touch("touchEnd")


def test_the_paddle_follows_the_keys(browser: Browser, address: str) -> None:
    begin(browser, address)
    browser.key("keyDown", "ArrowUp")
    browser.wait(
        lambda: paddle_at(browser, -0.4 * FULL_SIZE.length, 0.5 * FULL_SIZE.width - FULL_SIZE.paddle_radius), "up"
    )
    browser.key("keyUp", "ArrowUp")


def test_a_match_is_won_announced_downloaded_and_played_back_to_the_bit(browser: Browser, address: str) -> None:
    begin(browser, address, points=1)
    browser.run(ATTACK, PLACE)
    end = time.monotonic() + 240.0
    while browser.text("title") != "You win 1 : 0":
        assert time.monotonic() < end, "the match is not won"
        if browser.text("title") == "Idle wins 1 : 0":
            browser.click("again")
            browser.wait(lambda: not browser.element("banner").is_displayed(), "no other match")
        time.sleep(0.1)
    assert browser.text("score-left") == "1" and browser.text("score-right") == "0"
    assert "You win 1 : 0" in browser.text("said")
    browser.click("replay")
    file = browser.download()
    states = list(play_back(Replay.load(file)))
    assert states[-1]["score"].tolist() == [[1, 0]] and states[-1]["done"].all()
    browser.click("again")
    browser.wait(lambda: browser.text("score-left") == "0", "no other match")


def test_a_hidden_page_pauses_and_goes_on_when_it_is_told(browser: Browser, address: str) -> None:
    begin(browser, address, "striker")
    browser.run(
        "Object.defineProperty(document, 'hidden', { value: true, configurable: true });"
        "document.dispatchEvent(new Event('visibilitychange'));"
    )
    browser.wait(lambda: browser.text("title") == "Paused", "it does not pause")
    browser.run("Object.defineProperty(document, 'hidden', { value: false })")
    browser.click("resume")
    browser.wait(lambda: not browser.element("banner").is_displayed(), "it does not go on")
    browser.key("keyDown", "KeyP")
    browser.wait(lambda: browser.text("title") == "Paused", "P does not pause")


def test_when_the_session_ends_the_page_says_why_and_begins_again(browser: Browser, serve: Serve) -> None:
    begin(browser, serve())
    browser.run("sockets.at(-1).send(JSON.stringify({ type: 'turn', pointer: 'nowhere' }))")
    browser.wait(lambda: browser.text("title") == "The session is over", "it goes on")
    assert "pointer must be" in browser.text("line").lower()
    browser.click("again")
    browser.wait(lambda: browser.text("title") == "First to 7", "it does not begin again")


# Watch


def test_two_players_play_and_their_contacts_are_drawn(browser: Browser, address: str) -> None:
    browser.open(f"{address}/watch")
    browser.wait(lambda: browser.text("left-name") == "Expert", "nobody plays")
    browser.click("impulses")
    browser.choose("speed", 1)
    browser.wait(lambda: browser.text("score-left") != "0" or browser.text("score-right") != "0", "nobody scores", 60.0)
    browser.click("pause")
    browser.click("step")
    browser.choose("right", "goalie")
    browser.click("new")
    browser.wait(lambda: browser.text("right-name") == "Goalie", "nobody else plays")


def test_a_replay_is_dropped_and_scrubbed(browser: Browser, address: str, replay: Path) -> None:
    browser.open(f"{address}/watch")
    browser.wait(lambda: browser.text("left-name") == "Expert", "nobody plays")
    browser.element("file").send_keys(str(replay))
    browser.wait(lambda: browser.element("timeline").is_displayed(), "the replay does not open")
    browser.click("pause")
    seconds = float(browser.run("return document.getElementById('scrubber').max"))
    assert seconds == pytest.approx((len(list(play_back(replay))) - 1) / 200.0)
    browser.choose("scrubber", seconds)
    browser.wait(lambda: browser.text("score-right") == "2", "the end is not shown")
    browser.choose("scrubber", 0)
    browser.wait(lambda: browser.text("score-right") == "0", "the beginning is not shown")
    browser.choose("scrubber", seconds - 0.2)
    browser.click("pause")
    browser.wait(lambda: browser.text("pause") == "Resume" and browser.text("score-right") == "2", "it does not end")
    browser.click("pause")
    browser.wait(lambda: browser.text("score-right") == "0", "it does not begin again")
    browser.click("close-replay")
    browser.wait(lambda: browser.text("left-name") == "Expert", "the match does not go on")


def test_what_is_no_replay_is_refused_with_a_reason(browser: Browser, address: str, tmp_path: Path) -> None:
    browser.allowed_errors.append("422")
    browser.open(f"{address}/watch")
    browser.wait(lambda: browser.text("left-name") == "Expert", "nobody plays")
    (tmp_path / "policy.npz").write_bytes(b"PK nothing of the kind")
    browser.element("file").send_keys(str(tmp_path / "policy.npz"))
    browser.wait(lambda: browser.text("title") == "This replay cannot be shown", "it is taken for a replay")
    assert "not hold a replay" in browser.text("line")


def test_a_training_run_is_watched_while_it_learns(browser: Browser, serve: Serve, tmp_path: Path) -> None:
    run = tmp_path / "my_run"
    run.mkdir()
    browser.open(serve("--run", str(run)))
    browser.wait(lambda: browser.text("title") == "my_run has no policy yet", "it does not wait")
    trained_policy("adept").save(run / "policy.npz")
    (run / "config.json").write_text('{"steps": 1000}')
    rows = '{"steps": %d, "win_rate": 0.5, "win_rate_95": [0.4, 0.6]}'
    (run / "evaluations.json").write_text(f'{{"evaluations": [{rows % 100}], "updates": []}}')
    browser.wait(lambda: browser.text("left-name") == "My_run", "its policy does not play")
    browser.wait(lambda: browser.text("run-note") == "100 steps of 1,000", "its records are not shown")
    (run / "part.json").write_text(f'{{"evaluations": [{rows % 100}, {rows % 200}], "updates": []}}')
    shutil.move(run / "part.json", run / "evaluations.json")
    browser.wait(lambda: browser.text("run-note") == "200 steps of 1,000", "its curves do not grow")
    assert "all points 0.5" in browser.run("return document.querySelector('.chart canvas').ariaLabel")


def test_runs_and_players_are_chosen_from_one_list(browser: Browser, serve: Serve, tmp_path: Path) -> None:
    for name, steps in (("one", 100), ("two", 200)):
        (tmp_path / name).mkdir()
        trained_policy("adept").save(tmp_path / name / "policy.npz")
        rows = f'{{"evaluations": [{{"steps": {steps}, "win_rate": 0.5}}], "updates": []}}'
        (tmp_path / name / "evaluations.json").write_text(rows)
    browser.open(serve("--run", str(tmp_path / "one"), "--run", str(tmp_path / "two")))
    browser.wait(lambda: browser.text("run-note") == "100 steps", "the first run is not shown")
    browser.choose("left", "run two")
    browser.click("new")
    browser.wait(lambda: browser.text("run-note") == "200 steps", "the other run is not shown")
    browser.choose("left", "goalie")
    browser.click("new")
    browser.wait(lambda: browser.text("left-name") == "Goalie", "no player plays")
    assert not browser.element("side").is_displayed()
