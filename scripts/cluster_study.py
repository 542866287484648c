"""Study training on several processors: python -m scripts.cluster_study"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import tyro

from agents.files import write_json
from agents.options import JsonFile, check_output, check_ranges
from agents.tables import print_table
from benchmarks.cluster import costs as measured_costs
from benchmarks.cluster import rllib
from benchmarks.cluster.costs import Costs
from benchmarks.cluster.model import Sizes, averaging, expect, fit_spread, sent
from scripts._command import run_command

WORKERS = (1, 2, 4, 8, 16, 32, 64, 128, 256)

PER_SECOND_HELP = (
    "Environment steps per second that one and two workers made with train_ppo. The model's spread is what explains "
    "their ratio. Without them, all workers are equally fast at any time."
)


@dataclass(frozen=True)
class ClusterStudyArgs:
    """Measure what training costs on one processor, and model what to expect from many.

    The model is no measurement: docs/cluster.md says what it has and what it lacks. The other part measures RLlib
    beside Stable-Baselines3.
    """

    only: Literal["model", "rllib"] | None = None
    """Do only this part."""
    per_second: Annotated[tuple[float, float] | None, tyro.conf.arg(metavar="ONE TWO", help=PER_SECOND_HELP)] = None
    latency_us: float | None = None
    """Model a network whose messages take this many microseconds. The default is measured between two processes of this
    machine."""
    gbit: float | None = None
    """Model a network of this many gigabits per second. The default is measured likewise."""
    quick: bool = False
    """Measure little, to see that everything works."""
    json: JsonFile = None


def study(args: ClusterStudyArgs) -> dict[str, Any]:
    """Measure, model, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
        gymnasium.error.DependencyNotInstalled: Ray is missing.
    """
    check_ranges(args, latency_us=(0, 1e6), gbit=(1e-3, 1e4))
    check_output("json", args.json)
    results: dict[str, Any] = {}
    if args.only != "rllib":
        results["model"] = model(args)
    if args.only != "model":
        results["rllib"] = rllib.measure(args.quick)
        print_table(rllib.TITLE, rllib.table(results["rllib"]))
    if args.json is not None:
        write_json(args.json, results)
    return results


def model(args: ClusterStudyArgs) -> dict[str, Any]:
    """Measure the costs, fit the spread, and print what the model expects."""
    costs = measured_costs.measure(args.quick)
    if args.latency_us is not None:
        costs = dataclasses.replace(costs, latency=args.latency_us / 1e6)
    if args.gbit is not None:
        costs = dataclasses.replace(costs, byte=8e-9 / args.gbit)
    sizes = Sizes()
    if args.per_second is not None:
        costs = fit_spread(costs, dict(zip((1, 2), args.per_second, strict=True)), sizes)
    print(in_words(costs))
    kinds = {
        "The same tables and samples in all, shared by the workers": lambda workers: sizes,
        "As many tables and samples for each worker as for one": sizes.times,
    }
    expected = {}
    for title, sizes_of in kinds.items():
        rows = [("workers", "steps/s", "times one", "averaging", "waiting", "kB sent a step")]
        found = [expect(costs, workers, sizes_of(workers)) for workers in WORKERS]
        for one in found:
            total = sizes_of(one.workers)
            rows.append(
                (
                    str(one.workers),
                    f"{one.per_second:,.0f}",
                    f"{one.per_second / found[0].per_second:.1f}",
                    f"{one.averaging:.0%}",
                    f"{one.waiting:.0%}",
                    f"{sent(costs, one.workers, total) / total.gradients / 1e3:.0f}",
                )
            )
        print_table(title, rows)
        expected[title] = [dataclasses.asdict(one) for one in found]
    return {"costs": costs.as_dict(), "expected": expected}


def in_words(costs: Costs) -> str:
    """The costs as a sentence."""
    return (
        f"A step of the tables takes {1e6 * costs.step:.0f} µs and {1e6 * costs.table:.2f} µs a table, a gradient step "
        f"{1e6 * costs.gradient:.0f} µs and {1e6 * costs.sample:.2f} µs a sample, and averaging {costs.size / 1e3:.0f} "
        f"kB of gradients {1e6 * averaging(costs, 2):.0f} µs with two workers; the spread is {costs.spread:.2f}."
    )


def main() -> None:
    """Read the command line and study."""
    run_command("cluster_study", ClusterStudyArgs, study)


if __name__ == "__main__":
    main()
