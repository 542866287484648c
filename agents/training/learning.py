"""What every training command needs around Stable-Baselines3's `learn`."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from agents.seeding import sequence, table_seeds
from agents.training.stopping import Stop, Stopped
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv


def seed_tables(env: VecEnv, seeds: list[int]) -> None:
    """Seed the next reset of wrapped tables, each with its own seed."""
    tables = env.unwrapped
    assert isinstance(tables, AirHockeySB3VecEnv)
    tables.seed(seeds)


def seed_learning(model: BaseAlgorithm, env: VecEnv, purpose: str, seed: int) -> None:
    """Let a model learn on these tables next, with streams that no other run and no earlier session of this one has.

    Stable-Baselines3 seeds exploration and tables from the model's seed whenever a model is made or loaded, so this
    comes after that and right before `learn`.

    Args:
        purpose: "practice" or "training".
        seed: the run's.
    """
    begun = model.num_timesteps
    model.set_random_seed(int(sequence("actions", seed, begun).generate_state(1)[0]))
    model.set_env(env)
    seed_tables(env, table_seeds(purpose, seed, env.num_envs, begun))


class ProgressBar(BaseCallback):
    """Shows the steps of the run; ends at 100 %, though Stable-Baselines3 rounds up to whole rollouts."""

    bar: Any = None

    def _on_training_start(self) -> None:
        from tqdm import tqdm

        total = self.locals["total_timesteps"]
        self.bar = tqdm(total=total, initial=min(self.num_timesteps, total), unit="step", unit_scale=True, disable=None)

    def _on_step(self) -> bool:
        self.bar.update(min(self.num_timesteps, self.bar.total) - self.bar.n)
        return True

    def _on_training_end(self) -> None:
        self.close()

    def close(self) -> None:
        """Leave the bar as it is: training has ended, or was stopped."""
        if self.bar is not None:
            self.bar.close()


@contextlib.contextmanager
def learning(stop: Stop, bar: ProgressBar, save: Callable[[], object], go_on: str) -> Iterator[None]:
    """Let what is within learn until it ends, fails or is asked to stop; however it ends, `save` comes next.

    Args:
        go_on: the command that goes on with the run.

    Raises:
        Stopped, KeyboardInterrupt: the command was asked to end, by more than one Ctrl-C. The run is saved.
    """
    try:
        yield
    except BaseException as error:
        asked = isinstance(error, (KeyboardInterrupt, Stopped)) and stop.asked
        if not asked:
            save()
            raise
    finally:
        bar.close()
    save()
    if stop.asked:
        print(f"\nStopped; the run is saved. Go on with: {go_on}")
        stop.take_ctrl_c()
        stop.check()
