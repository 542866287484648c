"""A mirrored or turned table plays the mirrored or turned game, to the bit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given

from tests.engine.scenes import laws, random_scene, seeds

MIRRORS = {"x": (-1.0, 1.0), "y": (1.0, -1.0), "half a turn": (-1.0, -1.0)}


def mirrored(scene, signs):
    return dataclasses.replace(scene, positions=scene.positions * signs, velocities=scene.velocities * signs)


@pytest.mark.parametrize("method", ["continuous", "kiss", "overlap"])
@pytest.mark.parametrize("signs", MIRRORS.values(), ids=MIRRORS)
@laws
@given(seed=seeds)
def test_mirrored_tables_play_the_mirrored_game(method, signs, seed):
    scene = random_scene(np.random.default_rng(seed), speed=10.0, discs=(2, 6))
    table, mirror = scene.table(method=method), mirrored(scene, signs).table(method=method)
    for _ in range(5):
        contacts, reflected = table.step(0.1), mirror.step(0.1)
        for name, sign in zip(("x", "y", "nx", "ny"), (*signs, *signs), strict=True):
            reflected[name] *= sign
        assert (contacts == reflected).all()
        assert (table.positions == mirror.positions * signs).all()
        assert (table.velocities == mirror.velocities * signs).all()


@laws
@given(seed=seeds)
def test_the_numbers_of_two_driven_discs_do_not_matter(seed):
    """What lets one policy play both sides: half a turn of the table, with the paddles' numbers swapped."""
    scene = random_scene(np.random.default_rng(seed), discs=(3, 3), elastic=False, speed=5.0)
    scene.masses[:2] = np.inf
    swap = [1, 0, 2]
    turned = dataclasses.replace(
        scene,
        positions=-scene.positions[swap],
        velocities=-scene.velocities[swap],
        radii=scene.radii[swap],
    )
    table, other = scene.table(), turned.table()
    for _ in range(5):
        table.step(0.02)
        other.step(0.02)
        assert (table.positions == -other.positions[swap]).all()
        assert (table.velocities == -other.velocities[swap]).all()
