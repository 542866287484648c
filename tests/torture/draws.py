"""What trials do: faces, arguments, options and actions, drawn so that most are good and some are not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from airhockey_env.cameras import CAMERAS
from airhockey_env.compiled import records
from airhockey_env.kernel.scripted import SCRIPTED
from airhockey_env.kernel.state import LEFT, RIGHT, SEATS, STATE
from airhockey_env.saved_states import game_state
from airhockey_env.tables import FIELDS, PRESETS
from tests.torture.apis import FACES
from tests.torture.cases import encode_state, encoded
from tests.torture.players import ambush
from tests.torture.tables import RATES, TABLES, table_of
from tests.torture.trial import OPPONENTS, Trial

NAN, INF = math.nan, math.inf

WEIRD: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 3, 2**70, 0.5, -0.5, 1e308, 5e-324, NAN, INF, -INF, "", "striker", "Left", "nonsense",
    [], [1], [0.5, [1]], [0.0, NAN], [None, 0.0], {}, {"x": 1}, {"length": 3}, [[1, 2], [3]], ["idle", 3],
)  # fmt: skip
"""Values that something may be given by mistake; a few of them are good for some things."""

BAD_SEEDS: tuple[Any, ...] = (-1, 1.5, NAN, "1", True, [], {}, -(2**70))
BROKEN_STATES = (("position", NAN), ("position", 1e9), ("velocity", INF), ("member", 99), ("member", -1))
"""Fields of a state, and values that no state has there."""
BROKEN_CAMERAS = (
    ("first", -1), ("waiting", 2**31), ("known", -1), ("next", 2**31), ("step", -1), ("frame", 2**60),
    ("true", NAN), ("seen", INF), ("scale", 0.0), ("reach", NAN),
)  # fmt: skip
"""The same of what a camera keeps,"""
BROKEN_DELAYS = (("steps", NAN), ("steps", -1.0), ("next", -1), ("next", 2**60))
"""and a delay of actions."""

LEAST_OF_CAMERAS = {"camera_hz": 1, "velocity_frames": 2}
"""The least values of a camera's fields, where they are not 0."""

PLAYERS = (*SCRIPTED, *OPPONENTS)
PURSUE, FLEE, ACROSS, JITTER, AHEAD, HUGE, WANDER, STYLES = range(8)
"""Styles of play: see `draw_actions`."""


def pick(rng: np.random.Generator, values: Any) -> Any:
    """One of some values, as it is."""
    return values[int(rng.integers(len(values)))]


def draw_arguments(rng: np.random.Generator) -> tuple[str, dict[str, Any], tuple[str, ...]]:
    """A face, its arguments as a case has them, and the names of those that it may refuse."""
    name = pick(rng, tuple(FACES))
    control_hz = pick(rng, (*RATES, float(rng.uniform(10.0, 240.0))))
    drawn = table_of(pick(rng, TABLES), int(rng.integers(2**31)), control_hz)
    arguments: dict[str, Any] = {
        **drawn,
        "table": pick(rng, tuple(PRESETS))
        if rng.random() < 0.3 and "randomize" not in drawn
        else encoded(drawn["table"]),
        "task": pick(rng, ("point", "match") if name == "parallel" else ("point", "match", "hit", "defend")),
        "control_hz": control_hz,
        "reward": pick(rng, ("sparse", "shaped")),
        "continuous": bool(rng.random() < 0.7),
        "obs_type": "state" if rng.random() < 0.85 else pick(rng, ("rgb", "grayscale")),
        "max_episode_steps": pick(rng, (1, 2, 7, 40, 200)),
    }
    if name != "parallel":
        arguments["opponent"] = pick(rng, PLAYERS)
        arguments["opponent_skill"] = pick(rng, (0.0, 1.0, float(rng.random())))
    if name in ("vector", "sb3"):
        n = pick(rng, (1, 2, 3, 5, 8, 17))
        arguments |= {"num_envs": n, "num_threads": pick(rng, (None, 1, 2))}
        if rng.random() < 0.4:
            arguments["opponent"] = [pick(rng, PLAYERS) for _ in range(int(rng.integers(1, 5)))]
        if rng.random() < 0.4:
            arguments["opponent_skill"] = rng.random(n).tolist()
    if name == "vector":
        arguments["autoreset_mode"] = pick(rng, tuple(mode.value for mode in AutoresetMode))
    if rng.random() < 0.2:
        arguments["camera"] = draw_camera(rng)
        if name == "parallel" and rng.random() < 0.5:
            arguments["camera"] = [pick(rng, (None, draw_camera(rng))) for _ in SEATS]
    if rng.random() < 0.2:
        arguments["stack"] = pick(rng, (1, 2, 3, 64) if arguments["obs_type"] == "state" else (2, 4))
    if rng.random() < 0.2:
        delay = float(rng.uniform(0.0, 100.0))
        arguments["action_delay_ms"] = pick(rng, (delay, 1000, [0, delay], [delay, 1000]))
    if rng.random() < 0.1:
        arguments |= {"render_mode": "rgb_array", "render_size": [96, 64]}
    return name, arguments, _spoil(rng, arguments) if rng.random() < 0.3 else ()


def draw_camera(rng: np.random.Generator) -> Any:
    """A camera by name, or some of its fields."""
    delay = float(rng.uniform(0.0, 150.0))
    fields = {
        "camera_hz": pick(rng, (1, 60, 240, float(rng.uniform(1.0, 240.0)))),
        "delay_ms": delay,
        "noise_mm": float(rng.uniform(0.0, 100.0)),
        "opponent_noise_mm": float(rng.uniform(0.0, 100.0)),
        "velocity_frames": int(rng.integers(2, 65)),
        "dropout": pick(rng, (1.0, float(rng.random()))),
        "occlusion_mm": float(rng.uniform(0.0, 1000.0)),
    }
    chosen = {name: value for name, value in fields.items() if rng.random() < 0.5}
    if "delay_ms" in chosen:
        chosen["jitter_ms"] = pick(rng, (0.0, delay, delay * float(rng.random())))
    for name in chosen:
        if rng.random() < 0.3:
            chosen[name] = [LEAST_OF_CAMERAS.get(name, 0), chosen[name]]
    return pick(rng, (*CAMERAS, chosen))


def _spoil(rng: np.random.Generator, arguments: dict[str, Any]) -> tuple[str, ...]:
    """Put weird values in the place of some arguments, or of a field of the table; their names."""
    if isinstance(arguments["table"], dict) and rng.random() < 0.3:
        field = pick(rng, FIELDS)
        arguments["table"] = {**arguments["table"], field: pick(rng, WEIRD)}
        return field, "randomize"
    names = tuple(name for name in arguments if rng.random() < 0.1)
    for name in names:
        arguments[name] = pick(rng, WEIRD)
    follow = {"table": "randomize", "num_envs": "opponent_skill"}  # these fitted what is no more
    return names + tuple(follow[name] for name in names if name in follow)


def draw_operation(rng: np.random.Generator, trial: Trial, styles: NDArray[np.int64]) -> dict[str, Any]:
    """What to do to a trial next. `styles`, (n, 2), is how the players play, kept from draw to draw."""
    face, done = trial.face, trial.done
    if not trial.begun:
        return {"do": "reset", "seed": int(rng.integers(2**40))}
    if trial.by_hand and done.any() and rng.random() < 0.9:
        return {"do": "reset", "mask": done.tolist()} if type(face) is FACES["vector"] else {"do": "reset"}
    chance = rng.random()
    if chance < 0.8:
        return draw_step(rng, trial, styles)
    if chance < 0.84:
        return draw_reset(rng, trial)
    if chance < 0.87:
        return {"do": "save"}
    if chance < 0.90:
        return {"do": "retrace"}
    if chance < 0.92:
        return {"do": "copy", "how": pick(rng, ("deepcopy", "pickle"))}
    if chance < 0.94:
        return {"do": "observe"}
    if chance < 0.95 and face.env.render_mode == "rgb_array":
        return {"do": "render"}
    if chance < 0.97:
        return draw_bad(rng, trial)
    if chance < 0.985 and hasattr(face.env, "opponents") and trial.n:
        size = len(face.env.opponents)
        return {
            "do": "pool",
            "indices": rng.integers(size, size=trial.n).tolist(),
            "skill": rng.random(trial.n).tolist(),
        }
    return draw_ambush(rng, trial)


def draw_step(rng: np.random.Generator, trial: Trial, styles: NDArray[np.int64]) -> dict[str, Any]:
    """Actions of all players who are the caller's."""
    games = [row.game for row in trial.rows]
    step: dict[str, Any] = {"do": "step"}
    views = [("actions", np.concatenate([game.out.observation[LEFT] for game in games]))]
    if games[0].pools[RIGHT].by_caller:
        views.append(("others", np.concatenate([game.out.observation[RIGHT] for game in games])))
    for side, (key, seen) in enumerate(views):
        changed = rng.random(len(seen)) < 0.06
        styles[changed, side] = rng.integers(STYLES, size=changed.sum())
        step[key] = draw_actions(rng, seen, styles[:, side], games[0].continuous)
    return step


def draw_actions(
    rng: np.random.Generator, seen: NDArray[np.float32], styles: NDArray[np.int64], continuous: bool
) -> list[Any]:
    """Hostile actions for states as players see them, (n, 13)."""
    to = seen[:, 8:10].astype(np.float64) - seen[:, 0:2]
    ways = np.stack(
        [
            5.0 * to,
            -5.0 * to,
            5.0 * to[:, ::-1] * (1.0, -1.0),
            rng.choice((-1.0, 1.0), to.shape),
            5.0 * (to + rng.random() * seen[:, 10:12]),
            1e30 * to,
            rng.uniform(-1.5, 1.5, to.shape),
        ]
    )
    targets = ways[styles, np.arange(len(seen))]
    if continuous:
        return targets.astype(np.float32).tolist()
    angles = np.arctan2(targets[:, 1], targets[:, 0])
    return np.where(
        styles == WANDER, rng.integers(9, size=len(seen)), 1 + np.round(angles / (np.pi / 4)).astype(int) % 8
    ).tolist()


def draw_reset(rng: np.random.Generator, trial: Trial) -> dict[str, Any]:
    """A reset in the midst of play, of which some are refused."""
    reset: dict[str, Any] = {"do": "reset"}
    masked = type(trial.face) is FACES["vector"]
    chance = rng.random()
    if chance < 0.15:
        return {**reset, "seed": pick(rng, BAD_SEEDS), "bad": True}
    if masked and chance < 0.25:
        return {
            **reset,
            "mask": pick(rng, (3, [True] * (trial.n + 1), [False] * trial.n, "all", [1.0] * trial.n)),
            "bad": True,
        }
    if chance < 0.35:
        return {**reset, "options": pick(rng, (5, "serve", ["serve"], {"server": "left"}, {"serve": pick(rng, WEIRD)}))}
    if chance < 0.7:
        spec = trial.rows[0].game.spec
        place = rng.uniform(-0.5, 0.5, 2) * (spec.length, spec.width)
        speed = rng.uniform(-0.75, 0.75, 2) * spec.puck_speed
        options = {
            "serve": pick(rng, ("left", "right", "random")),
            "puck_position": place.tolist(),
            "puck_velocity": speed.tolist(),
        }
        reset["options"] = {name: value for name, value in options.items() if rng.random() < 0.6}
        if rng.random() < 0.1:
            reset["options"][pick(rng, ("puck_position", "puck_velocity"))] = pick(rng, WEIRD)
    if rng.random() < 0.5:
        reset["seed"] = int(rng.integers(2**62))
    if masked and rng.random() < 0.5:
        mask = rng.random(trial.n) < 0.5
        if mask.any():
            reset["mask"] = mask.tolist()
    return reset


def draw_bad(rng: np.random.Generator, trial: Trial) -> dict[str, Any]:
    """An action or a state that must be refused."""
    game = trial.rows[0].game
    if rng.random() < 0.3:
        if rng.random() < 0.5:
            return {"do": "bad state", "value": pick(rng, WEIRD[:21])}
        state = encode_state(trial.face.env.get_state())
        part, (field, value) = state.get("state", state), pick(rng, BROKEN_STATES)
        between: list[Any] = [
            (state[name], BROKEN_CAMERAS) for name in ("left_camera", "right_camera") if name in state
        ]
        between += [(state["left_action_delay"], BROKEN_DELAYS)] if "left_action_delay" in state else []
        between += [(state, [(name, NAN)]) for name in ("left_history", "left_sent_actions") if name in state]
        if between and rng.random() < 0.5:
            part, damage = pick(rng, between)
            field, value = pick(rng, damage)
        broken: Any = np.array(part[field])
        broken.reshape(-1)[int(rng.integers(broken.size))] = value
        part[field] = broken.tolist()
        return {"do": "bad state", "value": state}
    if game.continuous:
        spoiled = rng.uniform(-1.0, 1.0, (trial.n, 2))
        spoiled[int(rng.integers(trial.n)), int(rng.integers(2))] = pick(rng, (NAN, INF, -INF))
        single = spoiled[0].tolist()
        values: tuple[Any, ...] = (
            single if not np.isfinite(single).all() else None,
            spoiled.tolist(),
            None,
            "left",
            [],
            [[[0.1, 0.2]]],
            {"x": 1.0},
            0.5,
        )
    else:
        values = (
            9,
            -1,
            1.5,
            None,
            "1",
            [9] * trial.n,
            [-1] * trial.n,
            [0.0] * trial.n,
            [True] * trial.n,
            [[1]],
            [],
            [1, [2]],
        )
    return {"do": "bad step", "value": pick(rng, values)}


def draw_ambush(rng: np.random.Generator, trial: Trial) -> dict[str, Any]:
    """States that play rarely leads to: the puck on an edge, and a paddle against it, both at great speed."""
    states = []
    for row in trial.rows:
        state = row.game.get_state()
        table = records(1, STATE)
        table[:] = game_state(state)
        if not row.done:
            ambush(table[0], row.game.parameters[0])
        game_state(state)[:] = table
        states.append(np.asarray(state))
    return {"do": "state", "state": encode_state(np.concatenate(states))}
