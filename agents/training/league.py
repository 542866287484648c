"""A league: an agent against itself, its past selves and the scripted opponents.

Every episode's opponent is drawn anew: with fixed shares the latest self, a scripted opponent or a past self, and
among those by prioritised fictitious self-play, the more often the harder they are (Vinyals et al., "Grandmaster level
in StarCraft II using multi-agent reinforcement learning", Nature 575, 2019). Without a share of their own, the scripted
ones would soon be too easy to be met, and be forgotten.

The environment is the same from both sides, to the bit, so the agent learns on the left and its opponents play on the
right.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from agents.files import COUNT, FILE, SHARE, TEXT, or_none, read_json, write_json
from agents.models import export_policy
from agents.seeding import sequence
from airhockey_env.opponents.players import Player as Opponent
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

WINDOW = 400
"""Points over which a member's record is averaged."""

LEAST_PRIORITY = 0.02
"""The priority of a member that always loses (1 is that of one that always wins): its record has to stay fresh."""

LATEST = "latest self"


@dataclass
class Member:
    """One of the league, and how the agent has lately done against it."""

    name: str
    points: int = 0
    won: float = 0.5  # share of points won by the agent; a draw counts as half
    drawn: float = 0.0

    def record(self, won: float, drawn: float) -> None:
        """Take in a point: an average over the first `WINDOW` points, then one that forgets."""
        self.points += 1
        share = 1.0 / min(self.points, WINDOW)
        self.won += share * (won - self.won)
        self.drawn += share * (drawn - self.drawn)

    @property
    def priority(self) -> float:
        return max((1.0 - self.won) ** 2, LEAST_PRIORITY)


class League(BaseCallback):
    """Draws an opponent for every episode, and takes in a copy of the agent every so often.

    Args:
        scripted: names of scripted opponents.
        latest_share: of episodes against the agent as it is now.
        scripted_share: of episodes against scripted opponents.
        snapshot_every: steps between copies.
        most_past_selves: kept; the weakest goes when there are more.
        seed: of the draws.
    """

    def __init__(
        self,
        scripted: Sequence[str],
        *,
        latest_share: float,
        scripted_share: float,
        snapshot_every: int,
        most_past_selves: int,
        seed: int,
    ) -> None:
        super().__init__()
        self.members = [Member(LATEST), *(Member(name) for name in scripted)]
        self.scripted = tuple(scripted)
        self.past: dict[int, MlpPolicy] = {}  # past selves by their number among the members
        self.latest_share = latest_share
        self.scripted_share = scripted_share
        self.snapshot_every = snapshot_every
        self.most_past_selves = most_past_selves
        self.due = 0  # the next copy, in steps
        self.seed = seed
        self.random = np.random.default_rng(sequence("league", seed))

    @property
    def pool(self) -> tuple[Opponent, ...]:
        """The environment's pool of opponents: the members, in their order."""
        # The latest self's place is somebody's who is replaced before he plays.
        return ("idle", *self.scripted, *(self.past[number] for number in sorted(self.past)))

    @property
    def tables(self) -> AirHockeySB3VecEnv:
        """The batch that the agent trains on, whatever wraps it."""
        batch: Any = self.training_env.unwrapped
        return batch

    def draw(self, number: int) -> np.ndarray:
        """(number,) places in the pool of opponents for that many episodes."""
        priorities = np.array([member.priority for member in self.members])
        scripted, past = priorities[1 : 1 + len(self.scripted)], priorities[1 + len(self.scripted) :]
        shares = np.concatenate(
            [
                [self.latest_share],
                self.scripted_share * scripted / scripted.sum(),
                (1.0 - self.latest_share - self.scripted_share) * past / max(past.sum(), LEAST_PRIORITY),
            ]
        )
        shares[0] += 1.0 - shares.sum()  # while there is no past
        return self.random.choice(len(self.members), number, p=shares)

    def _on_training_start(self) -> None:
        self.random = np.random.default_rng(sequence("league", self.seed, self.num_timesteps))
        self.tables.set_opponents(self.draw(self.tables.num_envs))

    def _on_rollout_start(self) -> None:
        latest = export_policy(self.model)
        self.tables.set_opponent(0, latest)
        if self.num_timesteps >= self.due:
            self.due = self.num_timesteps + self.snapshot_every
            self.take_in(f"self at {self.num_timesteps}", latest)
        self.logger.record("league/drawn", float(np.mean([member.drawn for member in self.members])))
        self.logger.record("league/won", float(np.mean([member.won for member in self.members])))

    def _on_step(self) -> bool:
        rows = np.flatnonzero(self.locals["dones"])
        if len(rows):
            numbers = self.tables.opponent_indices[rows]
            for row, number in zip(rows, numbers, strict=True):
                info = self.locals["infos"][row]
                drawn = info["TimeLimit.truncated"]
                self.members[number].record(0.5 if drawn else float(info["is_success"]), float(drawn))
            self.tables.set_opponents(self.draw(len(rows)), rows)
        return True

    def take_in(self, name: str, policy: MlpPolicy) -> None:
        """Make a copy of the agent a member; it replaces the weakest past self if there are as many as allowed."""
        if len(self.past) < self.most_past_selves:
            number = len(self.members)
            self.members.append(Member(name))
            self.tables.add_opponent(policy)
        else:
            number = max(self.past, key=lambda k: self.members[k].won)
            self.members[number] = Member(name)
            self.tables.set_opponent(number, policy)
        self.past[number] = policy

    def save(self, folder: Path) -> None:
        """Write the members, their records and the past selves' policies."""
        (folder / "league").mkdir(exist_ok=True)
        files = {number: f"{self.members[number].name.split()[-1]}.npz" for number in self.past}
        for number, policy in self.past.items():
            policy.save(folder / "league" / files[number])
        members = [{**asdict(member), "file": files.get(k)} for k, member in enumerate(self.members)]
        write_json(folder / "league.json", {"due": self.due, "members": members})
        for file in (folder / "league").glob("*.npz"):  # last: of members who left
            if file.name not in files.values():
                file.unlink()

    def load(self, folder: Path) -> None:
        """Take up what `save` wrote, before training begins.

        Raises:
            FileNotFoundError, ValueError: files are missing or damaged.
        """
        member = {"name": TEXT, "points": COUNT, "won": SHARE, "drawn": SHARE, "file": or_none(FILE)}
        kept: dict[str, Any] = read_json(folder / "league.json", {"due": COUNT, "members": [member]})
        names = [entry["name"] for entry in kept["members"][: 1 + len(self.scripted)]]
        if names != [LATEST, *self.scripted]:
            raise ValueError(
                f"{folder / 'league.json'}: its members must begin with {[LATEST, *self.scripted]}, got {names}"
            )
        files = [entry["file"] for entry in kept["members"]]
        if any(file is None for file in files[len(names) :]) or any(files[: len(names)]):
            raise ValueError(f"{folder / 'league.json'}: past selves and nobody else must have a file, got {files}")
        past = [entry["name"] for entry in kept["members"][len(names) :]]
        if not all(re.fullmatch(r"self at [0-9]+", name) for name in past):  # which will be names of files
            raise ValueError(f"{folder / 'league.json'}: past selves must be called 'self at' a step, got {past}")
        fields = [field.name for field in dataclasses.fields(Member)]
        self.members = [Member(**{name: entry[name] for name in fields}) for entry in kept["members"]]
        self.due = kept["due"]
        self.past = {k: MlpPolicy.load(folder / "league" / file) for k, file in enumerate(files) if file}
