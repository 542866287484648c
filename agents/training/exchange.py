"""A folder in which runs of self-play, and whoever else trains beside them, leave policies for each other's leagues."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path

from agents.training import workers
from agents.training.runs import NAME
from airhockey_env.opponents.policy import MlpPolicy


class Exchange:
    """Writes a run's policies into a folder, and finds those of others there.

    Every file is written whole and never changed, so each is read once. Where a run has several workers, worker 0 alone
    sees the folder, so that all of them take in the same policies at the same step.

    Args:
        folder: where the policies are, as .npz files.
        run: the name of this run. Files that begin with it are its own.
        known: names of files that have been read before.
    """

    def __init__(self, folder: Path, run: str, known: Iterable[str] = ()) -> None:
        self.folder, self.run = folder, run
        self._known = set(known)

    def put(self, policy: MlpPolicy, steps: int) -> None:
        """Leave a policy for the others, as worker 0.

        Raises:
            OSError: it cannot be written.
        """
        if workers.rank() == 0:
            policy.save(self.folder / f"{self.run}@{steps}.npz")

    def take(self) -> list[tuple[str, MlpPolicy]]:
        """The names and policies of the others' files that were not there at the last call, in the order of names.

        A file that holds no policy, or whose name no file of a league can have, is left out with a warning.

        Raises:
            workers.WorkerLost: a worker does not answer.
        """
        return workers.gather(self._new() if workers.rank() == 0 else [])[0]

    def _new(self) -> list[tuple[str, MlpPolicy]]:
        found = []
        for path in sorted(self.folder.glob("[!.]*.npz")):
            if path.stem in self._known or path.stem.startswith(f"{self.run}@"):
                continue
            self._known.add(path.stem)
            if not NAME.fullmatch(path.stem):
                warnings.warn(f"{path} does not join the league: its name must be like a run's", stacklevel=2)
                continue
            try:
                found.append((path.stem, MlpPolicy.load(path)))
            except (OSError, ValueError) as error:
                warnings.warn(f"{path} does not join the league: {error}", stacklevel=2)
        return found
