"""The recipe for distillation: a student imitates a teacher that sees exact states, then learns from points itself."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecMonitor

from agents.conditions import EXACT, in_words
from agents.files import read_json
from agents.measuring.evaluation import SOLO_TASKS, TaskResult, play_task
from agents.models import load_player, player_of, short_name
from agents.options import Count, OptionalCount, check_ranges, option_name
from agents.sb3_files import read_model
from agents.training import ppo
from agents.training.learning import Falling
from agents.training.noise import Noise, set_noise
from agents.training.recipe import TASK_EVALUATION, History, Phase, Recipe, Setup, conditions_of
from agents.training.report import print_task_result
from agents.training.runs import RunFolder
from agents.training.stopping import Stop
from agents.training.student import Imitation, Student, StudentFeatures, StudentPolicy
from agents.training.student_tables import StudentTables
from agents.video import frames_of_play
from airhockey_env.cameras import CAMERAS
from airhockey_env.checks import check_choice
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.policy import MlpPolicy

STEPS = 20_000_000

TRAINED_TASKS = ("point", *SOLO_TASKS)

OBS_KINDS = ("state", "grayscale")
"""The kinds of observations that a student can see."""

CRITIC_WIDTH = 128
"""Units of the critic's two hidden layers. It sees the exact state, so that it needs fewer than the student."""

_SIGHT = ("camera", "action_delay_ms")

SHARES: dict[tuple[str, ...], float] = {(): 0.3, ("randomize",): 0.35, _SIGHT: 0.1, (*_SIGHT, "randomize"): 0.25}
"""Shares of the tables by the conditions that are left out on them. Without tables that are always the same, and others
with exact states, the student would play worse where nothing has to be guessed."""

MORE_SHARE = 0.1
"""The share of the tables of each further camera."""


@dataclass(frozen=True)
class DistillArgs(ppo.PpoArgs):
    """Distil a policy: a student imitates a teacher that sees exact states. Write everything into runs/NAME/."""

    teacher: str = "expert"
    """Imitate this policy: the name of a trained opponent, a policy.npz or a run's folder. It always sees exact states,
    one at a time."""
    start: str | None = None
    """Begin with the network of this run of the command (its folder, or its name under runs/)."""
    imitation_steps: OptionalCount = None
    """Imitate the teacher for this many steps. After that, the student goes on with PPO. The default is half of
    --steps."""
    task: str = "point"
    """Train in this task: "point", "hit" or "defend"."""
    obs_type: str = "state"
    """Let the student see the "state", or "grayscale" pictures, of which --stack has to be 2 or more: one picture shows
    no velocities."""
    imitation_rate: float = 1e-3
    """Use this learning rate while imitating. It falls linearly to a fiftieth."""
    more_cameras: tuple[str, ...] = ()
    """Also give each of these cameras a tenth of the tables, without drawn fields: names as for --camera."""
    num_envs: Count = 1024
    """Play on this many tables at once. With --camera or --randomize, some of them are under easier conditions: see
    docs/robust.md."""
    n_epochs: Count = 2
    """Pass over the samples of an update this many times."""
    learning_rate: float = 3e-4
    """Use this learning rate at the start of PPO, after imitation. It falls linearly to a fiftieth."""
    max_grad_norm: float = 0.5
    net_width: Count = 192
    """Give the student two hidden layers of this many units each."""
    warmup_steps: Annotated[OptionalCount, tyro.conf.Suppress] = 0
    warmup_success: Annotated[float, tyro.conf.Suppress] = 0.8
    practice_share: Annotated[float, tyro.conf.Suppress] = 0.0
    desired_kl: Annotated[float, tyro.conf.Suppress] = 0.0
    foresight: Annotated[bool, tyro.conf.Suppress] = False
    home: Annotated[bool, tyro.conf.Suppress] = False
    noise: float = 0.25
    """Begin PPO with disturbances of the actions (gSDE) of this standard deviation. --log-std-init is that of the
    disturbances while imitating."""


def resolve(args: DistillArgs) -> DistillArgs:
    """Check the options and fill in the numbers of steps. See `Recipe.resolve`."""
    steps = args.steps or STEPS
    imitation = steps // 2 if args.imitation_steps is None else args.imitation_steps
    check_ranges(args, imitation_steps=(0, math.inf), imitation_rate=(0, 1), noise=(1e-3, 1))
    if len(args.more_cameras) * MORE_SHARE >= 1.0:
        raise ValueError(f"--more-cameras must be fewer than {1.0 / MORE_SHARE:g}, got {len(args.more_cameras)}")
    for camera in args.more_cameras:
        check_choice("--more-cameras", camera, CAMERAS)
    check_choice("--task", args.task, TRAINED_TASKS)
    check_choice("--obs-type", args.obs_type, OBS_KINDS)
    if args.obs_type != "state" and args.stack < 2:
        raise ValueError(f"--stack must be from 2 up with --obs-type {args.obs_type}, got {args.stack}")
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
    setup = ppo.setup(args, model)
    if args.task != "point":
        setup = setup._replace(
            evaluate=partial(evaluate_task, args, model),
            report=partial(report_task, args, model),
            frames=partial(frames_of_task, args, model),
            evaluation=TASK_EVALUATION,
        )
    what = f"points against {short_name(args.eval_opponent)}" if args.task == "point" else args.task
    return setup._replace(
        title=f"Distilled from {short_name(args.teacher)}, {what}",
        phases=partial(phases, args, model, load_teacher(args.teacher)),
    )


def make_student(args: DistillArgs) -> Student:
    """Make an untrained student."""
    arguments = ppo.model_arguments(args)
    arguments["policy_kwargs"] |= {
        "features_extractor_class": StudentFeatures,
        "normalize_images": False,
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
        wanted = "a run of scripts.distill with the same --net-width, --stack, --obs-type and fields in --randomize"
        kept = read_json(folder.config, {})
        options = ("net_width", "stack", "obs_type", "randomize")
        given = ", ".join(f"{option_name(name)} {kept[name]}" for name in options if name in kept)
        whose = kept.get("command", RECIPE.command)
        raise ValueError(
            f"--start must name {wanted}, got {folder.path}, a run of scripts.{whose} with {given}"
        ) from error


def make_env(args: DistillArgs) -> VecMonitor:
    """Make the tables to train on, some of them under easier conditions than those of the options: see `SHARES`."""
    whole = conditions_of(args)
    others = [dataclasses.replace(whole, camera=CAMERAS[camera], randomize=None) for camera in args.more_cameras]
    rest = 1.0 - MORE_SHARE * len(others)
    easier = {name: getattr(EXACT, name) for name in (*_SIGHT, "randomize")}
    conditions = [dataclasses.replace(whole, **{name: easier[name] for name in left_out}) for left_out in SHARES]
    shares = [*(share * rest for share in SHARES.values()), *(MORE_SHARE for _ in others)]
    ends = [round(share * args.num_envs) for share in np.cumsum(shares)]
    opponents = None if args.task == "point" else [TASKS[args.task].opponent]
    parts = [
        ppo.make_tables(args, one, size, args.task, opponents, args.obs_type)
        for one, size in zip([*conditions, *others], np.diff([0, *ends]).tolist(), strict=True)
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
    what = f"Points against {' and '.join(args.opponent)}." if args.task == "point" else f"The task {args.task}."
    falls = [Noise(args.noise, args.noise_end, args.imitation_steps, args.steps)] if args.noise_end > 0.0 else []
    yield Phase(what, "training", make_env(args), falls)


def evaluate_task(args: DistillArgs, model: Student, stop: Stop) -> dict[str, Any]:
    """See `Setup.evaluate`."""
    return play(args, model, args.eval_episodes, "progress", stop).as_dict()


def report_task(args: DistillArgs, model: Student, history: History, stop: Stop) -> list[dict[str, Any]]:
    """See `Setup.report`."""
    result = play(args, model, args.report_episodes, "report", stop)
    print_task_result(result, in_words(args))
    return [result.as_dict()]


def play(args: DistillArgs, model: Student, episodes: int, purpose: str, stop: Stop) -> TaskResult:
    """Play episodes of the task with the student as it is now."""
    return play_task(
        player_of(model),
        args.task,
        episodes,
        seed=args.seed,
        purpose=purpose,
        conditions=conditions_of(args),
        observer=stop.observe,
    )


def frames_of_task(args: DistillArgs, model: Student, folder: RunFolder) -> Iterator[NDArray[np.uint8]]:
    """See `Setup.frames`."""
    return frames_of_play(
        player_of(model),
        TASKS[args.task].opponent,
        args.video_seconds,
        size=(640, 344),
        task=args.task,
        conditions=conditions_of(args),
    )


RECIPE = Recipe("distill", DistillArgs, resolve, build)
