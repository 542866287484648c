"""The recipe for distillation: a student imitates a teacher that sees exact states, then learns from points itself."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
import tyro
from stable_baselines3.common.vec_env import VecMonitor

from agents.conditions import EXACT
from agents.models import load_player
from agents.options import Count, OptionalCount, check_ranges
from agents.sb3_files import read_model
from agents.training import ppo
from agents.training.learning import Falling
from agents.training.noise import Noise, set_noise
from agents.training.recipe import History, Phase, Recipe, Setup, conditions_of
from agents.training.runs import RunFolder
from agents.training.student import Imitation, Student, StudentFeatures, StudentPolicy
from agents.training.student_tables import StudentTables
from airhockey_env.opponents.policy import MlpPolicy

STEPS = 20_000_000

CRITIC_WIDTH = 128
"""Units of the critic's two hidden layers. It sees the exact state, so that it needs fewer than the student."""

_SIGHT = ("camera", "action_delay_ms")

SHARES: dict[tuple[str, ...], float] = {(): 0.3, ("randomize",): 0.35, _SIGHT: 0.1, (*_SIGHT, "randomize"): 0.25}
"""Shares of the tables by the conditions that are left out on them. Without tables that are always the same, and others
with exact states, the student would play worse where nothing has to be guessed."""


@dataclass(frozen=True)
class DistillArgs(ppo.PpoArgs):
    """Distil a policy: a student imitates a teacher that sees exact states. Write everything into runs/NAME/."""

    teacher: str = "expert"
    """Imitate this policy: the name of a trained opponent, a policy.npz or a run's folder. It always sees exact states,
    one at a time."""
    opponent: tuple[str, ...] = ("striker",)
    reward: str = "shaped"
    start: str | None = None
    """Begin with the network of this run of the command (its folder, or its name under runs/)."""
    imitation_steps: OptionalCount = None
    """Imitate the teacher for this many steps. After that, the student goes on with PPO. The default is half of
    --steps."""
    imitation_rate: float = 1e-3
    """Use this learning rate while imitating. It falls linearly to a fiftieth."""
    num_envs: Count = 1024
    """Play on this many tables at once. With --camera or --randomize, some of them are under easier conditions: see
    docs/robust.md."""
    n_epochs: Count = 2
    """Pass over the samples of an update this many times."""
    learning_rate: float = 3.5e-4
    gamma: float = 0.99
    max_grad_norm: float = 0.5
    net_width: Count = 192
    """Give the student two hidden layers of this many units each."""
    warmup_steps: Annotated[OptionalCount, tyro.conf.Suppress] = 0
    warmup_success: Annotated[float, tyro.conf.Suppress] = 0.8
    noise: float = 0.25
    """Begin PPO with disturbances of the actions (gSDE) of this standard deviation. --log-std-init is that of the
    disturbances while imitating."""


def resolve(args: DistillArgs) -> DistillArgs:
    """Check the options and fill in the numbers of steps. See `Recipe.resolve`."""
    steps = args.steps or STEPS
    imitation = steps // 2 if args.imitation_steps is None else args.imitation_steps
    check_ranges(args, imitation_steps=(0, math.inf), imitation_rate=(0, 1), noise=(1e-3, 1))
    load_teacher(args.teacher)
    args = dataclasses.replace(args, steps=steps, imitation_steps=imitation)
    return ppo.resolve(args)


def load_teacher(name: str) -> MlpPolicy:
    """Load the policy that a student is to imitate.

    Raises:
        FileNotFoundError: there is no such policy.
        ValueError: it is no network that sees one exact state at a time.
    """
    teacher = load_player(name, "--teacher")
    if not isinstance(teacher, MlpPolicy) or teacher.stack > 1:
        raise ValueError(f"--teacher must be a trained policy that sees one state at a time, got {name!r}")
    return teacher


def build(args: DistillArgs, new: bool) -> Setup:
    """See `Recipe.build`."""
    model = make_student(args)
    if new and args.start is not None:
        take_over(model, RunFolder.open(args.start, "--start"))
    return ppo.setup(args, model)._replace(
        title=f"Distilled from {args.teacher}, points against {args.eval_opponent}",
        phases=partial(phases, args, model, load_teacher(args.teacher)),
    )


def make_student(args: DistillArgs) -> Student:
    """Make an untrained student."""
    arguments = ppo.model_arguments(args)
    arguments["policy_kwargs"] |= {
        "features_extractor_class": StudentFeatures,
        "net_arch": {"pi": [args.net_width] * 2, "vf": [CRITIC_WIDTH] * 2},
    }
    return Student(StudentPolicy, make_env(args), **arguments)


def take_over(model: Student, folder: RunFolder) -> None:
    """Copy the network of another run, with its exploration noise, into a new student.

    Raises:
        ValueError: the networks differ in shape.
    """
    try:
        model.policy.load_state_dict(read_model(folder.model).params["policy"])
    except RuntimeError as error:
        wanted = "a run of scripts.distill with the same --net-width, --stack and fields in --randomize"
        raise ValueError(f"--start must name {wanted}, got {folder.path}: {error}") from error


def make_env(args: DistillArgs) -> VecMonitor:
    """Make the tables to train on, some of them under easier conditions than those of the options: see `SHARES`."""
    whole = conditions_of(args)
    ends = [round(share * args.num_envs) for share in np.cumsum(list(SHARES.values()))]
    parts = [
        ppo.make_tables(args, dataclasses.replace(whole, **{name: getattr(EXACT, name) for name in left_out}), size)
        for left_out, size in zip(SHARES, np.diff([0, *ends]).tolist(), strict=True)
        if size > 0
    ]
    return VecMonitor(StudentTables(parts, whole.randomize or {}))


def phases(args: DistillArgs, model: Student, teacher: MlpPolicy, history: History) -> Iterator[Phase]:
    """Imitation, unless it is over; then points."""
    assert args.steps is not None and args.imitation_steps is not None
    share = args.imitation_steps / args.steps
    if model.num_timesteps < args.imitation_steps:
        model.lr_schedule = Falling(args.imitation_rate, to=0.02, ends=share)
        imitation = Imitation(teacher, args.imitation_steps)
        yield Phase(f"Imitation of {args.teacher}.", "imitation", make_env(args), [imitation])
        if model.num_timesteps >= args.imitation_steps:  # and it was not stopped before
            set_noise(model, args.noise)
    model.lr_schedule = Falling(args.learning_rate, to=0.02, begins=share)
    falls = [Noise(args.noise, args.noise_end, args.imitation_steps, args.steps)] if args.noise_end > 0.0 else []
    yield Phase(f"Points against {' and '.join(args.opponent)}.", "training", make_env(args), falls)


RECIPE = Recipe("distill", DistillArgs, resolve, build, ppo.EVALUATION)
