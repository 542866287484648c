"""Best responses to an agent in training: processes that train beside it, whose agents then join its league.

In self-play alone an agent meets those who play as it does. An agent that learns to beat it, and nothing else, finds
what nobody in the league has tried yet. These are the exploiters of Vinyals et al. ("Grandmaster level in StarCraft II
using multi-agent reinforcement learning", Nature 575, 2019), and the oracles of Lanctot et al. ("A unified
game-theoretic approach to multiagent reinforcement learning", NeurIPS 2017).
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from agents.training.runs import RunFolder
from airhockey_env.opponents.policy import MlpPolicy

POINTS = 400
"""Points that a best response plays against the agent in the end. Nobody but its own report uses them."""


class Response(NamedTuple):
    """A best response that is being trained."""

    name: str  # as a member of the league
    run: RunFolder
    process: subprocess.Popen[bytes]


class Responses:
    """Trains best responses to an agent as it was at some number of steps, each in a process of its own.

    Attributes:
        name: the name of the agent's run. Theirs are runs/NAME-response-STEPS-KIND-SEED/.

    Args:
        kinds: where their training begins, see `agents.training.start.KINDS`; a kind may be there several times.
        steps: number of steps that each trains.
        seed: they have the seeds from this one on.
    """

    def __init__(self, kinds: tuple[str, ...], steps: int, seed: int) -> None:
        self.name = ""
        self.kinds, self.steps, self.seed = kinds, steps, seed
        self.running: list[Response] = []

    def begin(self, agent: MlpPolicy | None, at: int) -> None:
        """Start training against the agent as it is at a number of steps.

        Args:
            agent: the agent. None: go on with what an earlier call with this number of steps has begun.
            at: the number of steps.
        """
        name = f"{self.name}-response-{at}"
        target = RunFolder(Path("runs") / name).policy
        if agent is not None:
            target.parent.mkdir(parents=True, exist_ok=True)
            agent.save(target)
        for number, kind in enumerate(self.kinds):
            seed = self.seed + number
            options = {
                "name": name,
                "kinds": kind,
                "seeds": 1,
                "seed": seed,
                "steps": self.steps,
                "points": POINTS,
            }
            given = [part for option, value in options.items() for part in (f"--{option}", str(value))]
            with (target.parent / f"{kind}-{seed}.log").open("ab") as log:
                process = subprocess.Popen(
                    [sys.executable, "-m", "scripts.exploit", str(target), *given],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    env={**os.environ, "OMP_NUM_THREADS": "1"},  # there is one process for each core already
                )
            run = RunFolder(Path("runs") / f"{name}-{kind}-{seed}")
            self.running.append(Response(f"response {kind}-{seed} at {at}", run, process))

    @property
    def done(self) -> bool:
        """Whether none of them is still being trained.

        Raises:
            RuntimeError: one has failed.
        """
        codes = [response.process.poll() for response in self.running]
        for response, code in zip(self.running, codes, strict=True):
            if code:
                raise RuntimeError(f"the training of {response.run.path} has failed: see the log beside its opponent")
        return None not in codes

    def take(self) -> list[tuple[str, MlpPolicy]]:
        """Those that are done: their names in the league, and their policies."""
        taken = [(response.name, MlpPolicy.load(response.run.policy)) for response in self.running]
        self.running.clear()
        return taken

    def stop(self) -> None:
        """Let all that are being trained save what they have, and end."""
        for response in self.running:
            response.process.terminate()
        for response in self.running:
            response.process.wait()
        self.running.clear()
