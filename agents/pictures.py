"""Pictures for the documentation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import gymnasium
import numpy as np

import airhockey_env
from agents.plots import BLUE, new_figure, plain, save_figure
from airhockey_env.opponents.trained import trained_policy


def observation_kinds(path: Path, names: Sequence[str], *, steps: int = 60) -> None:
    """Write a figure of one moment as a player can be given to see it: as numbers, in colour and in grey.

    Args:
        names: what the numbers of a state observation are, in their order.
        steps: control steps from the serve to the moment, which the expert plays against the striker.
    """
    kinds = ("state", "rgb", "grayscale")
    envs = {
        kind: gymnasium.make(f"{airhockey_env.__name__}:AirHockey-v0", obs_type=kind, render_mode="rgb_array")
        for kind in kinds
    }
    expert = trained_policy("expert")
    seen = {kind: env.reset(seed=0)[0] for kind, env in envs.items()}
    for _ in range(steps):
        (action,) = expert(seen["state"][np.newaxis])
        seen = {kind: env.step(action)[0] for kind, env in envs.items()}

    figure = new_figure(8.4, 7.0)
    rows = figure.subfigures(2, 1, squeeze=False, height_ratios=(0.9, 1.0))
    above, below = rows.flat
    drawn, numbers = above.subplots(1, 2, width_ratios=(1.5, 1.0))
    colour, grey = below.subplots(1, 2)
    drawn.imshow(envs["state"].render())
    drawn.set_title("the table, as render() draws it")
    numbers.barh(range(len(names)), seen["state"], color=BLUE)
    numbers.set_yticks(range(len(names)), names, fontsize=8)
    numbers.invert_yaxis()
    numbers.set_xlim(-1.0, 1.0)
    numbers.set_title('obs_type="state": 13 numbers')
    plain(numbers)
    colour.imshow(seen["rgb"])
    colour.set_title('obs_type="rgb": 84 x 84 x 3')
    grey.imshow(seen["grayscale"], cmap="gray", vmin=0, vmax=255)
    grey.set_title('obs_type="grayscale": 84 x 84')
    for axis in (drawn, colour, grey):
        axis.set_axis_off()
    save_figure(figure, path)
