"""The recipe for self-play: PPO learns in a league with its past selves and named opponents."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents.options import Count, check_ranges, make_folder
from agents.training import ppo
from agents.training.league import League
from agents.training.recipe import Recipe, Setup
from agents.training.start import KINDS
from airhockey_env.checks import check_choice

STEPS = 30_000_000

RESPONSES_HELP = (
    "While the agent trains, train best responses to it in processes beside it, which join the league when they are "
    f"done: any of {', '.join(KINDS)}, which say where their training begins (see scripts.exploit)."
)


@dataclass(frozen=True)
class SelfPlayArgs(ppo.PpoArgs):
    """Train an agent with PPO by self-play, and write everything into one folder, runs/NAME/."""

    opponent: tuple[str, ...] = ("striker", "goalie", "idle")
    """Train against these opponents, and against the agent itself and its past selves: names, paths of policy.npz
    files, or paths of runs' folders."""
    reward: str = "shaped"
    n_epochs: Count = 3
    learning_rate: float = 4e-4
    gamma: float = 0.99
    max_grad_norm: float = 0.5
    sde_sample_freq: Count = 0
    """Keep each random disturbance of the actions for this many steps (gSDE). With 0, the disturbances of each step are
    independent."""
    log_std_init: float = -1.2
    """Start with disturbances whose standard deviation has this logarithm."""
    latest_share: float = 0.3
    """Play this share of the episodes against the agent as it is now."""
    scripted_share: float = 0.25
    """Play this share of the episodes against the given opponents, equally often against each. Play the rest against
    past selves, more often against those that are hard to beat."""
    snapshot_every: Count = 2_000_000
    """Add a copy of the agent to the league every this many steps."""
    most_past_selves: Count = 12
    """Keep at most this many copies in the league, best responses included. A further one replaces the weakest."""
    responses: Annotated[tuple[str, ...], tyro.conf.arg(help=RESPONSES_HELP)] = ()
    response_steps: Count = 6_000_000
    """Train each best response for this many steps."""
    response_every: Count = 20_000_000
    """Begin new best responses every this many steps, when those before have joined the league. If they are not done
    by then, wait for them."""
    win_value: float = 1.0
    """Let a point that is won against a past self, a best response or a member from elsewhere earn this much, while one
    that is lost always costs 1. With less than 1, the agent learns to take few risks with opponents that it does not
    know."""
    step_cost: float = 0.0
    """Let every step against the given opponents cost this much, so that the agent attacks them instead of waiting."""
    forward_cost: float = 0.0
    """Let every step in which the puck is on the far side or on its way there cost up to this much: all of it with the
    paddle at the centre line, and less the nearer it is to its goal. The agent learns to come back after a shot."""
    exchange: Path | None = None
    """Share a folder with other runs: copies of the agent are also written there, and policies that appear there join
    the league. Whatever writes policy files into it can take part."""


def resolve(args: SelfPlayArgs) -> SelfPlayArgs:
    """Check the options and fill in the numbers of steps. See `Recipe.resolve`."""
    check_ranges(
        args, latest_share=(0, 1), scripted_share=(0, 1 - args.latest_share), snapshot_every=(1, math.inf),
        most_past_selves=(1, 1000), response_steps=(1, math.inf), response_every=(1, math.inf), win_value=(0, 1),
        step_cost=(0, 1), forward_cost=(0, 1),
    )  # fmt: skip
    for kind in args.responses:
        check_choice("--responses", kind, KINDS)
    if args.responses and (args.workers or 1) > 1:
        raise ValueError(f"--workers must be 1 with --responses, got {args.workers}")
    args = ppo.resolve(dataclasses.replace(args, steps=args.steps or STEPS))
    if args.exchange is not None:  # last, so that nothing is written if another option is wrong
        make_folder("exchange", args.exchange)
    return args


def build(args: SelfPlayArgs, new: bool) -> Setup:
    """See `Recipe.build`."""
    return ppo.setup(args, ppo.start_model(args, new), League(args))


RECIPE = Recipe("train_self_play", SelfPlayArgs, resolve, build)
