"""Write a policy as an ONNX file: python -m scripts.export MODEL --onnx FILE"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents.models import load_player
from agents.onnx_files import (
    INPUT,
    OUTPUT,
    check_onnx,
    compare,
    played_observations,
    random_observations,
    to_onnx,
)
from agents.options import PLAYER_HELP, Trust, check_output
from airhockey_env.files import replace
from airhockey_env.kernel.state import observation_shape
from airhockey_env.opponents.policy import MlpPolicy
from scripts._command import run_command

MODEL_HELP = f"Export this player, which must be a network that sees states. {PLAYER_HELP}"


@dataclass(frozen=True)
class ExportArgs:
    """Write the network of a player as an ONNX file, for programs that play it without this package.

    The file is compared with the player, on random observations and on those of a game, before it is written.
    """

    model: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MODEL", help=MODEL_HELP)]
    onnx: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """Write to this .onnx file."""
    trust: Trust = False


def export(args: ExportArgs) -> None:
    """Convert, compare, write, and print.

    Raises:
        ValueError, OSError: an argument does not fit, or the file would not play as the player does.
        DependencyNotInstalled: ONNX or its runtime is missing.
    """
    check_onnx("export needs")
    check_output("onnx", args.onnx, ".onnx")
    policy = load_player(args.model, trust=args.trust)
    if not isinstance(policy, MlpPolicy):
        raise ValueError(
            "MODEL must be a fully connected network, tanh or ReLU, that sees states or the environments' stacks of "
            f"them, and {args.model} is another kind of player"
        )
    contents = to_onnx(policy)
    lines = []
    for kind, observations in (("random", random_observations(policy)), ("played", played_observations(policy))):
        difference = compare(contents, policy, observations)
        lines.append(
            f"largest difference from {args.model} on {len(observations):,} {kind} observations: "
            f"{difference.largest:.1e} (its own rounding: {difference.rounding:.1e})"
        )
        if not difference.is_rounding:
            raise ValueError(f"the file would not play as the player does: {lines[-1]}")
    replace(args.onnx, lambda part: part.write_bytes(contents))
    shape = ", ".join(map(str, ("N", *observation_shape(policy.stack))))
    print(f"{args.onnx}: {INPUT} ({shape}) to {OUTPUT} (N, 2), {len(contents):,} bytes", *lines, sep="\n")


def main() -> None:
    """Read the command line and export."""
    run_command("export", ExportArgs, export)


if __name__ == "__main__":
    main()
