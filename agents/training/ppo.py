"""The recipe for the baseline: PPO learns by shooting practice first, then by points against named opponents."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, TypeVar

import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

from agents.cluster import check_ray
from agents.conditions import Conditions, in_words
from agents.features import ForesightFeatures, RelativeFeatures
from agents.files import COUNT, POSITIVE, SHARE, TEXT, or_none
from agents.measuring.evaluation import OPPONENTS, SOLO_TASKS, Result, play_points
from agents.models import player_of, short_name
from agents.options import Address, Count, OptionalCount, Workers, check_cluster, check_ranges
from agents.training import workers
from agents.training.home import FEWEST_UNITS, add_home_units, keep_home_units
from agents.training.joined_tables import JoinedTables
from agents.training.league import League
from agents.training.learning import Falling, FollowKl
from agents.training.noise import Noise
from agents.training.recipe import History, Phase, Recipe, Setup, TrainArgs, conditions_of, with_conditions
from agents.training.report import print_results
from agents.training.start import START_HELP, take_over
from agents.training.stopping import Stop
from agents.video import frames_of_play
from airhockey_env.checks import check_choice
from airhockey_env.game import REWARDS
from airhockey_env.kernel.rewards import SHAPING_DISCOUNT
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import Player as Opponent
from airhockey_env.opponents.players import resolve_player, resolve_players
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

Args = TypeVar("Args", bound="PpoArgs")

STEPS = 10_000_000

ENOUGH_STEPS = 3_000_000
"""A run with fewer steps warns that it will probably not learn much."""

MOST_PRACTICE = 4_000_000
"""The most steps of shooting practice by default."""

WINDOW = 500
"""The number of last episodes, of all workers together, whose results count for the end of practice and in the log."""

EVALUATION = {
    "opponent": TEXT,
    **dict.fromkeys(("wins", "losses", "draws"), COUNT),
    "points": POSITIVE,
    **dict.fromkeys(("win_rate", "decided_win_rate"), or_none(SHARE)),
    **dict.fromkeys(("win_rate_95", "decided_win_rate_95"), (SHARE, SHARE)),
}
"""A row of an evaluation, as a pattern of `read_json`."""


@dataclass(frozen=True)
class PpoArgs(TrainArgs):
    """Train an agent with PPO, and write everything into one folder, runs/NAME/."""

    start: Annotated[str | None, tyro.conf.arg(help=START_HELP)] = None
    opponent: tuple[str, ...] = ("striker",)
    """Train against these opponents, each on the same number of tables: names, paths of policy.npz files, or paths of
    runs' folders. Give one twice to play it twice as often."""
    eval_opponent: str = "striker"
    """Evaluate against this opponent: a name, the path of a policy.npz, or the path of a run's folder."""
    warmup_steps: OptionalCount = None
    """Begin with at most this many steps of shooting practice (the task "hit"). Without it, agents learn to defend and
    to wait, but not to shoot. The default is half of --steps, but at most 4 million."""
    warmup_success: float = 0.8
    """End the practice as soon as this share of its last 500 episodes succeeds."""
    practice_share: float = 0.0
    """Keep this share of the tables for practice while the agent learns to play points: half of it for shooting, half
    for defending (the task "defend"). Without it, agents forget some of what they have practised."""
    reward: str = "sparse"
    """Learn to play points from this reward: "sparse" (points alone) or "shaped". Practice always uses "shaped"."""
    num_envs: Count = 512
    """Play on this many tables at once."""
    n_steps: Count = 32
    """Play this many steps on each table between updates."""
    batch_size: Count = 2048
    """Use this many samples in a gradient step."""
    n_epochs: Count = 4
    """Pass over the samples of an update this many times."""
    learning_rate: float = 7e-4
    """Use this learning rate during practice. After that it falls linearly to a fiftieth."""
    gamma: float = 0.995
    """Discount the rewards of points by this factor per step. With --reward shaped, use 0.99, for which that reward is
    made: with another discount it pays for standing still. Practice always uses 0.99."""
    gae_lambda: float = 0.95
    """Use this lambda in generalised advantage estimation."""
    max_grad_norm: float = 5.0
    """Scale gradients down to this norm if they are longer."""
    desired_kl: float = 0.0
    """Lower the learning rate where an update of the policy would change it by more than this, as a KL divergence, and
    raise it again, at most to what --learning-rate says. Small disturbances of the actions need that. With 0, the
    learning rate does not depend on it."""
    clip_range: float = 0.2
    """Clip the probability ratio in PPO's objective to this distance from 1."""
    ent_coef: float = 0.0
    """Weight the entropy bonus with this factor."""
    sde_sample_freq: Count = 8
    """Keep each random disturbance of the actions for this many steps (gSDE). With 0, the disturbances of each step are
    independent, and mostly cancel each other before they have moved a paddle."""
    log_std_init: float = -2.5
    """Start with disturbances whose standard deviation has this logarithm. With gSDE the network makes them about ten
    times as large."""
    noise: float = 0.0
    """Begin to play points with disturbances of the actions of this standard deviation. With 0, they stay as practice
    has left them, or with --start as --log-std-init makes them."""
    noise_end: float = 0.0
    """Let this standard deviation fall geometrically to this value, instead of learning it. With 0, it is learned."""
    net_width: Count = 128
    """Give the policy and the value network two hidden layers of this many units each."""
    foresight: bool = False
    """Let the networks also see what can be foreseen: where the puck goes if nobody touches it, and what comes of the
    next kiss of each paddle."""
    home: bool = False
    """Set seven units of the policy network by hand, and keep them: they bring the paddle back in front of its goal
    while the puck is away."""
    workers: Workers = None
    address: Address = None


def resolve(args: Args) -> Args:
    """Check the options and fill in the numbers of steps. See `Recipe.resolve`."""
    resolve_player("--eval-opponent", args.eval_opponent)
    check_choice("--reward", args.reward, REWARDS)
    resolve_players("--opponent", args.opponent)
    most = math.inf
    check_ranges(
        args, warmup_steps=(0, most), warmup_success=(0, 1), practice_share=(0, 1), num_envs=(1, most),
        n_steps=(2, most), batch_size=(2, most), n_epochs=(1, most), learning_rate=(0, 1), gamma=(0, 1),
        gae_lambda=(0, 1), max_grad_norm=(0, most), desired_kl=(0, 10), clip_range=(0, 10), ent_coef=(0, 10),
        sde_sample_freq=(0, most), log_std_init=(-20, 2), noise=(0, 2), noise_end=(0, 2),
        net_width=(FEWEST_UNITS if args.home else 1, most),
    )  # fmt: skip
    check_workers(args)
    if args.foresight and args.stack > 1:
        raise ValueError(f"--stack must be 1 with --foresight, got {args.stack}")
    args = with_conditions(args)
    steps = args.steps or STEPS
    practice = min(steps // 2, MOST_PRACTICE) if args.warmup_steps is None else args.warmup_steps
    return dataclasses.replace(args, steps=steps, warmup_steps=practice)


def check_workers(args: PpoArgs) -> None:
    """Check that the workers can have equal shares of the tables and of the samples of a gradient step.

    Raises:
        ValueError: they cannot. See `check_cluster` too.
        gymnasium.error.DependencyNotInstalled: there are workers, and Ray is missing.
    """
    check_cluster(args)
    if args.workers is not None:
        check_ray("--workers")
        if args.device != "cpu":
            raise ValueError(f"--device must be cpu with --workers, got {args.device}")
    number = args.workers or 1
    if args.num_envs % number:
        raise ValueError(f"--num-envs must be a multiple of --workers {number}, got {args.num_envs}")
    if args.batch_size % number or args.batch_size < 2 * number:
        raise ValueError(
            f"--batch-size must be a multiple of --workers {number}, at least {2 * number}, got {args.batch_size}"
        )


def share_of_worker(args: Args) -> Args:
    """The options of one of the workers: those of the run, with its share of the tables and of the samples."""
    number = args.workers or 1
    return dataclasses.replace(args, num_envs=args.num_envs // number, batch_size=args.batch_size // number)


def build(args: PpoArgs, new: bool) -> Setup:
    """See `Recipe.build`."""
    return setup(args, start_model(args, new))


def start_model(args: PpoArgs, new: bool) -> PPO:
    """Make an untrained agent or, in a new run with --start, one with the network of another run."""
    model = make_model(args, make_env(args))
    if new and args.start is not None:
        take_over(model, args.start)
    if args.home:
        if new:
            add_home_units(model, conditions_of(args).table)
        keep_home_units(model)
    return model


def setup(args: PpoArgs, model: PPO, league: League | None = None) -> Setup:
    """Set up the training of a model that plays points, in a league or against the named opponents."""
    return Setup(
        model,
        title=f"PPO, points against {short_name(args.eval_opponent)}",
        phases=partial(phases, args, model, league),
        evaluate=partial(evaluate, args, model),
        report=partial(report, args, model),
        frames=lambda folder: frames_of_play(
            player_of(model),
            args.eval_opponent,
            args.video_seconds,
            size=(640, 344),
            conditions=conditions_of(args),
        ),
        evaluation=EVALUATION,
        league=league,
    )


def make_env(args: PpoArgs, task: str = "point", opponents: Sequence[Opponent] | None = None) -> VecMonitor:
    """Make the tables to train on. The default opponents are those of the options."""
    return VecMonitor(make_tables(args, conditions_of(args), args.num_envs, task, opponents))


def make_points_env(args: PpoArgs, opponents: Sequence[Opponent] | None = None) -> VecMonitor:
    """Make the tables to play points on, and a share of tables for practice, which come after these."""
    practising = min(round(args.practice_share * args.num_envs), args.num_envs - 1)
    if practising == 0:
        return make_env(args, "point", opponents)
    conditions = conditions_of(args)
    points = make_tables(args, conditions, args.num_envs - practising, "point", opponents)
    sizes = zip(SOLO_TASKS, (practising - practising // 2, practising // 2), strict=True)
    practice = [make_tables(args, conditions, n, task, [TASKS[task].opponent]) for task, n in sizes if n > 0]
    return VecMonitor(JoinedTables([points, *practice]))


def make_tables(
    args: PpoArgs,
    conditions: Conditions,
    num_envs: int,
    task: str = "point",
    opponents: Sequence[Opponent] | None = None,
    obs_type: str = "state",
) -> AirHockeySB3VecEnv:
    """Make so many tables under the given conditions; see `make_env`."""
    return AirHockeySB3VecEnv(
        num_envs,
        task=task,
        opponent=args.opponent if opponents is None else opponents,
        reward=args.reward,
        **conditions.env_arguments(),
        obs_type=obs_type,
        stack=args.stack,
        max_episode_steps=TASKS[task].max_episode_steps,
    )


def make_model(args: PpoArgs, env: VecMonitor) -> PPO:
    """Make an untrained agent."""
    return PPO("MlpPolicy", env, **model_arguments(args))


def model_arguments(args: PpoArgs) -> dict[str, Any]:
    """Arguments of `PPO` after the policy and the tables."""
    return {
        "learning_rate": Falling(args.learning_rate, to=0.02),
        "n_steps": args.n_steps,
        "batch_size": args.batch_size,
        "n_epochs": args.n_epochs,
        "gamma": args.gamma,
        "gae_lambda": args.gae_lambda,
        "clip_range": args.clip_range,
        "ent_coef": args.ent_coef,
        "max_grad_norm": args.max_grad_norm,
        "use_sde": args.sde_sample_freq > 0,
        "sde_sample_freq": args.sde_sample_freq or -1,
        "policy_kwargs": {
            "log_std_init": args.log_std_init,
            "optimizer_kwargs": {"eps": 1e-5, "fused": True},  # Stable-Baselines3's eps; fused: quicker
            "net_arch": [args.net_width, args.net_width],
            "activation_fn": torch.nn.ReLU,  # quicker than tanh
            "features_extractor_class": ForesightFeatures if args.foresight else RelativeFeatures,
            "features_extractor_kwargs": {"spec": conditions_of(args).table},
        },
        "stats_window_size": max(1, WINDOW // workers.number()),
        "seed": args.seed,
        "device": args.device,
    }


def phases(args: PpoArgs, model: PPO, league: League | None, history: History) -> Iterator[Phase]:
    """Shooting practice, unless it is over or not wanted; then points."""
    assert args.steps is not None and args.warmup_steps is not None
    practise = args.start is None
    names = " and ".join(dict.fromkeys(map(short_name, args.opponent)))
    whom = f"against {names}" + ("" if league is None else " and its past selves")
    if practise and model.num_timesteps < args.steps < ENOUGH_STEPS:
        print(
            f"{args.steps:,} steps are few. Agents take about 5 million to win nine of ten decided points against the "
            "striker (docs/baseline.md)."
        )
    if practise and history["practice"] is None and args.warmup_steps > 0:
        practice = Practice(args.warmup_steps, args.warmup_success)
        # Practice needs the full learning rate. In a short run it would otherwise have fallen before the agent has
        # learned to shoot, and practice would take most of the steps.
        model.lr_schedule = Falling(args.learning_rate, to=0.02, begins=1.0)
        set_discount(model, SHAPING_DISCOUNT)
        until = f"until {args.warmup_success:.0%} of it succeeds, or for {args.warmup_steps:,} steps"
        shaped = dataclasses.replace(args, reward="shaped")
        yield Phase(f"Shooting practice {until}.", "practice", make_env(shaped, "hit", ["idle"]), [practice])
        history["practice"] = model.num_timesteps if practice.over else None
        if model.num_timesteps >= args.steps:
            print(f"All of it was shooting practice. With more --steps, the agent would have played {whom}.")
    first = history["practice"] or 0
    model.lr_schedule = Falling(args.learning_rate, to=0.02, begins=first / args.steps)
    set_discount(model, args.gamma)
    opponents = None if league is None else league.pool
    callbacks: list[BaseCallback] = [] if league is None else [league]
    if args.desired_kl > 0.0:
        callbacks.append(FollowKl(args.desired_kl))
    if args.noise > 0.0:
        callbacks.append(Noise(args.noise, args.noise_end, first, args.steps))
    yield Phase(f"Points {whom}.", "training", make_points_env(args, opponents), callbacks)


def set_discount(model: PPO, gamma: float) -> None:
    """Let a model discount rewards by this factor per step from now on."""
    model.gamma = model.rollout_buffer.gamma = gamma


class Practice(BaseCallback):
    """Ends shooting practice after a number of steps, or when a share of its last episodes has succeeded.

    Several workers compare their episodes after a rollout only, because within one they do not wait for each other.
    """

    def __init__(self, steps: int, success: float) -> None:
        super().__init__()
        self.steps = steps
        self.success = success
        self.over = False
        self._good = False

    def _on_step(self) -> bool:
        if workers.number() == 1:
            self._compare()
        self.over = self._good or self.num_timesteps >= self.steps
        return not self.over

    def _on_rollout_end(self) -> None:
        self._compare()

    def _compare(self) -> None:
        last = self.model.ep_success_buffer
        assert last is not None and last.maxlen is not None, "learning has begun"
        successes, episodes = workers.total(sum(last), len(last))
        self._good = episodes == workers.number() * last.maxlen and successes >= self.success * episodes


def play(args: PpoArgs, model: PPO, opponent: str, points: int, purpose: str, stop: Stop) -> Result:
    """Play points with the agent as it is now. See `play_points` for the arguments."""
    return play_points(
        player_of(model),
        opponent,
        points,
        name=short_name(opponent),
        seed=args.seed,
        purpose=purpose,
        conditions=conditions_of(args),
        observer=stop.observe,
    )


def evaluate(args: PpoArgs, model: PPO, stop: Stop) -> dict[str, Any]:
    """See `Setup.evaluate`."""
    result = play(args, model, args.eval_opponent, args.eval_episodes, "progress", stop)
    return {**result.as_dict(), "draw_rate": result.draws / result.points}


def report(args: PpoArgs, model: PPO, history: History, stop: Stop) -> list[dict[str, Any]]:
    """Play against every named opponent. See `Setup.report`."""
    results = [play(args, model, name, args.report_episodes, "report", stop) for name in OPPONENTS]
    print_results(results, in_words(args))
    return [result.as_dict() for result in results]


RECIPE = Recipe("train_ppo", PpoArgs, resolve, build)
