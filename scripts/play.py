"""Play against an opponent with the mouse: python -m scripts.play --opponent NAME_OR_MODEL"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from agents.counts import Count
from agents.human.screen import MatchWindow
from agents.models import PLAYER_HELP, TRUST_HELP, in_one_game, join, load_player, short_name
from agents.options import TABLE_HELP, check_ranges, check_table
from airhockey_env.drawing.render import SMALLEST
from airhockey_env.drawing.window import import_pygame
from airhockey_env.live import LiveMatch
from scripts._command import run_command


@dataclass(frozen=True)
class PlayArgs:
    """Play a match with the mouse, on the left: R restarts, Esc leaves."""

    opponent: Annotated[str, tyro.conf.arg(help=f"Who plays against you: {PLAYER_HELP}")] = "striker"
    skill: float = 1.0
    """Share of its paddle's speed that the opponent uses, 0 to 1."""
    table: Annotated[str, tyro.conf.arg(help=TABLE_HELP)] = "full_size"
    points: Count = 7
    """Points that win the match."""
    fps: int = 60
    """Pictures for a second, 20 to 480."""
    sound: bool = True
    """Play sounds. Where there is no audio device, there are none."""
    size: tuple[int, int] = (1280, 704)
    """Width and height of the window, px."""
    trust: Annotated[bool, tyro.conf.arg(help=TRUST_HELP)] = False


def name_of(opponent: str) -> str:
    """What to call an opponent that was given by its name or its file."""
    name = short_name(opponent.replace("\\", "/"))
    return name if len(name) <= 20 else f"{name[:19]}…"


def play(args: PlayArgs) -> None:
    """Open a window and play.

    Raises:
        ValueError, OSError: an argument does not fit, or there is no screen.
        gymnasium.error.DependencyNotInstalled: pygame-ce is missing.
    """
    check_ranges(args, skill=(0, 1), points=(1, 99), fps=(20, 480))
    if not all(SMALLEST <= side <= 8192 for side in args.size):
        raise ValueError(f"--size must be two whole numbers from {SMALLEST} to 8192, got {args.size}")
    pygame = import_pygame()
    opponent = in_one_game(load_player(args.opponent, "--opponent", trust=args.trust))
    spec = check_table(args.table)
    print("Getting ready; the first time takes a while.", flush=True)
    match = LiveMatch(opponent, skill=args.skill, table=spec, points=args.points)
    join(match.game, opponent)
    try:
        screen = MatchWindow(match, name_of(args.opponent), size=args.size, fps=args.fps, sound=args.sound)
    except pygame.error as error:
        raise OSError(f"there is no screen to open a window on: {error}") from error
    if (driver := screen.window.fallen_back) is not None:
        screen.close()
        raise OSError(f"there is no screen to open a window on: SDL found only its driver {driver!r}")
    screen.run()
    left, right = match.score
    print(f"You {left} : {right} {name_of(args.opponent)}")


def main() -> None:
    """Read the command line and play."""
    run_command("play", PlayArgs, play)


if __name__ == "__main__":
    main()
