"""Playing a replay back: equal to the bit, or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from airhockey_env._base import draw_row, make_renderer
from airhockey_env.checks import check_positive
from airhockey_env.game import Game
from airhockey_env.kernel.parameters import spec_of, with_specs
from airhockey_env.opponents.players import NAMES
from airhockey_env.replay.dynamics import fingerprint, make_game, play_actions, recorded_name
from airhockey_env.replay.file import Replay
from airhockey_env.saved_states import game_state
from airhockey_env.version import __version__


def play_back(replay: Replay | str | Path) -> Iterator[NDArray[np.void]]:
    """The states of a replay: (1,) records as `AirHockeyEnv.get_state` returns, at each segment's start and every step.

    Args:
        replay: or the file that holds one.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no replay; or the dynamics are not those that it was recorded with. The latter is
            told at once by the fingerprint or, at the latest, at the end of a segment.
    """
    prepared, game = _prepared(replay)
    return (game.get_state() for _ in _played(prepared, game))


def play_back_game(replay: Replay | str | Path) -> Iterator[Game]:
    """The game at the states of a replay, for what a state does not hold: the contacts of the last step, say.

    Args:
        replay: or the file that holds one.

    Yields:
        The same game of one table each time, at each start and after every step.

    Raises:
        FileNotFoundError, ValueError: as for `play_back`.
    """
    prepared, game = _prepared(replay)
    return (game for _ in _played(prepared, game))


def play_back_frames(
    replay: Replay | str | Path, *, size: tuple[int, int] | None = None, fps: float | None = None
) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a replay, (height, width, 3) uint8.

    Args:
        replay: or the file that holds one.
        size: (width, height) px, or None for the renderer's own.
        fps: pictures for a second of play, at most the control rate; None for one of every state.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: as in `play_back`; or size or fps are out of range.
    """
    prepared, game = _prepared(replay)
    rate = prepared.control_hz
    every = 1.0 if fps is None else rate / check_positive("fps", fps, rate)
    renderer = make_renderer(game.spec, size)

    def frames() -> Iterator[NDArray[np.uint8]]:
        shown = 0.0
        for number, _ in enumerate(_played(prepared, game)):
            if number >= shown:
                yield draw_row(renderer, game, 0)
                shown += every

    return frames()


def _prepared(replay: Replay | str | Path) -> tuple[Replay, Game]:
    """A replay, and a game that plays as the one that was recorded."""
    if not isinstance(replay, Replay):
        replay = Replay.load(replay)
    try:
        opponent = replay.arguments["opponent"]
        if opponent is not None and recorded_name(opponent) is None:  # the path of a file, say
            raise ValueError(f"opponent must be null or one of {NAMES}, got {opponent!r}")
        game = make_game(replay.arguments)
        now = fingerprint(replay.arguments)
    except (TypeError, ValueError, KeyError, AttributeError, OverflowError, RecursionError) as error:
        raise ValueError(f"{replay.name} holds a game that this version cannot play: {error}") from error
    if now != replay.fingerprint:
        raise ValueError(
            f"{replay.name} was recorded with other dynamics, by version {replay.version} of airhockey-env (or on a "
            f"machine that calculates differently), and would not play back the same in this version {__version__}"
        )
    dtype = game.get_state().dtype
    if replay.states.dtype != dtype or replay.ends.dtype != dtype:
        raise ValueError(f"{replay.name} holds states of another layout than those of this version {__version__}")
    for states in (replay.states, replay.ends):
        _check_states(replay, game, states)
    if game_state(replay.states)["done"].any():
        raise ValueError(f"{replay.name} begins a segment with a game that is over")
    return replay, game


def _check_states(replay: Replay, game: Game, states: NDArray[np.void]) -> None:
    """What `Game.set_state` leaves to its callers: that an episode is under way, under physics that there can be."""
    table = game_state(states)
    counts = [table[name] for name in ("steps", "clock", "score")]
    if not (np.abs(table["side"]) == 1).all() or any((count < 0).any() for count in counts):
        raise ValueError(f"{replay.name} holds states of a game that never began")
    if game.randomized:
        for params in states["parameters"]:
            try:
                spec_of(params)
            except ValueError as error:
                raise ValueError(f"{replay.name} holds physics that no table can have: {error}") from error
        if with_specs(states["parameters"], states["parameters"]["spec"]).tobytes() != states["parameters"].tobytes():
            raise ValueError(f"{replay.name} holds physics that do not follow from its table")


def _played(replay: Replay, game: Game) -> Iterator[None]:
    """Bring the game to the replay's states, one after the other."""
    last = [*replay.starts[1:].tolist(), len(replay)]
    for segment, (start, stop) in enumerate(zip(replay.starts.tolist(), last, strict=True)):
        try:
            game.set_state(replay.states[segment : segment + 1])
        except ValueError as error:
            raise ValueError(f"{replay.name} holds a state that no game can be in: {error}") from error
        yield
        for k in range(start, stop):
            if game.done[0]:
                raise ValueError(f"{replay.name} goes on after the end of a game, in step {k}")
            play_actions(game, replay.actions[k], replay.right_actions[k] if len(replay.right_actions) else None)
            yield
        if game.get_state().tobytes() != replay.ends[segment].tobytes():
            raise ValueError(
                f"{replay.name} has not played back the same from step {start} to {stop}: it was recorded with other "
                f"dynamics, by version {replay.version} of airhockey-env, or is damaged"
            )
