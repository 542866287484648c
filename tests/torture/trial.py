"""Trials: whatever is done to a face is done to plain games beside it, one a table, and all must come to the same bits.

The plain games' tables are checked against the laws after every step.
"""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, OBSERVATION_SIZE, RIGHT
from tests.torture.apis import FACES, Seen
from tests.torture.cases import Case, decode_state, decoded
from tests.torture.hostile import play_hostile
from tests.torture.laws import (
    DRAWN,
    FAILURES,
    FINE,
    OBSERVED,
    POINTS,
    RANGES,
    check_state,
    check_step,
    in_ranges,
    new_tally,
)

NOT_AGAIN = "not the same bits when played again"

OF_FACES = ("num_envs", "autoreset_mode", "num_threads", "render_mode", "render_size")
"""Arguments that a plain game does not have."""

INTERFACE = {"stack", "action_delay_ms"}
"""Arguments of which a plain game has one for each seat."""


class Broken(Exception):
    """A law was broken; the message says which."""


def pursue(seen: NDArray[np.float32]) -> NDArray[np.float32]:
    """Chase the puck."""
    return 5.0 * (seen[:, 8:10] - seen[:, 0:2])


def crowd(seen: NDArray[np.float32]) -> NDArray[np.float32]:
    """Chase where the puck will be, to and fro."""
    ahead = seen[:, 8:10] + 0.3 * seen[:, 10:12] - seen[:, 0:2]
    return np.where(seen[:, 12:13] * 100.0 % 2.0 < 1.0, 20.0 * ahead, -20.0 * ahead)


OPPONENTS = {"@pursue": pursue, "@crowd": crowd}
"""Those from outside, by the names that cases have for them."""


def arguments_for(given: dict[str, Any]) -> dict[str, Any]:
    """A face's arguments as it takes them, from those of a case."""
    arguments = dict(given)
    if "table" in given:
        arguments["table"] = decoded(given["table"])
    opponent = given.get("opponent")
    if isinstance(opponent, str):
        arguments["opponent"] = OPPONENTS.get(opponent, opponent)
    elif isinstance(opponent, list):
        arguments["opponent"] = [OPPONENTS.get(one, one) if isinstance(one, str) else one for one in opponent]
    return arguments


class Row:
    """One table, in a plain game of its own: what a face must come to."""

    def __init__(self, arguments: dict[str, Any], i: int, mode: AutoresetMode, tally: NDArray[np.float64]) -> None:
        own = {name: value for name, value in arguments.items() if name not in OF_FACES}
        skill, opponent = own.pop("opponent_skill", 1.0), own.pop("opponent", "striker")
        if opponent is not None:
            own["camera"] = own.get("camera"), None
        for name in INTERFACE & own.keys():
            own[f"left_{name}"] = value = own.pop(name)
            if opponent is None:
                own[f"right_{name}"] = value
        skill = skill[i] if isinstance(skill, list) else skill
        mode_of_game = AutoresetMode.DISABLED
        self.game = Game(1, right=opponent, right_skill=skill, **own, autoreset_mode=mode_of_game, num_threads=1)
        if isinstance(opponent, list):
            self.game.pools[RIGHT].assign(i % len(opponent))
        self._mode = mode
        self._tally = tally
        self._work = np.zeros((2, 1, OBSERVATION_SIZE), np.float32)

    @property
    def done(self) -> bool:
        """Whether the episode is over."""
        return bool(self.game.done[0])

    def reset(self, seed: int | None = None, options: Any = None) -> Seen:
        """Begin an episode."""
        game = self.game
        game.reset(seed, options=options)
        self._tally[DRAWN] += bool(game.randomized)
        if not in_ranges(game.parameters[0], game.ranges):
            raise Broken(FAILURES[RANGES])
        self._check(check_state(game.states[0], game.parameters[0], self._work, self._tally))
        return self._seen(0.0, False, False, False)

    def step(self, action: Any, other: Any = None) -> Seen:
        """Play a step, and begin the next episode as the mode has it."""
        game, out = self.game, self.game.out
        if self.done and self._mode == AutoresetMode.NEXT_STEP:
            return self.reset()
        before = game.states[0].copy()
        game.step([action], None if other is None else [other])
        told = float(out.reward[LEFT, 0]), bool(out.terminated[0]), bool(out.truncated[0])
        self._check(
            check_step(
                before,
                game.states[0],
                game.parameters[0],
                game.settings[0],
                out.contacts[0],
                int(out.n_contacts[0]),
                *told,
                self._work,
                self._tally,
            )
        )
        self._tally[POINTS] += game.states["score"][0].sum() - before["score"].sum()
        seen = self._seen(*told, bool(out.success[0]))
        if self.done and self._mode == AutoresetMode.SAME_STEP:
            seen["final"] = seen["observation"]
            seen["observation"] = self.reset()["observation"]
        return seen

    def _check(self, failure: int) -> None:
        if failure != FINE:
            raise Broken(FAILURES[failure])

    def _seen(self, reward: float, terminated: bool, truncated: bool, success: bool) -> Seen:
        game = self.game
        if game.interfaces.parts and not (np.abs(game.out.observation) <= 1.0).all():  # nor NaN
            raise Broken(FAILURES[OBSERVED])
        seen = {
            "observation": game.observations()[0],
            "reward": reward,
            "terminated": terminated,
            "truncated": truncated,
            "score": game.states["score"][0].copy(),
            "is_success": success,
            "final": None,
        }
        if game.pools[RIGHT].by_caller:
            seen["other_observation"] = game.observations(RIGHT)[0]
            seen["other_reward"] = float(game.out.reward[RIGHT, 0])
        return seen


class Trial:
    """A face (or none: `"game"`), and the plain games beside it.

    Attributes:
        refused: the face did not take the arguments, and said why.
    """

    def __init__(self, name: str, given: dict[str, Any], weird: tuple[str, ...] = ()) -> None:
        self.tally = new_tally()
        self.steps = 0
        self.rows: list[Row] = []
        self.refused = False
        self.face: Any = None
        try:
            arguments = arguments_for(given)
            if name != "game":
                self.face = FACES[name](arguments)
        except ValueError as error:
            if not any(one in str(error) for one in weird):
                raise Broken(f"good arguments were refused, or a bad one was not named: {error}") from error
            self.refused = True
            return
        if name == "parallel":
            arguments["opponent"] = None
        self.n = 1 if self.face is None else self.face.num_envs
        mode = AutoresetMode.DISABLED if self.face is None else self.face.mode
        self.rows = [Row(arguments, i, mode, self.tally) for i in range(self.n)]
        self.by_hand = mode == AutoresetMode.DISABLED
        self._saved: tuple[Any, list[Any]] | None = None
        self._since: list[tuple[dict[str, Any], list[Seen]]] = []

    @property
    def begun(self) -> bool:
        """Whether episodes have begun on all tables."""
        return all(row.game.begun for row in self.rows)

    @property
    def done(self) -> NDArray[np.bool_]:
        """(n,) the episodes that are over."""
        return np.array([row.done for row in self.rows])

    def do(self, operation: dict[str, Any]) -> None:
        """Do to all what an operation of a case says.

        Raises:
            Broken: a law does not hold.
        """
        what = {name: value for name, value in operation.items() if name != "do"}
        getattr(self, f"_do_{operation['do'].replace(' ', '_')}")(**what)
        if self.face is not None and self.begun:
            ours, theirs = self.face.env.get_state(), np.concatenate([row.game.get_state() for row in self.rows])
            self._agree("states", ours, theirs)

    def _do_reset(self, seed: Any = None, options: Any = None, mask: Any = None, bad: bool = False) -> None:
        try:
            self.rows[0].game.check_reset_options(options)
        except ValueError:
            bad = True
        chosen = np.array(mask) if isinstance(mask, list) and not bad else mask
        if bad:
            self._refuses(lambda: self.face.reset(seed, options, chosen))
            return
        seeds = seed if isinstance(seed, list) else [None if seed is None else seed + i for i in range(self.n)]
        theirs = [
            row.reset(one, options) if chosen is None or chosen[i] else None
            for i, (row, one) in enumerate(zip(self.rows, seeds, strict=True))
        ]
        if self.face is not None:
            ours = self.face.reset(seed, options, chosen)
            self._all_agree(ours, theirs)
            self._log({"do": "reset", "seed": seed, "options": options, "mask": mask}, ours)

    def _do_step(self, actions: list[Any], others: list[Any] | None = None) -> None:
        if self.by_hand and self.done.any():
            if self.face is not None:
                self._refuses(lambda: self.face.step(actions, others))
            return
        theirs = [
            row.step(action, None if others is None else others[i])
            for i, (row, action) in enumerate(zip(self.rows, actions, strict=True))
        ]
        self.steps += self.n
        if self.face is not None:
            ours = self.face.step(actions, others)
            self._all_agree(ours, theirs)
            self._log({"do": "step", "actions": actions, "others": others}, ours)

    def _do_bad_step(self, value: Any) -> None:
        self._refuses(lambda: self.face.bad_step(value))

    def _do_state(self, state: dict[str, Any]) -> None:
        like = np.concatenate([row.game.get_state() for row in self.rows])
        states = decode_state(state, like)
        for i, row in enumerate(self.rows):
            row.game.set_state(states[i : i + 1])
        if self.face is not None:
            self.face.env.set_state(states)
            self._log({"do": "state", "state": state}, [])

    def _do_bad_state(self, value: Any) -> None:
        like = self.face.env.get_state()
        self._refuses(lambda: self.face.env.set_state(decode_state(value, like) if isinstance(value, dict) else value))

    def _do_pool(self, indices: list[int], skill: list[float]) -> None:
        for row, index, share in zip(self.rows, indices, skill, strict=True):
            row.game.pools[RIGHT].assign(index)
            row.game.pools[RIGHT].set_skill(share)
        self.face.env.set_opponents(indices)
        self.face.env.set_opponent_skill(skill)
        self._log({"do": "pool", "indices": indices, "skill": skill}, [])

    def _do_copy(self, how: str) -> None:
        self.face.env = copy.deepcopy(self.face.env) if how == "deepcopy" else pickle.loads(pickle.dumps(self.face.env))

    def _do_observe(self) -> None:
        for ours, row in zip(self.face.observe(), self.rows, strict=True):
            self._agree("what is observed", ours, row.game.observations()[0])

    def _do_render(self) -> None:
        for picture in self.face.pictures():
            if not (isinstance(picture, np.ndarray) and picture.dtype == np.uint8 and picture.ndim == 3):
                raise Broken("render gave no picture")

    def _do_save(self) -> None:
        self._saved, self._since = (self.face.env.get_state(), self.face.observe()), []

    def _do_retrace(self) -> None:
        """Go back to where `save` was done, do all again, and come to the same."""
        if self._saved is None:
            return
        state, observations = self._saved
        self.face.env.set_state(state)
        for ours, theirs in zip(self.face.observe(), observations, strict=True):
            self._agree("what is observed in a state that was put back", ours, theirs)
        again, self._since = self._since, []
        for operation, before in again:
            what = {name: value for name, value in operation.items() if name not in ("do", "indices", "skill")}
            if operation["do"] == "state":
                self.face.env.set_state(decode_state(what["state"], state))
            elif operation["do"] == "pool":
                self.face.env.set_opponents(operation["indices"])
                self.face.env.set_opponent_skill(operation["skill"])
            elif operation["do"] == "reset":
                mask = what.pop("mask")
                ours = self.face.reset(**what, mask=None if mask is None else np.array(mask))
                self._all_agree(ours, before)
            else:
                self._all_agree(self.face.step(**what), before)
            self._since.append((operation, before))

    def _log(self, operation: dict[str, Any], seen: list[Seen]) -> None:
        if self._saved is not None:
            self._since.append((operation, seen))

    def _refuses(self, work: Callable[[], object]) -> None:
        """Bad input has an error of its own, and changes nothing."""
        env = self.face.env
        before = env.get_state().tobytes(), env._game.out.observation.tobytes()
        try:
            work()
        except (ValueError, TypeError, ResetNeeded) as error:
            if not str(error):
                raise Broken("bad input has an error without a message") from error
        else:
            raise Broken("bad input was not refused")
        if before != (env.get_state().tobytes(), env._game.out.observation.tobytes()):
            raise Broken("bad input was refused, but has changed something")

    def _all_agree(self, ours: list[Seen], theirs: Sequence[Seen | None]) -> None:
        for seen, expected in zip(ours, theirs, strict=True):
            for name, value in seen.items():
                if expected is not None and value is not None:
                    other = expected[name]
                    self._agree(name, value, self.face.reward(other) if name == "reward" else other)

    def _agree(self, name: str, ours: Any, theirs: Any) -> None:
        first, second = np.asarray(ours), np.asarray(theirs)
        alike = first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()
        if not alike:
            raise Broken(f"not the same bits: {name}")


def play_case(case: Case) -> str:
    """Play a case; the law that is broken, or "" if all hold."""
    if case.face == "hostile":
        first, second = (play_hostile(**case.arguments) for _ in range(2))
        return first.failure or ("" if first == second else NOT_AGAIN)
    try:
        trial = Trial(case.face, case.arguments, case.weird)
        for operation in case.operations if not trial.refused else ():
            trial.do(operation)
    except Exception as error:
        return law_of(error)
    return ""


def law_of(error: Exception) -> str:
    """The law that an error stands for: any error but those that bad input has is one."""
    return str(error) if isinstance(error, Broken) else f"{type(error).__name__}: {error}"
