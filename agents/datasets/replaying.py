"""Playing a data set again: every episode to the bit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray


def begin_episode(env: gymnasium.Env, metadata: Mapping[str, Any]) -> NDArray[np.float32]:
    """Begin an episode of a data set.

    Args:
        env: what `recover_environment` has returned.
        metadata: of the episode, from the data set's `storage.get_episode_metadata`: it has a seed or a state.

    Returns:
        The first observation.
    """
    if "seed" in metadata:
        return env.reset(seed=int(metadata["seed"]))[0]
    env.reset()
    table: Any = env.unwrapped
    table.set_state(np.asarray(metadata["state"], np.uint8).view(table.get_state().dtype))
    return table.observe()


def check_replay(dataset: Any) -> int:
    """Play all episodes of a `minari.MinariDataset` in the environment that it recovers, and compare every bit.

    Returns:
        The number of episodes.

    Raises:
        ValueError: an observation, a reward or the end of an episode differs. The message names the episode.
    """
    env = dataset.recover_environment()
    metadata = dataset.storage.get_episode_metadata(dataset.episode_indices)
    count = 0
    for episode, about in zip(dataset.iterate_episodes(), metadata, strict=True):
        for step, (recorded, again) in enumerate(zip(_recorded(episode), _again(env, about, episode), strict=True)):
            if recorded != again:
                raise ValueError(f"{dataset.id} plays differently now: episode {episode.id}, step {step}")
        count += 1
    env.close()
    return count


def _recorded(episode: Any) -> Iterator[tuple[Any, ...]]:
    yield (episode.observations[0].tobytes(),)
    parts = (episode.observations[1:], episode.rewards, episode.terminations, episode.truncations)
    for observation, *others in zip(*parts, strict=True):
        yield observation.tobytes(), *(part.item() for part in others)


def _again(env: gymnasium.Env, metadata: Mapping[str, Any], episode: Any) -> Iterator[tuple[Any, ...]]:
    yield (begin_episode(env, metadata).tobytes(),)
    for action in episode.actions:
        observation, *others, _ = env.step(action)
        yield observation.tobytes(), *others
