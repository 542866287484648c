"""Print and plot a score card."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agents.measuring.goals_report import print_goals, quartiles_of, share_of
from agents.measuring.scorecard import Card, Shots
from agents.measuring.shares import Share
from agents.plots import BLUE, GREEN, GREY, INK, RED, RULE, SKY, plain, save_figure
from agents.tables import print_table
from airhockey_env.tables import TableSpec


def print_card(card: Card) -> None:
    """Print all results, with 95 % intervals."""
    opponent, result = card.result.opponent, card.result
    rows = [
        (
            f"{where}, {kind}", str(len(row.speeds)), str(row.on_target), str(row.scored),
            quartiles_of(row.speeds, 1),
        )
        for where, kinds in (("play", card.shots), ("hit", card.hit_shots))
        for kind, row in kinds.items()
    ]  # fmt: skip
    heads: tuple[str, ...] = ("", "shots", "on target (95 %)", "scored (95 %)", "m/s (quartiles)")
    print_table(f"Shots of {card.player}, in play against {opponent} and in the task hit", [heads, *rows])
    kept = [(_class(saved.low, saved.high), share_of(saved.play), share_of(saved.defend)) for saved in card.saves]
    heads = ("m/s", "in play (95 %)", "in the task defend (95 %)")
    print_table("Shots on target that were kept out", [heads, *kept])
    rest = [
        ("points won, lost, drawn", f"{result.wins}, {result.losses}, {result.draws}"),
        ("time attacking", f"{card.attacking:.1%}"),
        ("  puck on the far half", f"{card.zone:.1%}"),
        ("  in possession on the near half", f"{card.possession:.1%}"),
        ("fouls (shot clock), in an hour of play", f"{card.fouls} ({card.per_hour(card.fouls):.1f})"),
        ("own goals, of all goals against", share_of(Share(card.own_goals, result.losses))),
        ("  of these, shots on target off its paddle", str(card.deflected)),
    ]
    for kind, times in card.reaction.items():
        reacted = Share(int(np.isfinite(times).sum()), len(times))
        rest.append((f"reaction to {kind} shots, s (quartiles)", quartiles_of(times)))
        rest.append(("  set off at all", share_of(reacted)))
    for task in (card.hit, card.defend):
        rest.append((f"successes in task {task.task}", share_of(Share(task.successes, task.episodes))))
    print_table("The rest", [("", ""), *rest])
    print_goals(f"Goals of {card.player}", card.goals)
    print_goals(f"Goals of {opponent}", card.conceded)


def _class(low: float, high: float) -> str:
    return f"{low:.0f} and more" if math.isinf(high) else f"{low:.0f} to {high:.0f}"


def draw_card(card: Card, spec: TableSpec, path: Path) -> None:
    """Plot a score card: accuracy, speed and placement of shots, saves, reaction, and general play."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(13, 7.2), layout=ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.12))
    axes = figure.subplots(2, 3)
    for axis in axes.flat:
        plain(axis)
    opponent = card.result.opponent
    figure.suptitle(f"{card.player}, against {opponent} and in the tasks hit and defend", fontsize=15)
    _draw_accuracy(axes[0, 0], card)
    _draw_speeds(axes[0, 1], card.shots, opponent)
    _draw_places(axes[0, 2], card.shots, spec, opponent)
    _draw_saves(axes[1, 0], card)
    _draw_reaction(axes[1, 1], card)
    _draw_play(axes[1, 2], card)
    save_figure(figure, path)


def _draw_accuracy(axis: Any, card: Card) -> None:
    groups = [(f"against\n{card.result.opponent}", card.shots), ("task\nhit", card.hit_shots)]
    labels = []
    for place, (where, kind, shots) in enumerate(
        (where, kind, shots[kind]) for where, shots in groups for kind in ("direct", "bank")
    ):
        labels.append(f"{kind}\n{where}")
        for share, offset, color, label in (
            (shots.on_target, -0.2, BLUE, "on target"),
            (shots.scored, 0.2, RED, "scored"),
        ):
            _bar(axis, place + offset, share, color, label if place == 0 else None)
    axis.set_xticks(range(len(labels)), labels)
    axis.grid(axis="x", visible=False)
    axis.set(title="Shots on target and scored, %", ylim=(0, 112), yticks=range(0, 101, 20))
    axis.legend(frameon=False, loc="upper left", ncols=2)


def _bar(axis: Any, place: float, share: Share, color: str, label: str | None) -> None:
    value = 100 * share.value if share.of else 0.0
    axis.bar(place, value, 0.36, color=color, label=label)
    if not share.of:
        axis.annotate("none", (place, 0), (0, 3), textcoords="offset points", ha="center", fontsize=9, color=GREY)
    else:
        low, high = share.interval
        axis.errorbar(place, value, yerr=[[value - 100 * low], [100 * high - value]], color=INK, capsize=3)
        axis.annotate(f"{value:.0f}", (place, 100 * high), (0, 3), textcoords="offset points", ha="center", fontsize=9)


def _kinds(shots: dict[str, Shots]) -> Sequence[tuple[str, Shots, str]]:
    return [("direct", shots["direct"], BLUE), ("bank", shots["bank"], RED)]


def _draw_speeds(axis: Any, shots: dict[str, Shots], opponent: str) -> None:
    bins = np.arange(0.0, 12.5, 0.5)
    for kind, row, color in _kinds(shots):
        axis.hist(row.speeds, bins, histtype="stepfilled", color=color, alpha=0.25)
        axis.hist(row.speeds, bins, histtype="step", color=color, linewidth=1.8, label=f"{kind}, {len(row.speeds)}")
    axis.set(title=f"Speed of shots against {opponent}", xlabel="m/s", ylabel="shots", xlim=(0, 12))
    axis.legend(frameon=False)


def _draw_places(axis: Any, shots: dict[str, Shots], spec: TableSpec, opponent: str) -> None:
    half, goal = 0.5 * spec.width, 0.5 * spec.goal_width
    bins = np.linspace(-half, half, 42)
    axis.axvspan(-goal, goal, color=GREEN, alpha=0.12, linewidth=0, zorder=0)
    axis.text(0, 0.98, "goal", transform=axis.get_xaxis_transform(), ha="center", va="top", color=GREEN)
    for kind, row, color in _kinds(shots):
        places = -row.arrives[np.isfinite(row.arrives)]  # seen from behind the shooter, left is left
        axis.hist(places, bins, histtype="stepfilled", color=color, alpha=0.25)
        axis.hist(places, bins, histtype="step", color=color, linewidth=1.8, label=kind)
    axis.set(
        title="Where they reach the far end, unhindered",
        xlabel="m from the goal's centre, as the shooter sees it",
        ylabel="shots",
        xlim=(-half, half),
        ylim=(0, 1.25 * axis.get_ylim()[1]),
    )
    axis.legend(frameon=False, loc="upper right")


def _draw_saves(axis: Any, card: Card) -> None:
    for offset, color, label, shares in (
        (-0.08, BLUE, f"against {card.result.opponent}", [row.play for row in card.saves]),
        (0.08, RED, "task defend", [row.defend for row in card.saves]),
    ):
        known = [(k + offset, share) for k, share in enumerate(shares) if share.of]
        if not known:
            continue
        places, values = [place for place, _ in known], [100 * share.value for _, share in known]
        reach = np.array([share.interval for _, share in known]).T * 100
        reach = np.abs(reach - values)
        axis.errorbar(places, values, reach, fmt="o-", color=color, label=label, capsize=4, elinewidth=2, linewidth=1)
    labels = [
        f"{_class(row.low, row.high).replace(' and more', '+')}\n{row.play.of}\n{row.defend.of}" for row in card.saves
    ]
    axis.set_xticks(range(len(labels)), labels)
    axis.set(
        title="Saves by speed of the shot, %",
        xlabel="m/s; below, shots in play and in the task",
        xlim=(-0.5, len(labels) - 0.5),
        ylim=(0, 104),
    )
    axis.legend(frameon=False, loc="lower left")


def _draw_reaction(axis: Any, card: Card) -> None:
    longest = 0.6
    for (kind, times), color in zip(card.reaction.items(), (BLUE, RED), strict=True):
        if len(times):
            moments = np.sort(times[np.isfinite(times)])
            share = 100 * np.arange(1, len(moments) + 1) / len(times)
            share_at = np.concatenate([[0.0], share, share[-1:]])
            axis.step(np.concatenate([[0.0], moments, [10.0]]), share_at if len(moments) else [0.0, 0.0],
                      where="post", color=color, linewidth=2, label=f"{kind}, {len(times)}")  # fmt: skip
    axis.set(
        title="Reaction in the task defend", xlabel="s after the shot", ylabel="has set off, %", xlim=(0, longest),
        ylim=(0, 104),
    )  # fmt: skip
    axis.legend(frameon=False, loc="lower right")


def _draw_play(axis: Any, card: Card) -> None:
    from matplotlib.legend import Legend

    result = card.result
    rows = (
        ("Points", ((result.wins, "won", BLUE), (result.draws, "drawn", RULE), (result.losses, "lost", RED))),
        (
            "Time: puck on the far half, or in possession",
            (
                (card.zone, "far half", BLUE),
                (card.possession, "in possession", SKY),
                (1.0 - card.attacking, "neither", RULE),
            ),
        ),
    )
    for place, (what, parts) in zip((0.0, 1.25), rows, strict=True):
        total, begin = sum(part for part, _, _ in parts), 0.0
        bars, labels = [], []
        axis.text(0, place - 0.25, what, va="bottom")
        for part, name, color in parts:
            share = 100 * part / total
            bars.append(axis.barh(place, share, left=begin, color=color, height=0.3))
            labels.append(f"{name} {share:.0f}")
            begin += share
        # The legend is below the bar, because a part may be narrower than its name.
        names = Legend(
            axis, bars, labels, loc="upper left", bbox_to_anchor=(0, place + 0.25), bbox_transform=axis.transData,
            ncols=3, fontsize=9, frameon=False, handlelength=0.9, columnspacing=1.5, borderpad=0, borderaxespad=0,
        )  # fmt: skip
        axis.add_artist(names)
    axis.set(title=f"Play against {result.opponent}, %", xlim=(0, 100), ylim=(3.9, -0.6))
    axis.grid(visible=False)
    axis.spines[["left", "bottom"]].set_visible(False)
    axis.tick_params(length=0, labelbottom=False, labelleft=False)
    lines = (
        f"fouls: {card.fouls} ({card.per_hour(card.fouls):.1f} an hour of play)",
        f"own goals: {card.own_goals} of {result.losses} against",
        f"  ({card.deflected} of these were shots on target)",
        f"task hit: {card.hit.successes / card.hit.episodes:.1%} scored",
        f"task defend: {card.defend.successes / card.defend.episodes:.1%} kept out",
    )
    axis.text(0, 2.15, "\n".join(lines), va="top", linespacing=1.7)
