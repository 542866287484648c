"""The game in C that the benchmark measures against is the same game."""

from __future__ import annotations

import numpy as np
import pytest

from airhockey_env.game import Game
from airhockey_env.records import AUTORESET_NEXT_STEP, AUTORESET_SAME_STEP, CONTACT_ROWS
from benchmarks.reference import OUTPUTS, STATE, CGame, compiler

pytestmark = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")

TABLES, STEPS = 128, 300


def the_same(game: Game, c_game: CGame) -> None:
    for name in STATE.names:
        np.testing.assert_array_equal(c_game.tables[name], game.tables[name], err_msg=name)
    recorded = np.arange(CONTACT_ROWS) < game.tables["n_contacts"][:, np.newaxis]
    for name in OUTPUTS:
        ours, theirs = getattr(game.out, name), c_game.out[name]
        if name == "contacts":
            ours, theirs = ours[recorded], theirs[recorded]
        np.testing.assert_array_equal(theirs, ours, err_msg=name)


@pytest.mark.parametrize("autoreset", [AUTORESET_NEXT_STEP, AUTORESET_SAME_STEP])
@pytest.mark.parametrize("play", ["random", "chase"])
def test_the_c_game_plays_the_same_to_the_bit(autoreset: int, play: str) -> None:
    game = Game(TABLES, autoreset=autoreset, max_episode_steps=200, num_threads=1)
    game.seed(list(range(TABLES)))
    game.reset()
    c_game = CGame(game)
    the_same(game, c_game)
    rng = np.random.default_rng(0)
    contacts = goals = timeouts = 0
    for _ in range(STEPS):
        actions = rng.uniform(-1.5, 1.5, (TABLES, 2)).astype(np.float32)
        if play == "chase":  # contacts of every kind: the puck is squeezed against walls and posts
            actions[:, 0] = game.out.observation[:, 8] - game.out.observation[:, 0]
            actions[:, 1] = game.out.observation[:, 9] - game.out.observation[:, 1]
            actions *= 20.0
        game.step(actions)
        c_game.step(actions)
        the_same(game, c_game)
        contacts = max(contacts, int(game.tables["n_contacts"].max()))
        goals += int(game.out.terminated.sum())
        timeouts += int(game.out.truncated.sum())
    assert contacts >= 3
    assert goals > 100
    assert timeouts > 5 or play == "chase"


def test_resets_are_the_same() -> None:
    game = Game(TABLES, autoreset=AUTORESET_NEXT_STEP, num_threads=1)
    game.seed(list(range(TABLES)))
    c_game = CGame(game)
    game.reset()
    c_game.reset()
    the_same(game, c_game)


def test_actions_of_another_kind_are_refused() -> None:
    c_game = CGame(Game(TABLES))
    with pytest.raises(ValueError, match="actions must be contiguous float32"):
        c_game.step(np.zeros((TABLES, 2)))
