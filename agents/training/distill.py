"""The recipe for distillation: a student imitates a teacher that sees exact states, then learns from points itself."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from stable_baselines3.common.vec_env import VecMonitor

from agents.models import load_player
from agents.options import OptionalCount, check_ranges
from agents.training import ppo
from agents.training.learning import Falling
from agents.training.mixed import MixedTables
from agents.training.recipe import History, Phase, Recipe, Setup
from agents.training.student import Labels, Student
from airhockey_env.opponents.policy import MlpPolicy

STEPS = 20_000_000


@dataclass(frozen=True)
class DistillArgs(ppo.PpoArgs):
    """Distil a policy: a student imitates a teacher that sees exact states. Write everything into runs/NAME/."""

    teacher: str = "expert"
    """Imitate this policy: the name of a trained opponent, a policy.npz or a run's folder. It always sees exact states,
    one at a time."""
    imitation_steps: OptionalCount = None
    """Imitate the teacher for this many steps. After that, the student goes on with PPO. The default is half of
    --steps."""
    imitation_rate: float = 1e-3
    """Use this learning rate while imitating. It falls linearly to a fiftieth."""


def resolve(args: DistillArgs) -> DistillArgs:
    """Check the options and fill in the numbers of steps. See `Recipe.resolve`."""
    steps = args.steps or STEPS
    imitation = steps // 2 if args.imitation_steps is None else args.imitation_steps
    check_ranges(args, imitation_steps=(0, math.inf), imitation_rate=(0, 1))
    load_teacher(args.teacher)
    args = dataclasses.replace(args, steps=steps, imitation_steps=imitation, warmup_steps=0)
    return ppo.resolve(args)


def load_teacher(name: str) -> MlpPolicy:
    """Load the policy that a student is to imitate.

    Raises:
        FileNotFoundError: there is no such policy.
        ValueError: it is no network that sees one exact state at a time.
    """
    teacher = load_player(name, "--teacher")
    if not isinstance(teacher, MlpPolicy):
        raise ValueError(f"--teacher must be a trained policy that sees states, got {name!r}")
    return teacher


def build(args: DistillArgs, new: bool) -> Setup:
    """See `Recipe.build`."""
    model = ppo.make_model(args, ppo.make_env(args), Student)
    return ppo.setup(args, model)._replace(
        title=f"Distilled from {args.teacher}, points against {args.eval_opponent}",
        phases=partial(phases, args, model, load_teacher(args.teacher)),
    )


def phases(args: DistillArgs, model: Student, teacher: MlpPolicy, history: History) -> Iterator[Phase]:
    """Imitation, unless it is over; then points."""
    assert args.steps is not None and args.imitation_steps is not None
    share = args.imitation_steps / args.steps
    if model.num_timesteps < args.imitation_steps:
        model.lr_schedule = Falling(args.imitation_rate, to=0.02, ends=share)
        labels = Labels(teacher, args.imitation_steps)
        yield Phase(f"Imitation of {args.teacher}.", "imitation", ppo.make_env(args), [labels])
    model.lr_schedule = Falling(args.learning_rate, to=0.02, begins=share)
    yield Phase(f"Points against {' and '.join(args.opponent)}.", "training", ppo.make_env(args))


RECIPE = Recipe("distill", DistillArgs, resolve, build, ppo.EVALUATION)
