"""Videos of play."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from agents.conditions import EXACT, Conditions
from agents.models import Player, in_one_game, join
from agents.seeding import table_seeds
from airhockey_env._base import draw_row
from airhockey_env.drawing.render import Renderer
from airhockey_env.files import replace
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT
from airhockey_env.kernel.tasks import TASKS

SUFFIXES = (".gif", ".mp4")


def frames_of_play(
    player: Player,
    opponent: Player,
    seconds: float,
    *,
    seed: int = 0,
    fps: int = 25,
    size: tuple[int, int] | None = None,
    task: str = "match",
    conditions: Conditions = EXACT,
) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a match or of a task, (height, width, 3) uint8 each, `fps` for a second of play.

    Args:
        player, opponent: as `play_points` takes them, for the left and the right paddle.
        seconds: of play; when an episode ends, the next begins.
        task: a key of `TASKS`.
        conditions: under which the left player plays, see `play_points`.
    """
    control_hz = 50.0
    left, right = in_one_game(player), in_one_game(opponent)
    game = Game(
        1,
        task=task,
        left=left,
        right=right,
        max_episode_steps=TASKS[task].max_episode_steps,
        control_hz=control_hz,
        **conditions.game_arguments(LEFT),
    )
    join(game, left, right)
    game.reset(table_seeds("video", seed, 1))
    renderer = Renderer(game.spec, size)
    shown = 0.0
    for step in range(round(seconds * control_hz)):
        if step >= shown:
            yield draw_row(renderer, game, 0)
            shown += control_hz / fps
        game.step()


def write_video(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int = 25) -> None:
    """Write frames as .gif (one palette of colours for all) or .mp4.

    Raises:
        ValueError: another suffix.
        gymnasium.error.DependencyNotInstalled: an .mp4 without what writes it.
    """
    if path.suffix not in SUFFIXES:
        raise ValueError(f"a video's name must end in one of {SUFFIXES}, got {path.name!r}")
    replace(path, lambda part: (_write_gif if path.suffix == ".gif" else _write_mp4)(part, frames, fps))


def _write_gif(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int) -> None:
    from PIL import Image

    first = next(frames)
    palette = Image.fromarray(first).quantize(256, Image.Quantize.MAXCOVERAGE)  # keeps the colours of small things
    pictures = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in (first, *frames)
    ]
    pictures[0].save(
        path, "GIF", save_all=True, append_images=pictures[1:], duration=round(1000 / fps), loop=0, optimize=False
    )


def _write_mp4(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int) -> None:
    try:
        from imageio_ffmpeg import write_frames
    except ImportError as error:
        raise DependencyNotInstalled(
            'an .mp4 needs imageio-ffmpeg: pip install -e ".[video]"; a .gif does not'
        ) from error

    first = next(frames)
    height, width = (size // 2 * 2 for size in first.shape[:2])  # which the usual colour format needs
    file = write_frames(path, (width, height), fps=fps, codec="libx264", macro_block_size=1)
    try:
        file.send(None)
        for frame in chain((first,), frames):
            file.send(np.ascontiguousarray(frame[:height, :width]))
    finally:
        file.close()
