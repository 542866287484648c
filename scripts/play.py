"""Play against an opponent with the mouse: python -m scripts.play --opponent NAME_OR_MODEL"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from agents.conditions import Conditions
from agents.human.screen import MatchWindow
from agents.models import in_one_game, join, load_player, short_name
from agents.options import (
    PLAYER_HELP,
    CameraOption,
    Count,
    DelayOption,
    RandomizeOption,
    TableOption,
    Trust,
    check_ranges,
)
from airhockey_env.checks import check_whole_pair
from airhockey_env.drawing.render import LARGEST, SMALLEST
from airhockey_env.drawing.window import import_pygame
from airhockey_env.live import LiveMatch
from scripts._command import run_command


@dataclass(frozen=True)
class PlayArgs:
    """Play a match with the mouse. Your paddle is the left one; R restarts the match, and Esc closes the window.

    The opponent has the camera and the delay, if any are given. With ranges of tables, the match is played on one of
    them.
    """

    opponent: Annotated[str, tyro.conf.arg(help=f"Play against this player. {PLAYER_HELP}")] = "striker"
    skill: float = 1.0
    """Limit the opponent to this share of its paddle's top speed, from 0 to 1."""
    table: TableOption = "full_size"
    randomize: RandomizeOption = None
    camera: CameraOption = None
    action_delay_ms: DelayOption = (0.0,)
    points: Count = 7
    """Play until one side has this many points."""
    fps: int = 60
    """Draw this many frames per second, from 20 to 480."""
    sound: bool = True
    """Play sounds, if there is an audio device."""
    size: tuple[int, int] = (1280, 704)
    """Open a window of this width and height in pixels."""
    trust: Trust = False


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
    check_whole_pair("--size", args.size, SMALLEST, LARGEST)
    pygame = import_pygame()
    opponent = in_one_game(load_player(args.opponent, "--opponent", trust=args.trust))
    conditions = Conditions.of_options(args).drawn()
    print("Getting ready; the first time takes a while.", flush=True)
    match = LiveMatch(
        opponent,
        skill=args.skill,
        table=conditions.table,
        camera=conditions.camera,
        action_delay_ms=conditions.action_delay_ms,
        points=args.points,
    )
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
