"""With NUMBA_DISABLE_JIT=1 everything runs as plain Python, with the same bits."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from airhockey_env import Game
from tests.engine.scenes import random_scene

PLAY = """
import numpy as np
from tests.engine.test_plain_python import trace
print(trace())
"""


def trace() -> str:
    """All bits of some short random scenes, by every method, and of some short games."""
    bits = []
    rng = np.random.default_rng(5)
    for method in ("continuous", "kiss", "overlap"):
        for heavy in (0.0, 0.3):
            table = random_scene(rng, discs=(4, 5), walls=True, heavy=heavy).table(method=method)
            for _ in range(3):
                contacts = table.step(0.05)
                bits += [contacts.tobytes(), table.positions.tobytes(), table.velocities.tobytes()]
    for tables in (1, 3):
        game = Game(tables)
        game.reset(seed=3)
        for _ in range(40):
            game.step(left=rng.uniform(-1.0, 1.0, (tables, 2)).astype(np.float32))
            bits += [game.get_state().tobytes(), game.out.observation.tobytes()]
    return b"".join(bits).hex()


def test_plain_python_gives_the_same_bits():
    root = Path(__file__).parents[2]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(root)}
    result = subprocess.run(
        [sys.executable, "-c", PLAY], cwd=root, env=environment, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == trace()
    assert len(trace()) > 3 * 2 * 3 * 2 * 5 * 32  # there is something to compare
