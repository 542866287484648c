"""The page "Play" without a server: it plays the game of the package to the bit, and people can use it."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import math
import threading
import time
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from gymnasium.vector import AutoresetMode

from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.live import LiveMatch
from airhockey_env.live.match import CONTROL_HZ, POLICY_HZ
from airhockey_env.live.pointer import Pointer
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import trained_policy
from airhockey_env.replay import Replay, play_back
from airhockey_env.reset_options import ResetOptions
from airhockey_env.tables import PRESETS
from benchmarks.web.browser import Browser
from docs.play import build
from docs.play.page import POINTS, TRAINED, facts, write_page
from tests.web.test_pages import SIZES, paddle_at, pixel_of

STEPS = 6000
LAYERS = (13, 192, 21, 2)


def other_policy() -> MlpPolicy:
    """A policy with other layers and functions than those of the trained ones."""
    rng = np.random.default_rng(0)
    shapes = list(itertools.pairwise(LAYERS))
    weights = [rng.normal(0.0, 0.3, (n_out, n_in)).astype(np.float32) for n_in, n_out in shapes]
    biases = [rng.normal(0.0, 1.0, n_out).astype(np.float32) for _, n_out in shapes]
    return MlpPolicy(weights, biases, activation="tanh", squash=True)


POLICIES = {**{name: trained_policy(name) for name in TRAINED}, "other": other_policy()}

PLAY = """
const [opponent, table, points, skill, stream, actions, done] = arguments;
(async () => {
  const { Game } = await import("/js/game.js");
  const game = await Game.load();
  game.start({ opponent, table, points, skill, stream: BigInt(stream) });
  const states = [game.save(), ...actions.map((action) => (game.step(action), game.save()))];
  const digest = await crypto.subtle.digest("SHA-256", await new Blob(states).arrayBuffer());
  return [...new Uint8Array(digest)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
})().then(done, (error) => done(String(error)));
"""
"""Plays the actions, and answers with the hash of all states."""


class Played(NamedTuple):
    """A match in Python."""

    stream: int  # the random stream's state before it
    actions: list[list[float]]  # of the left player
    digest: str  # of all states
    points: int
    fouls: int
    touched: int  # contacts with paddles


def play(opponent: str, table: str, skill: float, chase: float) -> Played:
    """A match, or the beginning of it, against a player whose policy chooses as often as in a live match.

    Args:
        opponent: "striker" or a name in `POLICIES`.
        table: a preset's name.
        skill: the opponent's.
        chase: 1/s, how fast the left player goes after the puck; 0 for one that rests.
    """
    scripted = None if opponent in POLICIES else opponent
    game = Game(
        1,
        right=scripted,
        right_skill=skill,
        table=table,
        points=POINTS,
        control_hz=CONTROL_HZ,
        autoreset_mode=AutoresetMode.DISABLED,
    )
    row = np.zeros(1, np.int64)
    game.seed([3], row, lambda n: np.zeros(n))
    stream = int(game.states["stream"][0])
    game.begin(row, ResetOptions())
    digest, actions, right = hashlib.sha256(game.states.tobytes()), [], None
    fouls = touched = 0
    while len(actions) < STEPS and not game.done[0]:
        if scripted is None and len(actions) % round(CONTROL_HZ / POLICY_HZ) == 0:
            right = POLICIES[opponent](game.out.observation[RIGHT]) * np.float32(skill)
        left = (chase * (game.positions[:, PUCK] - game.positions[:, LEFT])).astype(np.float32)
        game.play(left, right)
        actions.append(left[0].tolist())
        digest.update(game.states.tobytes())
        touched += int((game.contacts_of(0)["b"] >= 0).sum())
        fouls += int(game.out.foul[0])
    return Played(stream, actions, digest.hexdigest(), int(game.states["score"].sum()), fouls, touched)


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


@contextlib.contextmanager
def serving(folder: Path) -> Iterator[str]:
    """A server of the files in a folder; yields its address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of the page."""
    folder = tmp_path_factory.mktemp("play")
    write_page(folder, POLICIES)
    with serving(folder) as address:
        yield address


@pytest.fixture(scope="module", params=["committed", "built anew"])
def any_site(request: pytest.FixtureRequest, site: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The same, with the game as it was committed, and as it is built here."""
    if request.param == "committed":
        yield site
        return
    folder = tmp_path_factory.mktemp("anew")
    write_page(folder, POLICIES)
    try:
        build.build(folder / "game.wasm")
    except DependencyNotInstalled as error:
        pytest.skip(str(error))
    with serving(folder) as address:
        yield address


def digest_of(played: Played, browser: Browser, opponent: str, table: str, skill: float) -> str:
    """The hash of the states that the page comes through with the same actions."""
    arguments = (opponent, table, POINTS, skill, str(played.stream), played.actions)
    return str(browser.driver.execute_async_script(PLAY, *arguments))


@pytest.mark.parametrize(("table", "skill"), list(zip(PRESETS, (1.0, 0.6, 0.9), strict=True)))
@pytest.mark.parametrize("opponent", [*TRAINED, "striker"])
def test_it_plays_the_same_game_to_the_bit(
    opponent: str, table: str, skill: float, any_site: str, browser: Browser
) -> None:
    played = play(opponent, table, skill, chase=10.0)
    assert played.points >= 2 and played.touched >= 10
    browser.open(any_site)
    assert digest_of(played, browser, opponent, table, skill) == played.digest


@pytest.mark.parametrize("opponent", ["striker", "other"])
def test_fouls_and_policies_of_other_forms_are_the_same(opponent: str, any_site: str, browser: Browser) -> None:
    played = play(opponent, "full_size", 1.0, chase=0.0)
    assert played.fouls >= 1
    browser.open(any_site)
    assert digest_of(played, browser, opponent, "full_size", 1.0) == played.digest
    assert digest_of(played, browser, opponent, "challenge", 1.0) != played.digest


def begin(browser: Browser, site: str) -> None:
    """Load the page and start a match against the player that is chosen."""
    browser.open(site)
    browser.wait(lambda: browser.run("return document.querySelector('#begin:enabled') !== null"), "no game")
    browser.click("begin")
    browser.wait(lambda: not browser.element("banner").is_displayed(), "no play")


def test_the_replay_of_a_match_plays_back_in_python(site: str, browser: Browser) -> None:
    begin(browser, site)
    assert browser.text("opponent-name").lower() == TRAINED[0]
    for k in range(40):
        browser.point(*pixel_of(browser, -0.5 + 0.3 * math.sin(0.5 * k), 0.4 * math.cos(0.7 * k)))
        time.sleep(0.05)
    browser.click("download")
    replay = Replay.load(browser.download())
    states = list(play_back(replay))
    assert len(states) == len(replay) + 1 > 300
    assert np.ptp([state["position"][0, LEFT] for state in states], axis=0).min() > 0.3
    assert np.ptp([state["position"][0, RIGHT] for state in states]) > 0.1


@pytest.mark.parametrize("size", SIZES)
def test_it_fits_the_screen(size: tuple[int, int], site: str, browser: Browser) -> None:
    browser.resize(*size)
    begin(browser, site)
    assert browser.run("return document.documentElement.scrollWidth") <= size[0]


def test_points_are_counted(site: str, browser: Browser) -> None:
    begin(browser, site)
    browser.wait(lambda: browser.text("score-right") != "0", "nobody scores while the paddle rests", seconds=60.0)
    assert browser.text("score-left") == "0"


def test_a_finger_moves_the_paddle_on_a_phone(site: str, browser: Browser) -> None:
    browser.resize(390, 844, touch=True)
    begin(browser, site)
    x, y = pixel_of(browser, -0.6, 0.2)
    browser.touch("touchStart", (x, y + 44.0))  # the paddle stands off the finger
    browser.wait(lambda: paddle_at(browser, -0.6, 0.2), "the paddle is not there", seconds=5.0)
    browser.touch("touchEnd")


def test_keys_move_the_paddle_and_pause(site: str, browser: Browser) -> None:
    begin(browser, site)
    browser.key("keyDown", "ArrowUp")
    browser.wait(lambda: paddle_at(browser, -0.9448, 0.5215), "the paddle is not there", seconds=5.0)
    browser.key("keyUp", "ArrowUp")
    browser.key("keyDown", "KeyP")
    browser.wait(lambda: browser.text("title") == "Paused", "no pause")
    browser.click("resume")
    browser.wait(lambda: not browser.element("banner").is_displayed(), "no play")


WHOLE_MATCH = """
const [opponent, done] = arguments;
(async () => {
  const [{ Game }, { Match }] = await Promise.all([import("/js/game.js"), import("/js/match.js")]);
  const match = new Match(await Game.load(), { opponent, table: "full_size", points: 7, skill: 1 }, 0);
  const notices = new Set();
  for (let now = 0; now < 900 && !["won", "lost"].includes(match.notice); now += 1 / 60) {
    match.advance(now, [-0.9 + 0.25 * Math.sin(3 * now), 0.35 * Math.cos(2.2 * now)]);
    notices.add(match.notice);
  }
  return [[...notices], match.advance(1000, null).score, [...match.replay()]];
})().then(done, (error) => done(String(error)));
"""
"""Plays a match faster than life: what it rested for, the score, and the bytes of its replay."""


@pytest.mark.parametrize("opponent", ["expert", "striker"])
def test_a_whole_match_plays_back_in_python(opponent: str, site: str, browser: Browser, tmp_path: Path) -> None:
    browser.open(site)
    notices, score, content = browser.driver.execute_async_script(WHOLE_MATCH, opponent)
    assert {"start", "", "conceded"} <= set(notices) and {"won", "lost"} & set(notices)
    assert max(score) == POINTS > min(score)
    (tmp_path / "match.npz").write_bytes(bytes(content))
    *_, last = play_back(tmp_path / "match.npz")
    assert last["score"][0].tolist() == score and last["done"][0]


FOLLOW = """
const [table, live, cases, done] = arguments;
Promise.all([import("/js/hand.js"), import("/js/pointer.js")]).then(([{ Hand }, { Pointer }]) => {
  const [hand, pointer] = [new Hand(table, 0.005), new Pointer(live)];
  done(cases.map(([time, pointed, place, velocity]) => {
    pointer.move(time, pointed);
    const when = time - 0.004;
    return hand.follow(place, velocity, hand.reachable(pointer.place(when)), pointer.velocity(when));
  }));
});
"""


def test_the_paddle_follows_the_pointer_as_in_python(site: str, browser: Browser) -> None:
    rng = np.random.default_rng(0)
    match = LiveMatch("idle")
    pointer, hand = Pointer(), match.hand
    cases, expected, pointed = [], [], np.zeros(2)
    for k in range(200):
        pointed = pointed + rng.normal(0.0, 0.03, 2) if k % 20 else rng.uniform(-1.0, 0.0, 2)
        now, place, velocity = 0.016 * k, rng.uniform(-0.5, 0.0, 2), rng.normal(0.0, 1.0, 2)
        pointer.move(now, (float(pointed[0]), float(pointed[1])))
        target = hand.reachable(pointer.place(now - 0.004))
        expected.append(hand.follow(place, velocity, target, pointer.velocity(now - 0.004)))
        cases.append([now, pointed.tolist(), place.tolist(), velocity.tolist()])
    known = facts({})
    browser.open(site)
    actions = browser.driver.execute_async_script(FOLLOW, known["tables"]["full_size"], known["live"], cases)
    assert np.abs(expected).max() > 0.9
    np.testing.assert_allclose(actions, expected, rtol=0.0, atol=1e-9)


@pytest.fixture
def site_without_game(tmp_path: Path) -> Iterator[str]:
    """The address of a page whose game is missing."""
    write_page(tmp_path, POLICIES)
    (tmp_path / "game.wasm").unlink()
    with serving(tmp_path) as address:
        yield address


# The server is a fixture before the browser's, so that it serves until the browser has left: Chromium may ask for the
# icon at any time, and a server that stops before would be an error in the console.
def test_a_page_that_cannot_load_its_game_says_so(site_without_game: str, browser: Browser) -> None:
    browser.allowed_errors.append("game.wasm")
    browser.open(site_without_game)
    browser.wait(lambda: "game.wasm" in browser.text("line"), "no reason")


def test_directions_and_stacks_are_refused(tmp_path: Path) -> None:
    policy = MlpPolicy([np.zeros((9, 13), np.float32)], [np.zeros(9, np.float32)])
    with pytest.raises(ValueError, match="discrete=True"):
        write_page(tmp_path, {"discrete": policy})
