"""What is foreseen, against the engine; and policies that foresee."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from airhockey_env import AirHockeyEnv, MlpPolicy
from airhockey_env.kernel.observations import scales_of
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.opponents.foresight import FORESEEN_SIZE, OF_A_SIDE, foresee, table_of, with_foresight
from airhockey_env.tables import CHALLENGE, FULL_SIZE, PRESETS, TableSpec
from tests.helpers import some_observations

NO_DRAG = replace(FULL_SIZE, drag_constant=0.0, drag_linear=0.0, drag_quadratic=0.0)
NAMES = (
    *("goal_very_soon", "goal_soon", "goal_at", "goal_from_paddle", "paddle_very_soon", "paddle_from_paddle"),
    *("kissed", "miss", "kiss_vx", "kiss_vy", "shot", "shot_at", "shot_from_paddle", "shot_in", "shot_soon"),
)
"""What is foreseen of the shots of one side."""


def foreseen(observations: NDArray[np.float32], spec: TableSpec = NO_DRAG) -> NDArray[np.float64]:
    return with_foresight(observations, table_of(spec))[:, 13:].astype(np.float64)


def of(observation: NDArray[np.float32]) -> dict[str, float]:
    """What is foreseen of the player's own shots, by name."""
    return dict(zip(NAMES, foreseen(observation[None])[0], strict=False))


class World:
    """A table in a given state, with paddles that keep their velocities."""

    def __init__(self, puck: Any, own: Any = (-1.0, 0.0, 0.0, 0.0), other: Any = (0.9, 0.5, 0.0, 0.0)) -> None:
        self.env = AirHockeyEnv(table=NO_DRAG, opponent=lambda seen: np.tile(self.actions[1], (len(seen), 1)))
        self.actions = [np.array(disc[2:], np.float32) / NO_DRAG.paddle_speed for disc in (own, other)]
        self.actions[1] = -self.actions[1]  # seen from the other side
        self.env.reset(seed=0)
        state = self.env.get_state()
        for number, disc in ((LEFT, own), (RIGHT, other), (PUCK, puck)):
            state["position"][..., number, :], state["velocity"][..., number, :] = disc[:2], disc[2:]
        self.env.set_state(state)
        self.seen = (np.array([*own, *other, *puck, 0.0]) / scales_of(NO_DRAG)).astype(np.float32)

    def contacts(self, steps: int = 60) -> Any:
        """Play, and yield every contact until the point is over."""
        for _ in range(steps):
            _, _, terminated, *_ = self.env.step(self.actions[0])
            yield from self.env.contacts
            if terminated:
                return


def test_where_the_puck_gets_to_the_end_of_the_table() -> None:
    rng, bounces, goals = np.random.default_rng(1), [], 0
    while len(bounces) < 40:
        puck = (rng.uniform(-0.8, 0.8), rng.uniform(-0.5, 0.5), rng.uniform(1.0, 9.0), rng.uniform(-6.0, 6.0))
        world = World(puck, own=(-1.1, -0.5, 0.0, 0.0), other=(-1.0, 0.5, 0.0, 0.0))
        seen = of(world.seen)
        at = seen["goal_at"] / seen["goal_soon"] * 0.5 * FULL_SIZE.width / 2.0
        hits, end = 0, None
        for contact in world.contacts():
            if contact["b"] != -1 or abs(contact["nx"]) not in (0.0, 1.0):
                break  # a paddle, or a post
            if contact["nx"] != 0.0:
                end = contact["y"]
                break
            hits += 1
        if hits > 2 or (end is None and abs(at) > 0.5 * FULL_SIZE.goal_width):
            continue
        bounces.append(hits)
        if end is None:
            goals += world.env.unwrapped.get_state()["score"][0, 0]
        else:
            assert at == pytest.approx(end, abs=0.02)
    assert {0, 1, 2} <= set(bounces) and goals > 0


def test_what_comes_of_a_kiss() -> None:
    rng, kisses = np.random.default_rng(2), 0
    while kisses < 40:
        angle, speed = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 4.0)
        own = (-0.5, 0.1, *rng.uniform(-3.0, 3.0, 2))
        puck = (-0.5 + 0.2 * np.cos(angle), 0.1 + 0.2 * np.sin(angle), *(speed * rng.uniform(-1.0, 1.0, 2)))
        world = World(puck, own)
        seen = of(world.seen)
        first = next(world.contacts(12), None)
        if first is None or first["b"] != PUCK:  # it flies past, or another contact comes first
            if first is None:
                assert seen["kissed"] == 0.0
            continue
        if world.env.contacts.size > 1 or seen["kissed"] < 0.05:
            continue
        kisses += 1
        after = np.array([seen["kiss_vx"], seen["kiss_vy"]]) / seen["kissed"] * FULL_SIZE.puck_speed / 3.0
        np.testing.assert_allclose(after, world.env.velocities[PUCK], atol=0.05)
        assert abs(seen["miss"]) < 1.0


def test_a_shot_that_would_go_in() -> None:
    shoots = World((-0.35, 0.0, 0.0, 0.0), own=(-0.5, 0.0, 4.0, 0.0))
    seen = of(shoots.seen)
    assert seen["shot_in"] == pytest.approx(seen["shot"], rel=1e-3) and seen["shot_in"] > 0.5
    assert seen["shot_at"] == pytest.approx(0.0, abs=1e-6)
    wide = of(World((-0.35, 0.04, 0.0, 0.0), own=(-0.5, 0.0, 4.0, 0.0)).seen)
    assert wide["shot_in"] == 0.0 and wide["shot"] > 0.5
    away = of(World((-0.35, 0.0, 5.0, 0.0), own=(-0.5, 0.0, 4.0, 0.0)).seen)
    assert away["kissed"] == away["shot"] == away["shot_in"] == 0.0 and away["goal_soon"] > 0.5


@pytest.mark.parametrize("spec", [*PRESETS.values(), replace(CHALLENGE, wall_tangential=0.0)])
def test_any_observation_gives_finite_numbers(spec: TableSpec) -> None:
    corners = np.random.default_rng(3).choice(np.array([-1.0, 0.0, 1.0], np.float32), (5000, 13))
    for observations in (np.zeros((1, 13), np.float32), corners, some_observations(5000)):
        numbers = foreseen(observations, spec)
        assert numbers.shape == (len(observations), FORESEEN_SIZE)
        assert np.isfinite(numbers).all() and np.abs(numbers).max() < 40.0


def test_the_sides_of_the_table() -> None:
    seen = some_observations()
    mirrored, turned = seen.copy(), seen.copy()
    mirrored[:, 1:12:2] *= -1.0  # left and right
    turned[:, :4], turned[:, 4:8], turned[:, 8:12] = -seen[:, 4:8], -seen[:, :4], -seen[:, 8:12]
    odd = {"goal_at", "goal_from_paddle", "paddle_from_paddle", "miss", "kiss_vy", "shot_at", "shot_from_paddle"}
    signs = np.array([-1.0 if name in odd else 1.0 for name in NAMES])
    numbers = foreseen(seen)
    np.testing.assert_allclose(foreseen(mirrored), numbers * np.tile(signs, 2), atol=1e-6)
    np.testing.assert_allclose(foreseen(turned), np.roll(numbers, OF_A_SIDE, axis=1), atol=1e-6)


def test_compiled_or_not_and_row_by_row() -> None:
    seen, table = some_observations(), table_of(FULL_SIZE)
    numbers = with_foresight(seen, table)
    np.testing.assert_array_equal(numbers[:, :13], seen)
    plain = np.empty((FORESEEN_SIZE, len(seen)))
    foresee(seen.T.astype(np.float64), table, plain)
    np.testing.assert_allclose(numbers[:, 13:], plain.T, rtol=1e-5, atol=1e-6)
    for rows in (slice(0, 1), slice(3, 5)):
        np.testing.assert_array_equal(with_foresight(seen[rows], table), numbers[rows])
    np.testing.assert_array_equal(with_foresight(np.asfortranarray(seen), table), numbers)


class TestPolicy:
    def policy(self, spec: TableSpec = FULL_SIZE) -> MlpPolicy:
        rng = np.random.default_rng(4)
        weights = [rng.normal(size=size) / 5.0 for size in ((8, 13 + FORESEEN_SIZE), (2, 8))]
        return MlpPolicy(weights, [np.zeros(8), np.zeros(2)], "relu", foresight=spec)

    def test_it_acts_on_what_it_foresees(self) -> None:
        policy, seen = self.policy(), some_observations()
        numbers = with_foresight(seen, table_of(FULL_SIZE)).astype(np.float64)
        hidden = np.maximum(numbers @ policy.weights[0].T, 0.0)
        np.testing.assert_allclose(policy(seen), np.clip(hidden @ policy.weights[1].T, -1.0, 1.0), atol=2e-6)
        assert (self.policy(CHALLENGE)(seen) != policy(seen)).any()

    def test_save_and_load(self, tmp_path: Path) -> None:
        self.policy(CHALLENGE).save(tmp_path / "policy.npz")
        loaded = MlpPolicy.load(tmp_path / "policy.npz")
        assert loaded.foresight == CHALLENGE
        np.testing.assert_array_equal(loaded(some_observations()), self.policy(CHALLENGE)(some_observations()))

    def test_a_single_observation(self) -> None:
        with pytest.raises(ValueError, match="stack must be 1 with foresight, got 2"):
            MlpPolicy([np.zeros((2, 30))], [np.zeros(2)], stack=2, foresight=FULL_SIZE)
        with pytest.raises(ValueError, match=r"layer 0 must have weights \(n, 43\)"):
            MlpPolicy([np.zeros((2, 13))], [np.zeros(2)], foresight=FULL_SIZE)

    @pytest.mark.parametrize(
        "foresight",
        [np.zeros(3), np.zeros(15), np.full(15, np.nan), np.ones(15), np.array("full_size"), np.ones(15, int)],
    )
    def test_a_file_with_another_table(self, tmp_path: Path, foresight: Any) -> None:
        self.policy().save(tmp_path / "policy.npz")
        arrays = dict(np.load(tmp_path / "policy.npz"))
        np.savez(tmp_path / "policy.npz", **{**arrays, "foresight": foresight})
        with pytest.raises(ValueError, match="does not hold a policy"):
            MlpPolicy.load(tmp_path / "policy.npz")
