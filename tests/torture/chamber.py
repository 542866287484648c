"""The chamber: bouts of hostile play and trials, one after the other or on several cores, until the time is up."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from airhockey_env.tables import FIELDS
from tests.torture.cases import Case
from tests.torture.draws import draw_arguments, draw_operation
from tests.torture.hostile import Report, play_hostile
from tests.torture.tables import RATES, TABLES
from tests.torture.trial import NOT_AGAIN, Trial, law_of

PLACES = tuple((name, rate) for name in TABLES for rate in RATES)
HOSTILE_STEPS = 100_000
"""Steps of hostile play in a bout."""
TRIALS, OPERATIONS = 4, 60
"""Trials in a bout, and operations in a trial."""
REPEAT = 8
"""Every so manyth bout plays its hostile part twice, which must come to the same bits."""


@dataclass
class Tally:
    """What was played, and what was found."""

    bouts: int = 0
    hostile_steps: int = 0
    """Steps of hostile play, each a step of one table."""
    trials: int = 0
    trial_steps: int = 0
    operations: int = 0
    refused: int = 0
    """Trials that ended with bad arguments."""
    worst: float = -np.inf
    """m, the deepest overlap."""
    counts: list[int] = field(default_factory=lambda: [0] * 6)
    """What hostile play met: contacts with paddles, with edges, crowded steps, pinned pucks, points, tables drawn."""
    cases: list[Case] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)

    @property
    def steps(self) -> int:
        """In all."""
        return self.hostile_steps + self.trial_steps

    def add(self, other: Tally) -> None:
        """Count another's in."""
        for name in ("bouts", "hostile_steps", "trials", "trial_steps", "operations", "refused"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.worst = max(self.worst, other.worst)
        self.counts = [mine + its for mine, its in zip(self.counts, other.counts, strict=True)]
        self.cases += other.cases


def play_bout(seed: int, number: int, steps: int = HOSTILE_STEPS, trials: int = TRIALS) -> Tally:
    """Hostile play on a table and at a rate, then some trials. All of it follows from the two numbers."""
    name, rate = PLACES[number % len(PLACES)]
    tally = Tally(bouts=1)
    own_seed = int(np.random.SeedSequence((seed, number)).generate_state(1)[0])
    report = play_hostile(name, rate, steps, own_seed)
    tally.add(_tally_of(report))
    if number % REPEAT == 0 and report.case is None:
        again = play_hostile(name, rate, steps, own_seed)
        tally.add(_tally_of(again))
        if again != report:
            play = {"name": name, "control_hz": rate, "steps": steps, "seed": own_seed}
            tally.cases.append(Case("hostile", play, [], NOT_AGAIN))
    rng = np.random.default_rng((seed, number))
    for _ in range(trials):
        _count_trial(tally, rng)
    return tally


def _tally_of(report: Report) -> Tally:
    cases = [] if report.case is None else [report.case]
    return Tally(hostile_steps=report.steps, worst=report.worst, counts=list(report[2:8]), cases=cases)


def _count_trial(tally: Tally, rng: np.random.Generator) -> None:
    """Play a trial."""
    face, arguments, weird = draw_arguments(rng)
    case = Case(face, arguments, [], weird=weird).through_json()
    tally.trials += 1
    try:
        trial = Trial(case.face, case.arguments, case.weird)
        tally.refused += trial.refused
        # A table with a weird number may be one, but so large or fast that rounding alone breaks the laws.
        if not trial.refused and not set(weird) & set(FIELDS):
            styles = np.zeros((trial.n, 2), np.int64)
            for _ in range(OPERATIONS):
                operation = json.loads(json.dumps(draw_operation(rng, trial, styles)))
                case.operations.append(operation)
                trial.do(operation)
                tally.operations += 1
        tally.trial_steps += trial.steps
        tally.worst = max(tally.worst, float(trial.tally[0]))
    except Exception as error:
        tally.cases.append(Case(case.face, case.arguments, case.operations, law_of(error), weird))


def torture(seed: int, seconds: float, steps: int | None, jobs: int, first: int = 0) -> Iterator[Tally]:
    """Tallies of bouts until so many seconds have passed, or so many steps were played; of bouts from number `first`.

    With jobs, bouts run in as many processes, and their tallies come as they end.
    """
    end, played = time.monotonic() + seconds, 0

    def goes_on() -> bool:
        return time.monotonic() < end and (steps is None or played < steps)

    number = first
    if jobs == 1:
        while goes_on():
            tally = play_bout(seed, number)
            played += tally.steps
            number += 1
            yield tally
        return
    # Not forked: numba and its threads do not go through a fork.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_ignore_interrupts)
    running: set[Future[Tally]] = set()
    try:
        while goes_on():
            while len(running) < 2 * jobs:
                running.add(pool.submit(play_bout, seed, number))
                number += 1
            done, running = wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
            for future in done:
                tally = future.result()
                played += tally.steps
                yield tally
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _ignore_interrupts() -> None:
    """Ctrl-C is for the process that counts."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)


def save_cases(tally: Tally, folder: Path, seed: int) -> None:
    """Write a file of every case that has none yet."""
    folder.mkdir(parents=True, exist_ok=True)
    for case in tally.cases[len(tally.files) :]:
        words = "_".join("".join(c if c.isalnum() else " " for c in case.law.lower()).split()[:6])
        path = folder / f"{case.face}_{words}_{seed}_{len(tally.files)}.json"
        case.save(path)
        tally.files.append(path)
