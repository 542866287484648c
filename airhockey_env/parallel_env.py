"""Two players at one table for PettingZoo. The class's docstring is the environment's specification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from airhockey_env._base import TableEnv
from airhockey_env.cameras import Camera
from airhockey_env.checks import check_action_delay, check_choice, check_limit, check_seed, check_stack
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.spaces import action_space, observation_space
from airhockey_env.tables import TableSpec
from airhockey_env.threads import one_at_a_time

try:
    from pettingzoo.utils import OrderEnforcingWrapper
    from pettingzoo.utils.conversions import parallel_to_aec_wrapper
    from pettingzoo.utils.env import AECEnv, ParallelEnv
except ImportError as error:
    raise DependencyNotInstalled(
        'AirHockeyParallelEnv needs PettingZoo: pip install "airhockey-env[multiagent]"'
    ) from error

AGENTS = ("left", "right")

TASKS = ("point", "match")
"""The tasks that are the same for both players."""


class AirHockeyParallelEnv(TableEnv, ParallelEnv[str, NDArray[Any], Any]):
    """
    ## Description
    Air hockey for two: the game of `AirHockeyEnv`, with the caller at both paddles. The agents are `"left"` and
    `"right"`; both act in every step, and both play to the end of the episode. With the same seeds and actions, the
    left agent sees, earns and is told to the bit what `AirHockeyEnv` gives.

    The two sides are the same game. Turn the table by 180 degrees and swap the players, and each agent sees and earns
    to the bit what the other one did: one policy plays both sides.

    ```python
    from airhockey_env.parallel_env import AirHockeyParallelEnv

    env = AirHockeyParallelEnv()
    observations, infos = env.reset(seed=0)
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        observations, rewards, terminations, truncations, infos = env.step(actions)
    ```

    `parallel_env(**arguments)` of this module makes this environment, `env(**arguments)` its agent-by-agent (AEC) form;
    both call `max_episode_steps` `max_cycles` too, as PettingZoo does.

    ## Action space
    Each agent has the actions of `AirHockeyEnv`: `Box(-1, 1, (2,), float32)`, the paddle's target velocity as the agent
    sees it (x towards the opponent, y to its left), or `Discrete(9)` with `continuous=False`. `step` takes a mapping
    with one action for each agent.

    ## Observation space
    Each agent has the observations of `AirHockeyEnv` from its own side (own goal at -x): `Box(-1, 1, (13,), float32)`,
    or pictures with `obs_type`, or stacks of them with `stack`.

    ## Global state
    `state()` returns the whole table as the left agent sees it, exact even with a camera, in `state_space`,
    `Box(-1, 1, (13,), float32)`.

    ## Rewards
    `reward="sparse"` is +1 for a goal, -1 for a goal against, and else 0: a zero-sum game. `reward="shaped"` adds
    0.99 * potential(after) - potential(before) for each agent, with the potential from its own side. The potential
    depends on the agent's own paddle, so the terms of the two do not cancel out. The best policy for a discount of 0.99
    stays what it was. See `airhockey_env.kernel.rewards`.

    ## Starting state and rules
    They are those of `AirHockeyEnv`, and so are the options of `reset`.

    ## Episode end
    Both agents terminate with a goal; with `task="match"`, with the seventh of one side. Both are truncated after
    `max_episode_steps`, unless that step terminates. `agents` is empty then, until the next `reset`; `step({})` gives
    five empty dicts, and any other `step` raises `gymnasium.error.ResetNeeded`.

    ## Info
    Each agent has `score`, (2,) int32, its own points and the opponent's; `foul`, a bool that is True for both on the
    step in which a shot clock ran out; and `is_success`, a bool that is True for the agent that wins the episode, on
    the step that ends it. The attributes `contacts`, `positions`, `velocities`, `table` and `get_state()` are those of
    `AirHockeyEnv`, in the coordinates of the table.

    ## Arguments
    | argument | values | default |
    |---|---|---|
    | `task` | `"point"` or `"match"` (first to 7) | `"point"` |
    | `table` | `"full_size"`, `"challenge"`, `"ideal"`, a `TableSpec`, or a mapping of its fields | `"full_size"` |
    | `obs_type` | `"state"`, `"rgb"` or `"grayscale"`, as in `AirHockeyEnv` | `"state"` |
    | `continuous` | True or False, see above | True |
    | `reward` | `"sparse"` or `"shaped"` | `"sparse"` |
    | `control_hz` | 10 to 240: control steps per second | 50 |
    | `randomize` | None, `"tables"`, or a mapping from `TableSpec` fields to (low, high), drawn per episode | None |
    | `camera` | as in `AirHockeyEnv`, for both agents, or a pair (left, right) | None |
    | `stack` | 1 to 64: as in `AirHockeyEnv`, for both agents | 1 |
    | `action_delay_ms` | as in `AirHockeyEnv`, for both agents; each draws its own from a range | 0 |
    | `max_episode_steps` | steps that truncate an episode; None: 1500, in a match 15000; -1: no limit | None |
    | `render_mode` | None, `"rgb_array"`, `"human"` | None |
    | `render_size` | (width, height) px or None | None |

    An argument out of range raises a `ValueError` that names it.

    ## Version history
    * v0: first version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "air_hockey_v0",
        "render_modes": ["human", "rgb_array"],
        "render_fps": 50,
        "is_parallelizable": True,
    }

    np_random: np.random.Generator
    """A generator for wrappers that draw, such as SuperSuit's `frame_skip_v0`; the game has a stream of its own."""

    def __init__(
        self,
        *,
        task: str = "point",
        table: str | TableSpec | Mapping[str, float] = "full_size",
        obs_type: str = "state",
        continuous: bool = True,
        reward: str = "sparse",
        control_hz: float = 50,
        randomize: str | Mapping[str, tuple[float, float]] | None = None,
        camera: str | Camera | Mapping[str, Any] | Sequence[Any] | None = None,
        stack: int = 1,
        action_delay_ms: float | Sequence[float] = 0,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        render_size: tuple[int, int] | None = None,
    ) -> None:
        check_choice("task", task, TASKS)
        game = Game(
            1,
            task=task,
            table=table,
            left=None,
            right=None,
            obs_type=obs_type,
            continuous=continuous,
            reward=reward,
            control_hz=control_hz,
            randomize=randomize,
            camera=camera,
            left_stack=check_stack("stack", stack),
            right_stack=stack,
            left_action_delay_ms=check_action_delay("action_delay_ms", action_delay_ms),
            right_action_delay_ms=action_delay_ms,
            max_episode_steps=max_episode_steps,
            autoreset_mode=AutoresetMode.DISABLED,
            num_threads=1,
        )
        self._set_up(game, render_mode, render_size, ("actions['left']", "actions['right']"))
        self.possible_agents = list(AGENTS)
        self.agents: list[str] = []
        self.observation_spaces = {
            agent: observation_space(game.obs_type, game.interfaces[LEFT].stack) for agent in AGENTS
        }
        self.action_spaces = {agent: action_space(game.continuous) for agent in AGENTS}
        self.state_space = observation_space()

    def observation_space(self, agent: str) -> spaces.Box:
        """The observation space of an agent: always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box | spaces.Discrete:
        """The action space of an agent: always the same object."""
        return self.action_spaces[agent]

    @one_at_a_time
    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[Any]], dict[str, dict[str, Any]]]:
        """Begin an episode.

        Args:
            seed: restarts the table's random stream; without it the stream goes on.
            options: `"serve"`: `"left"`, `"right"` or `"random"`; `"puck_position"`, `"puck_velocity"`: two numbers
                each, m and m/s. `"options"` is ignored: PettingZoo's tests pass it.

        Raises:
            ValueError: an option or the seed is unknown or out of range. The state is as it was then.
        """
        if isinstance(options, Mapping):
            options = {name: value for name, value in options.items() if name != "options"}
        checked = self._game.check_reset_options(options)
        if seed is not None:
            seed = check_seed(seed)
        elif not self._game.seeded:
            seed = int(np.random.SeedSequence().generate_state(1, np.uint64)[0])
        if seed is not None:
            self.np_random, self.np_random_seed = seeding.np_random(seed)
        only = np.zeros(1, np.int64)
        self._game.seed([seed], only, lambda n: np.random.SeedSequence().generate_state(n, np.uint64))
        self._game.begin(only, checked)
        self.agents = list(AGENTS)
        if self.render_mode == "human":
            self.render()
        return self._observations(), self._infos()

    @one_at_a_time
    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[
        dict[str, NDArray[Any]],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Play one control step.

        Args:
            actions: one for each agent. With no agents left, `{}` gives five empty dicts.

        Raises:
            ValueError: an agent's action is missing, has the wrong shape or is not finite, or there is one of an agent
                that does not play. Nothing has changed then.
            gymnasium.error.ResetNeeded: the episode is over, or none has begun.
        """
        game, out = self._game, self._game.out
        if not self.agents:
            if game.begun and isinstance(actions, Mapping) and not actions:
                return {}, {}, {}, {}, {}
            raise ResetNeeded("the episode is over: reset before step" if game.begun else "reset before step")
        if not isinstance(actions, Mapping) or actions.keys() != self.action_spaces.keys():
            given = list(actions) if isinstance(actions, Mapping) else actions
            raise ValueError(f"actions must map each of {list(AGENTS)} to its action, got {given!r}")
        game.step(actions["left"], actions["right"])
        terminated, truncated = bool(out.terminated[0]), bool(out.truncated[0])
        if terminated or truncated:
            self.agents = []
        if self.render_mode == "human":
            self.render()
        return (
            self._observations(),
            {"left": float(out.reward[LEFT, 0]), "right": float(out.reward[RIGHT, 0])},
            dict.fromkeys(AGENTS, terminated),
            dict.fromkeys(AGENTS, truncated),
            self._infos(),
        )

    def state(self) -> NDArray[np.float32]:
        """The whole table as the left agent would see it without a camera: (13,) float32.

        Raises:
            gymnasium.error.ResetNeeded: no episode has begun.
        """
        if not self._game.begun:
            raise ResetNeeded("reset before state")
        return self._game.exact_observations(LEFT)[0]

    @one_at_a_time
    def set_state(self, state: NDArray[np.void]) -> None:
        """Go on from a state that `get_state` returned: what follows is the same to the bit. `agents` follows it.

        Raises:
            ValueError: not such a state. Nothing has changed then.
        """
        super().set_state(state)
        game = self._game
        self.agents = [] if game.done[0] or game.side[0] == 0 else list(AGENTS)

    @one_at_a_time
    def observe(self) -> dict[str, NDArray[Any]]:
        """Both agents' observations of the table as it is now, without a step: what `reset` or `step` returned or,
        after `set_state`, what they returned in that state. Fresh arrays, of both agents after the episode's end too.

        Raises:
            gymnasium.error.ResetNeeded: no episode has begun.
        """
        self._game.check_begun()
        return self._observations()

    def _observations(self) -> dict[str, NDArray[Any]]:
        game, out = self._game, self._game.out
        if game.plain:  # quickly
            return {"left": out.observation[LEFT, 0].copy(), "right": out.observation[RIGHT, 0].copy()}
        return {"left": game.observations(LEFT)[0], "right": game.observations(RIGHT)[0]}

    def _infos(self) -> dict[str, dict[str, Any]]:
        game = self._game
        score = game.out.score[0]
        over = not self.agents and bool(game.out.terminated[0])
        return {
            "left": self._info_of(score.copy(), over and bool(score[0] > score[1])),
            "right": self._info_of(score[::-1].copy(), over and bool(score[1] > score[0])),
        }


def parallel_env(*, max_cycles: int | None = None, **arguments: Any) -> AirHockeyParallelEnv:
    """An `AirHockeyParallelEnv`, by the name that PettingZoo's modules have for it.

    Args:
        max_cycles: PettingZoo's name for `max_episode_steps`.
        **arguments: those of `AirHockeyParallelEnv`.

    Raises:
        ValueError: an argument is out of range, or both names of that one are given.
    """
    if max_cycles is not None:
        if "max_episode_steps" in arguments:
            raise ValueError("max_cycles is another name for max_episode_steps: give one of them, got both")
        check_limit(max_cycles, 0, "max_cycles")
        arguments["max_episode_steps"] = max_cycles
    return AirHockeyParallelEnv(**arguments)


def raw_env(**arguments: Any) -> AECEnv:
    """A `parallel_env` in PettingZoo's agent-by-agent (AEC) form: `"left"`, then `"right"`, then the step.

    Nothing enforces the order of calls: `env` does.
    """
    return parallel_to_aec_wrapper(parallel_env(**arguments))


def env(**arguments: Any) -> AECEnv:
    """A `parallel_env` in PettingZoo's agent-by-agent (AEC) form, with the wrapper that enforces the order of calls."""
    return OrderEnforcingWrapper(raw_env(**arguments))
