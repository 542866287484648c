"""The PPO baseline: Stable-Baselines3's PPO over the native batch, its run folder and its report."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.vec_env import VecMonitor

from agents.features import RelativeFeatures
from agents.files import write_json
from agents.measuring.evaluation import OPPONENTS, play_points
from agents.models import export_policy
from agents.options import Count, OptionalCount, check_ranges, check_resumed, check_table
from agents.sb3_files import read_model
from agents.training.league import League
from agents.training.learning import ProgressBar, learning, seed_learning
from agents.training.runs import HISTORY, Clock, Records, RunFolder, logger, read_config, save, take_up, where_it_stands
from agents.training.stopping import Stop, StopLearning, stopping
from airhockey_env.game import REWARDS
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import Player as Opponent
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import PRESETS

Args = TypeVar("Args", bound="TrainArgs")

ENOUGH_STEPS = 3_000_000
"""A shorter run is told before it begins that little will come of it."""

MOST_PRACTICE = 4_000_000
"""Steps of shooting practice, unless the command line says otherwise."""


@dataclass(frozen=True)
class TrainArgs:
    """Train an agent with PPO. Everything goes into one folder, runs/NAME/."""

    name: str | None = None
    """The name of the run's folder under runs/. The default is ppo- and the time."""
    resume: str | None = None
    """Go on with this run (its folder, or its name under runs/), with its own arguments, to --steps in all."""
    steps: OptionalCount = None
    """Environment steps in all, as 20_000_000, 20M or 2e7. The default is 20 million, or with --resume what the run was
    to have."""
    seed: int = 0
    """The seed of the network, the exploration and the tables. Runs with other seeds share no random numbers."""
    opponents: tuple[str, ...] = ("striker",)
    """The opponents to play against, on as many tables each. Name one twice to meet it twice as often."""
    warmup_steps: OptionalCount = None
    """Steps of shooting practice (the task "hit") at first, at most. Without practice, agents learn to defend and to
    wait, not to shoot. The default is half of --steps, but no more than 4 million."""
    warmup_success: float = 0.8
    """Practice ends as soon as this share of its last 500 episodes succeeds."""
    opponent: str = "striker"
    """The opponent in the evaluations while training."""
    reward: str = "shaped"
    """The reward to learn from: "sparse" (points alone) or "shaped"."""
    table: str = "full_size"
    """The table preset to play on."""
    num_envs: Count = 512
    """The number of tables that are played at once."""
    n_steps: Count = 32
    """The number of steps on each table between updates."""
    batch_size: Count = 2048
    """The number of samples in a gradient step."""
    n_epochs: Count = 3
    """The number of passes over the samples in an update."""
    learning_rate: float = 3.5e-4
    """The learning rate during practice. After that it falls linearly to a fiftieth."""
    gamma: float = 0.99
    """The discount of a step."""
    gae_lambda: float = 0.95
    """Lambda of the generalised advantage estimation."""
    clip_range: float = 0.2
    """The clip range of PPO's surrogate objective."""
    ent_coef: float = 0.0
    """The weight of the entropy bonus."""
    sde_sample_freq: Count = 8
    """The number of steps that a random disturbance of the actions lasts (gSDE). With 0 disturbances are independent in
    every step; those mostly cancel each other before they move a paddle anywhere."""
    log_std_init: float = -2.5
    """The logarithm of the disturbance at the start. With gSDE the network makes it about ten times as large."""
    net_width: Count = 64
    """The number of units in each of the two hidden layers of the policy and of the value network."""
    eval_every: Count = 2_000_000
    """The number of steps between evaluations. Each comes with a checkpoint."""
    eval_points: Count = 400
    """The number of points in an evaluation."""
    report_points: Count = 2000
    """The number of points against each named opponent in the report at the end."""
    threads: int = 1
    """The number of threads that PyTorch uses. The network is small: a second thread gains nothing."""
    video_seconds: float = 20.0
    """The length of the video of the trained agent, in seconds. 0 makes none."""

    default_steps = 20_000_000
    command = "train_ppo"

    def resolved(self) -> TrainArgs:
        """The same with numbers of steps in place of their defaults."""
        steps = self.steps or self.default_steps
        practice = min(steps // 2, MOST_PRACTICE) if self.warmup_steps is None else self.warmup_steps
        return dataclasses.replace(self, steps=steps, warmup_steps=practice)

    def begins_with(self) -> str | None:
        """A run whose network this one begins with."""
        return None

    def league(self) -> League | None:
        """Who chooses the opponents: nobody, they are on as many tables each."""
        return None

    def check(self) -> None:
        """Refuse what no run can have, before anything is written.

        Raises:
            ValueError: an argument is out of range.
        """
        check_table(self.table)
        if self.opponent not in OPPONENTS:
            raise ValueError(f"--opponent must be one of {OPPONENTS}, got {self.opponent!r}")
        if not self.opponents or not set(self.opponents) <= set(OPPONENTS):
            raise ValueError(f"--opponents must be some of {OPPONENTS}, got {self.opponents!r}")
        if self.reward not in REWARDS:
            raise ValueError(f"--reward must be one of {REWARDS}, got {self.reward!r}")
        most = math.inf
        check_ranges(
            self, steps=(1, most), seed=(0, 2**31 - 1), warmup_steps=(0, most), warmup_success=(0, 1),
            num_envs=(1, most), n_steps=(2, most), batch_size=(2, most), n_epochs=(1, most), learning_rate=(0, 1),
            gamma=(0, 1), gae_lambda=(0, 1), clip_range=(0, 10), ent_coef=(0, 10), sde_sample_freq=(0, most),
            log_std_init=(-20, 2), net_width=(1, most), eval_every=(1, most), eval_points=(1, most),
            report_points=(1, most), threads=(1, 1024), video_seconds=(0, 3600),
        )  # fmt: skip


class _Watch(BaseCallback):
    """Evaluates and saves while training."""

    def __init__(
        self,
        folder: RunFolder,
        args: TrainArgs,
        league: League | None,
        history: dict[str, Any],
        clock: Clock,
        stop: Stop,
    ) -> None:
        super().__init__()
        self.stop = stop
        self.league = league
        self.folder = folder
        self.args = args
        self.history = history
        self.clock = clock
        self.due = self._evaluated() + args.eval_every

    def _evaluated(self) -> int:
        """Steps of the run at its last evaluation."""
        return self.history["evaluations"][-1]["steps"] if self.history["evaluations"] else 0

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self.due:
            self.due = self.num_timesteps + self.args.eval_every
            self.evaluate()

    def save(self) -> None:
        """Write everything that a resumed run needs but its arguments."""
        _save(self.folder, self.model, self.history, self.league)

    def finish(self) -> None:
        """Evaluate at the end of training too."""
        if self.model.num_timesteps > self._evaluated():
            self.evaluate()

    def evaluate(self) -> None:
        """Play against the training opponent at full skill, and save everything."""
        result = play_points(
            export_policy(self.model),
            self.args.opponent,
            self.args.eval_points,
            seed=self.args.seed,
            purpose="progress",
            table=self.args.table,
            observer=self.stop.watch,
        )
        row = {"steps": self.model.num_timesteps, "seconds": self.clock.seconds, **result.as_dict()}
        self.history["evaluations"].append(row)
        for name in ("win_rate", "decided_win_rate", "mean_seconds"):
            self.logger.record(f"eval/{name}", row[name])
        self.logger.record("eval/draw_rate", row["draws"] / row["points"])
        self.save()


def make_env(args: TrainArgs, task: str = "point", opponents: Sequence[Opponent] | None = None) -> VecMonitor:
    """The tables to train on; the pool of opponents is that of the arguments if none is given."""
    return VecMonitor(
        AirHockeySB3VecEnv(
            args.num_envs,
            task=task,
            opponent=args.opponents if opponents is None else opponents,
            reward=args.reward,
            table=args.table,
            max_episode_steps=TASKS[task].max_episode_steps,
        )
    )


def make_model(args: TrainArgs, env: VecMonitor) -> PPO:
    """An untrained agent."""
    return PPO(
        "MlpPolicy",
        env,
        learning_rate=Falling(args.learning_rate),
        n_steps=args.n_steps,
        batch_size=args.batch_size,
        n_epochs=args.n_epochs,
        gamma=args.gamma,
        gae_lambda=args.gae_lambda,
        clip_range=args.clip_range,
        ent_coef=args.ent_coef,
        use_sde=args.sde_sample_freq > 0,
        sde_sample_freq=args.sde_sample_freq or -1,
        policy_kwargs={
            "log_std_init": args.log_std_init,
            "optimizer_kwargs": {"eps": 1e-5, "fused": True},  # Stable-Baselines3's eps; fused: quicker
            "net_arch": [args.net_width, args.net_width],
            "activation_fn": torch.nn.ReLU,  # quicker than tanh
            "features_extractor_class": RelativeFeatures,
            "features_extractor_kwargs": {"spec": PRESETS[args.table]},
        },
        stats_window_size=500,
        seed=args.seed,
        device="cpu",
    )


@dataclass(frozen=True)
class Falling:
    """A learning rate that falls linearly to a fiftieth.

    Practice needs the whole of it: with a small budget it would otherwise have fallen before practice has taught to
    shoot, and practice would take most of the steps.
    """

    start: float
    begins: float = 0.0
    """Share of the run after which it falls."""

    def __call__(self, remaining: float) -> float:
        left = 1.0 if remaining >= 1.0 - self.begins else remaining / (1.0 - self.begins)
        return self.start * (0.02 + 0.98 * left)


def train(args: TrainArgs, callbacks: Sequence[BaseCallback] = ()) -> RunFolder:
    """Train to `args.steps`, or until Ctrl-C; then write the report. Returns the run's folder.

    A second Ctrl-C, SIGTERM or SIGHUP leaves out the report, not the saving.

    Args:
        callbacks: of Stable-Baselines3, for trackers and the like. Their training begins and ends twice: for shooting
            practice and for the game. A callback that returns False ends the one of the two that is on.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: an argument does not fit; nothing has been written then.
        BlockingIOError: another process trains this run.
        OSError: the run could not be saved; its last checkpoint is whole.
    """
    args.check()
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(stopping())
        if args.resume is None:
            folder, args, model, league, history = _begin(args, stack)
        else:
            folder, args, model, league, history = _go_on(args, stack)
        _train(folder, args, model, league, history, callbacks, stop)
    return folder


def _begin(
    args: TrainArgs, stack: contextlib.ExitStack
) -> tuple[RunFolder, TrainArgs, PPO, League | None, dict[str, Any]]:
    """A new run; its folder stays locked as long as the stack."""
    args = args.resolved()
    torch.set_num_threads(args.threads)
    model, league = make_model(args, make_env(args)), args.league()
    if (other := args.begins_with()) is not None:
        _take_over(model, RunFolder.open(other, "--start"))
    folder = RunFolder.create(args.name)
    stack.enter_context(folder.locked(new=True))
    history: dict[str, Any] = {"practice": None, "evaluations": [], "updates": [], "report": []}
    _save(folder, model, history, league)
    settings = {"command": args.command, **dataclasses.asdict(args)}
    write_json(folder.config, settings)  # last: what has it can be resumed
    return folder, args, model, league, history


def _go_on(
    args: TrainArgs, stack: contextlib.ExitStack
) -> tuple[RunFolder, TrainArgs, PPO, League | None, dict[str, Any]]:
    """A run that goes on; its folder stays locked as long as the stack."""
    folder, kept = own_args(args)
    check_resumed(args, kept)
    stack.enter_context(folder.locked())
    asked = args.steps
    args = dataclasses.replace(kept, steps=asked or kept.steps).resolved()
    args.check()
    torch.set_num_threads(args.threads)
    model, league = make_model(args, make_env(args)), args.league()
    history = take_up(folder, HISTORY, model, asked)
    if league is not None:
        league.load(folder.path)
    return folder, args, model, league, history


def own_args(args: Args) -> tuple[RunFolder, Args]:
    """The folder that `args.resume` names, and the arguments that the run was begun with.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: it is a run of another command, or damaged.
    """
    assert args.resume is not None
    folder = RunFolder.open(args.resume, "--resume")
    return folder, read_config(folder, type(args), args.command, resume=args.resume)


def _train(
    folder: RunFolder,
    args: TrainArgs,
    model: PPO,
    league: League | None,
    history: dict[str, Any],
    callbacks: Sequence[BaseCallback],
    stop: Stop,
) -> None:
    assert args.steps is not None and args.warmup_steps is not None
    steps = args.steps
    clock = Clock(history["updates"][-1]["seconds"] if history["updates"] else 0.0)
    model.set_logger(logger(folder, Records(history["updates"], clock)))
    watch = _Watch(folder, args, league, history, clock, stop)
    watch.init_callback(model)
    practising = history["practice"] is None and args.begins_with() is None and args.warmup_steps > 0
    whom = "against " + " and ".join(args.opponents) + ("" if league is None else " and its past selves")
    plan = whom
    if practising:
        most = f"{args.warmup_success:.0%} of it succeeds, or for {args.warmup_steps:,} steps"
        plan = f"shooting practice until {most}; then {whom}"
    stands = where_it_stands(model.num_timesteps, steps)
    print(f"{folder.path}: {steps:,} steps in all: {plan}.{stands} Ctrl-C stops early and keeps everything.")
    if args.begins_with() is None and model.num_timesteps < steps < ENOUGH_STEPS:
        print(
            f"{steps:,} steps are few: with 2 million, an agent wins about half of the decided points against the "
            "striker, and with 1 million a fifth or less (docs/training.md)."
        )
    bar = ProgressBar()
    others = [*callbacks, watch, bar, StopLearning(stop)]
    go_on = f"python -m scripts.{args.command} --resume {folder.path}"
    with learning(stop, bar, watch.save, go_on):
        if practising and model.num_timesteps < steps:
            practice = Practice(args.warmup_steps, args.warmup_success)
            seed_learning(model, make_env(args, "hit", ["idle"]), "practice", args.seed)
            model.lr_schedule = Falling(args.learning_rate, begins=1.0)
            _learn(model, steps, [practice, *others])
            history["practice"] = model.num_timesteps if practice.over else None
        if model.num_timesteps < steps and not stop.asked:
            if practising:
                print(f"Practice is over after {model.num_timesteps:,} steps; now {whom}.")
            opponents, drawn = (None, []) if league is None else (league.pool, [league])
            seed_learning(model, make_env(args, "point", opponents), "training", args.seed)
            model.lr_schedule = Falling(args.learning_rate, begins=(history["practice"] or 0) / steps)
            _learn(model, steps, [*drawn, *others])
    if practising and (history["practice"] or model.num_timesteps) >= steps:
        print(f"All of it was shooting practice: with more --steps the agent would have played {whom}.")
    print("Playing for the report ...")
    watch.finish()
    report(folder, args, history, stop)


def _save(folder: RunFolder, model: BaseAlgorithm, history: dict[str, Any], league: League | None) -> None:
    """Write everything that a resumed run needs but its arguments."""
    save(folder, model, history, more=lambda: league.save(folder.path) if league is not None else None)


def _take_over(model: PPO, folder: RunFolder) -> None:
    """Give a new model the network of another run; how it explores is its own matter.

    Raises:
        ValueError: it is of another shape.
    """
    network = {**read_model(folder.model).params["policy"], "log_std": model.policy.log_std}
    try:
        model.policy.load_state_dict(network)
    except RuntimeError as error:
        raise ValueError(f"--start must name a run with the same --net-width, got {folder.path}: {error}") from error


class Practice(BaseCallback):
    """Ends shooting practice: after so many steps, or when so many of its last episodes succeed."""

    def __init__(self, steps: int, success: float) -> None:
        super().__init__()
        self.steps = steps
        self.success = success
        self.over = False

    def _on_step(self) -> bool:
        last = self.model.ep_success_buffer
        assert last is not None, "learning has begun"
        good = len(last) == last.maxlen and sum(last) >= self.success * len(last)
        self.over = good or self.num_timesteps >= self.steps
        return not self.over


def _learn(model: PPO, steps: int, callbacks: list[BaseCallback]) -> None:
    """Train until the run has these steps in all, or until a callback ends it."""
    left = steps - model.num_timesteps
    model.learn(left, callback=CallbackList(callbacks), reset_num_timesteps=model.num_timesteps == 0)


def report(folder: RunFolder, args: TrainArgs, history: dict[str, Any], stop: Stop) -> None:
    """Play against every scripted opponent, print and write the results, and draw picture and video."""
    from agents.training.report import draw_training, print_results
    from agents.video import frames_of_play, write_video
    from airhockey_env.opponents.policy import MlpPolicy

    policy = MlpPolicy.load(folder.policy)
    results = [
        play_points(
            policy, name, args.report_points, seed=args.seed, purpose="report", table=args.table, observer=stop.watch
        )
        for name in OPPONENTS
    ]
    history["report"] = [result.as_dict() for result in results]
    write_json(folder.evaluations, history)
    print_results(results)
    draw_training(history, args.opponent, folder.picture)
    if args.video_seconds > 0:
        frames = frames_of_play(policy, args.opponent, args.video_seconds, size=(640, 344), table=args.table)
        write_video(folder.video, stop.between(frames))
    print(folder.files())
