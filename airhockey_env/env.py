"""One table for Gymnasium. The class's docstring is the environment's specification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from airhockey_env._base import TableEnv
from airhockey_env.cameras import Camera
from airhockey_env.checks import NO_LIMIT, check_action_delay, check_number, check_seed, check_stack
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.opponents.players import Player, resolve_players
from airhockey_env.spaces import action_space, observation_space
from airhockey_env.tables import TableSpec
from airhockey_env.threads import one_at_a_time

_ONLY = np.zeros(1, np.int64)
"""The number of the one table."""


class AirHockeyEnv(TableEnv, gym.Env):
    """
    ## Description
    Air hockey against an opponent, on an exact physics engine: within a control step every contact of puck, paddles,
    walls and goal posts is found at its own time and place and resolved in order ("the perfect kiss"), at any speed.
    You are the left player. A goal counts when the puck's centre crosses the goal line. `task` says what an episode is:

    | id | `task` | an episode | opponent | truncated after |
    |---|---|---|---|---|
    | `AirHockey-v0` | `"point"` | one point against an opponent | `"striker"` | 1500 steps |
    | `AirHockeyMatch-v0` | `"match"` | a match, first to 7 points | `"striker"` | 15000 steps |
    | `AirHockeyHit-v0` | `"hit"` | put a puck that rests on your side into an unguarded goal | `"idle"` | 500 steps |
    | `AirHockeyDefend-v0` | `"defend"` | keep a shot out of your goal | `"idle"` | 250 steps |

    `gymnasium.make_vec("AirHockey-v0", num_envs=4096)` plays many tables at once in one compiled kernel, with the
    same trajectories to the bit.

    ## Action space
    `Box(-1, 1, (2,), float32)`: the paddle's target velocity (x towards the opponent, y to the left) as a share of its
    greatest speed. Values out of range are clipped to [-1, 1]; a vector longer than 1 is then shortened to 1. The
    paddle's velocity follows with a limited acceleration; the paddle stays on its own half and off the walls. NaN,
    infinity and wrong shapes raise `ValueError` and change nothing.

    With `continuous=False`, `Discrete(9)`: 0 stays, 1 to 8 are full speed straight ahead and then in steps of 45
    degrees counter-clockwise.

    With `action_delay_ms`, the paddle obeys each action late. A delay may end within a control step: after k + f steps,
    k whole and 0 <= f < 1, the target velocity in a step is f times that of k + 1 steps ago plus 1 - f times that of k
    steps ago, its mean over the step. Before the episode's first action it is 0.

    ## Observation space
    `Box(-1, 1, (13,), float32)`, in range by construction, from the player's own side (own goal at -x):

    | index | what | scale |
    |---|---|---|
    | 0 | own paddle x | half length |
    | 1 | own paddle y | half width |
    | 2 | own paddle velocity x | paddle's greatest speed |
    | 3 | own paddle velocity y | paddle's greatest speed |
    | 4 | opponent's paddle x | half length |
    | 5 | opponent's paddle y | half width |
    | 6 | opponent's paddle velocity x | paddle's greatest speed |
    | 7 | opponent's paddle velocity y | paddle's greatest speed |
    | 8 | puck x | half length |
    | 9 | puck y | half width |
    | 10 | puck velocity x | puck's greatest speed |
    | 11 | puck velocity y | puck's greatest speed |
    | 12 | shot clock: share used, + on own side, - on the far side | 7 s |

    With `obs_type="rgb"`, `Box(0, 255, (84, 84, 3), uint8)`, and with `"grayscale"`, `Box(0, 255, (84, 84), uint8)`: a
    picture of the same, also from the player's own side. The own goal is on the left, y points up, and the colours
    belong to the roles: the own paddle is pink (light grey), the opponent's blue (dark grey) and the puck cream (nearly
    white). The bar on top is the shot clock: it grows from the middle towards the side that the puck is on and is full
    at the foul. The table fills the picture whatever its shape, and its discs are stretched with it. Anti-aliasing shows
    positions to a tenth of a pixel or better. A single picture shows no velocities, so stack several (`stack=4`).

    With `stack=K`, for a K from 2 to 64, an observation is the last K of these, from the oldest to the newest:
    `Box(-1, 1, (K, 15), float32)`, in which each row is the 13 numbers above and then the x and y of the action that
    led to it, clipped to [-1, 1] (of a discrete action, those of its direction); or (K, 84, 84, 3) or (K, 84, 84) of
    the pictures, without actions. At the start of an episode all rows are its first observation, with actions 0.

    ## Rewards
    `reward="sparse"` is +1 for every goal, -1 for every goal against, and else 0, so a shot that was kept out or that
    missed earns 0. `reward="shaped"` adds 0.99 * potential(after) - potential(before), a potential-based term (Ng,
    Harada and Russell, "Policy invariance under reward transformations", ICML 1999) that leaves the best policy for a
    discount of 0.99 what it was; see `airhockey_env.kernel.rewards`.

    ## Starting state
    Point, match: paddles rest at home, 80 % of the way from the centre to the end walls. The puck rests on a random
    spot of a random side, 20 to 50 % of the half length from the centre line and up to half the half width off the
    long axis. After a goal in a match, paddles and puck are placed like this within the same step, with the puck on
    the side that conceded.

    Hit: the puck rests on your side, 10 to 50 % of the half length from the centre line and anywhere across the table
    up to 1.5 puck radii from the side walls; your paddle rests at home, up to half the half width off the long axis.

    Defend: the puck is on the far side, up to 60 % of the half length from the centre line and up to 95 % of the way
    to the side walls, and flies at 2 to 9 m/s towards a random spot of your goal: half of the shots straight, a quarter
    off each side wall. Your paddle rests 60 to 90 % of the half length from the centre, up to half the half width off
    the long axis.

    Hit, defend: the opponent's paddle is parked in a far corner, at +y. An opponent other than `"idle"` starts from
    there.

    `reset(options={"serve": "left"})` (or `"right"`, `"random"`) chooses who serves, where an episode begins with a
    serve. `"puck_position"` and `"puck_velocity"`, two numbers each in m and m/s, set those of the puck; with
    `"puck_position"` the own paddle starts at home.

    ## Rules
    A side has 7 s to send the puck back over the centre line; after that it is a foul, and where the episode goes on
    the other side serves. The puck's speed is capped at the table's `puck_speed` at the end of each step.

    ## Episode end
    Point: an episode terminates with a goal, and is a success if the goal is yours. A foul does not end it.

    Match: an episode terminates when a side has 7 points, and is a success if that side is yours. A foul does not end
    it.

    Hit: an episode terminates with a goal on either side, with a foul, and when the puck is on the far side and slower
    than 0.05 m/s. It is a success if the goal is yours.

    Defend: an episode terminates with a goal, with a foul, and once the shot is kept out, which means that the puck is
    back on the far side and not flying towards you any more, or slower than 0.3 m/s. It is a success if there was no
    goal against you.

    `gymnasium.make` truncates after the control steps in the table above, of which 50 are a second by default. A
    truncated episode is not a success. `max_episode_steps` changes the limit, and -1 turns it off.

    ## Info
    All values are arrays and scalars of fixed shape and dtype. In a batch they have Gymnasium's vector form.

    | key | what |
    |---|---|
    | `score` | (2,) int32: own points and the opponent's |
    | `foul` | bool: True on the step in which a shot clock ran out |
    | `is_success` | bool: True on the step that ends the episode with success |
    | `table` | with `randomize` only: the values that were drawn, a dict from the fields' names to float64 |

    ## Attributes
    More can be read from `env.unwrapped`. `contacts` is a structured array of the last step's contacts, in order of
    time: `time` (s into the step), the discs `a` and `b` (0 left paddle, 1 right paddle, 2 puck; `b` is -1 for a wall
    or post), `x` and `y` (m), the unit normal `nx`, `ny` from b to a, and `impulse` (kg m/s). `positions` and
    `velocities`, (3, 2) each, are those of the three discs in m and m/s, and `table` is the `TableSpec` in play.
    `get_state()` and `set_state(state)` keep and restore everything, random streams, clocks and cameras included: what
    follows is the same to the bit. `observe()` returns the observation of the present state without a step.

    ## Arguments
    | argument | values | default |
    |---|---|---|
    | `task` | `"point"`, `"match"`, `"hit"`, `"defend"`; the registered ids set it together with `opponent` and `max_episode_steps`, and `task` alone changes neither | `"point"` |
    | `opponent` | `"idle"`, `"random"`, `"goalie"`, `"striker"`, the trained `"adept"`, `"expert"` and `"robust"`, the path of a `policy.npz` or of a run's folder, or a callable: float32 observations (N, 13) from its own side to actions (N, 2), or (N, K, 15) if it has an attribute `stack` = K | `"striker"` |
    | `opponent_skill` | 0 to 1: share of its paddle's speed that a scripted opponent uses | 1.0 |
    | `table` | `"full_size"`, `"challenge"`, `"ideal"`, a `TableSpec`, or a mapping of its fields | `"full_size"` |
    | `obs_type` | `"state"`, `"rgb"`, `"grayscale"`, see above; callable opponents get states in any case | `"state"` |
    | `continuous` | True or False, see above | True |
    | `reward` | `"sparse"` or `"shaped"` | `"sparse"` |
    | `control_hz` | 10 to 240: control steps per second | 50 |
    | `randomize` | None, `"tables"` (ranges that contain the tables people have measured), or a mapping from `TableSpec` fields to (low, high), to draw from for every episode | None |
    | `camera` | None for exact states; `"robot"`, `"slow"`, `"robots"`, `"late"`, a `Camera` or a mapping of its fields, of which each is a number or a range (low, high) to draw from for every episode: you see the puck and the opponent's paddle late and with noise, but your own paddle and the clock exactly; opponents see exact states; see `airhockey_env.cameras` | None |
    | `stack` | 1 to 64: how many of the last observations an observation consists of, see above | 1 |
    | `action_delay_ms` | 0 to 1000 ms by which your paddle obeys an action late, or a range (low, high) to draw from for every episode, see above; opponents act immediately | 0 |
    | `max_episode_steps` | steps after which an episode is truncated; None: those of the task's id, see above; -1: no limit. `gymnasium.make` puts the limit into a wrapper around the environment; the class alone has none by default | -1 |
    | `render_mode` | None, `"rgb_array"`, `"human"` | None |
    | `render_size` | (width, height) px or None | None |

    An argument out of range raises a `ValueError` that names it. All arguments but a callable opponent can be written
    as data, so `EnvSpec.from_json(env.spec.to_json())` makes an equal environment, in another process too.
    `render_mode="human"` needs the extra `human`.

    ## Version history
    * v0: first version.
    """  # noqa: E501

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        *,
        task: str = "point",
        opponent: Player = "striker",
        opponent_skill: float = 1.0,
        table: str | TableSpec | Mapping[str, float] = "full_size",
        obs_type: str = "state",
        continuous: bool = True,
        reward: str = "sparse",
        control_hz: float = 50,
        randomize: str | Mapping[str, tuple[float, float]] | None = None,
        camera: str | Camera | Mapping[str, Any] | None = None,
        stack: int = 1,
        action_delay_ms: float | Sequence[float] = 0,
        max_episode_steps: int | None = NO_LIMIT,
        render_mode: str | None = None,
        render_size: tuple[int, int] | None = None,
    ) -> None:
        game = Game(
            1,
            task=task,
            table=table,
            right=resolve_players("opponent", opponent, several=False),
            right_skill=check_number("opponent_skill", opponent_skill, 0.0, 1.0),
            obs_type=obs_type,
            continuous=continuous,
            reward=reward,
            control_hz=control_hz,
            randomize=randomize,
            camera=(camera, None),
            left_stack=check_stack("stack", stack),
            left_action_delay_ms=check_action_delay("action_delay_ms", action_delay_ms),
            max_episode_steps=max_episode_steps,
            autoreset_mode=AutoresetMode.DISABLED,
            num_threads=1,
        )
        self._set_up(game, render_mode, render_size, ("action", "opponent"))
        self.observation_space: spaces.Box = observation_space(game.obs_type, game.interfaces[LEFT].stack)
        self.action_space: spaces.Box | spaces.Discrete = action_space(game.continuous)

    @one_at_a_time
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: restarts the table's random stream; without it the stream goes on.
            options: `"serve"`: `"left"`, `"right"` or `"random"`; `"puck_position"`, `"puck_velocity"`: two numbers
                each, m and m/s.

        Raises:
            ValueError: an option or the seed is unknown or out of range. The state is as it was then.
        """
        checked = self._game.check_reset_options(options)
        seed = None if seed is None else check_seed(seed)
        super().reset(seed=seed)
        self._game.seed([seed], _ONLY, lambda n: self.np_random.integers(2**63, size=n))
        self._game.begin(_ONLY, checked)
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info_of(self._game.out.score[0].copy(), False)

    def step(self, action: Any) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Play one control step.

        Raises:
            ValueError: the action has the wrong shape or is not finite. Nothing has changed then.
            gymnasium.error.ResetNeeded: the episode is over, or none has begun.
        """
        game = self._game
        with game._threads.lock:  # as `one_at_a_time`, quickly
            game.play(game.check_actions(LEFT, action))
            out = game.out
            info = self._info_of(out.score[0].copy(), out.success.item())
            if self.render_mode == "human":
                self.render()
            return self._observation(), out.reward[LEFT].item(), out.terminated.item(), out.truncated.item(), info

    @property
    def opponent_skill(self) -> float:
        """The share of its speed that a scripted opponent uses, 0 to 1; it can be set, as by `set_opponent_skill`."""
        return float(self._game.pools[RIGHT].skill[0])

    @opponent_skill.setter
    def opponent_skill(self, skill: float) -> None:
        self.set_opponent_skill(skill)

    def set_opponent_skill(self, skill: float) -> None:
        """Set the share of its speed that a scripted opponent uses, from the next step on.

        Raises:
            ValueError: it is not a number from 0 to 1. Nothing has changed then.
        """
        self._game.pools[RIGHT].set_skill(check_number("opponent_skill", skill, 0.0, 1.0))

    @one_at_a_time
    def observe(self) -> NDArray[Any]:
        """The observation of the table as it is now, without a step: what `reset` or `step` returned or, after
        `set_state`, what they returned in that state. A fresh array.

        Raises:
            gymnasium.error.ResetNeeded: no episode has begun.
        """
        self._game.check_begun()
        return self._observation()

    def _observation(self) -> NDArray[Any]:
        if self._game.plain:  # quickly
            return self._game.out.observation[LEFT, 0].copy()
        return self._game.observations()[0]
