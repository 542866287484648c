"""Numbers from the normal distribution, inside compiled code."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled
from airhockey_env.kernel.random_stream import draw


def _ziggurat(layers: int = 256, edge: float = 3.6541528853610088) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Widths of the layers, all of one area, under exp(-x**2 / 2), and their heights from the bottom up.

    The bottom layer holds the tail beyond `edge` too, and is as wide as its area makes it.
    """
    area = edge * math.exp(-0.5 * edge**2) + math.sqrt(0.5 * math.pi) * math.erfc(edge / math.sqrt(2.0))
    widths, heights = [edge], [0.0, math.exp(-0.5 * edge**2)]
    while len(widths) < layers - 1:
        heights.append(heights[-1] + area / widths[-1])
        widths.append(math.sqrt(-2.0 * math.log(heights[-1])))
    bottom = area / heights[1]
    return np.array([bottom, *widths, 0.0]), np.array([*heights, 1.0])


_WIDTHS, _HEIGHTS = _ziggurat()
_EDGE = float(_WIDTHS[1])
_LAYERS = len(_WIDTHS) - 1


@compiled
def draw_normal(state):
    """A number from the normal distribution (Marsaglia and Tsang, "The ziggurat method", 2000)."""
    while True:
        u = draw(state) * _LAYERS
        layer = int(u)
        x = (2.0 * (u - layer) - 1.0) * _WIDTHS[layer]
        if abs(x) < _WIDTHS[layer + 1]:
            return x
        if layer == 0:
            while True:  # the tail
                a = -math.log(1.0 - draw(state)) / _EDGE
                b = -math.log(1.0 - draw(state))
                if 2.0 * b > a * a:
                    return math.copysign(_EDGE + a, x)
        y = _HEIGHTS[layer] + draw(state) * (_HEIGHTS[layer + 1] - _HEIGHTS[layer])
        if y < math.exp(-0.5 * x * x):
            return x
